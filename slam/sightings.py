"""What keyframes observed of which planes, as factors that are made all at once."""

from __future__ import annotations

from collections.abc import Iterable

import gtsam
import numpy as np

from slam.core import Array, IntArray, PlaneObservation
from slam.estimates import Estimates, room_for
from slam.factors import huber, sighting
from slam.linearpoint import LinearPoint
from slam.solver import Solver
from slam.variables import NO_STEP, keyframe_key, plane_key

SIGHTING = "plane"


class Sightings:
    """The observations that a solver holds, from the next ``settle`` on. They are linearised and
    weighed as all other factors are (``slam.linearised``)."""

    def __init__(
        self, solver: Solver, estimates: Estimates, at: LinearPoint, robust: float, stale: float
    ):
        """robust: standard deviations from which an observation counts less (Huber), by itself;
        stale: change of its weight from which its factor is made anew."""
        self._solver = solver
        self._estimates = estimates
        self._at = at
        self._robust = robust
        self._stale = stale
        self._row: dict[tuple[int, int], int] = {}
        self._rows_made = 0
        self._by_keyframe: dict[int, set[int]] = {}
        self._by_plane: dict[int, set[int]] = {}
        self._of = np.zeros((256, 2), dtype=np.int64)  # keyframe and plane of each
        self._seen = np.zeros((256, 3, 3))
        self._whiten = np.zeros((256, 3, 3))
        self._weight = np.zeros(256)
        self._changed: set[int] = set()
        self._unit = gtsam.noiseModel.Unit.Create(3)

    def observe(self, keyframe: int, plane: int, observation: PlaneObservation, place: int) -> None:
        """Observation number ``place`` of a keyframe is of a plane, whatever was thought."""
        row = self._row.get((keyframe, place))
        if row is None:
            row = self._new(keyframe, place, observation)
        else:
            self._by_plane[int(self._of[row, 1])].discard(row)
        self._of[row, 1] = plane
        self._by_plane.setdefault(plane, set()).add(row)
        self._changed.add(row)

    def _new(self, keyframe: int, place: int, observation: PlaneObservation) -> int:
        row, self._rows_made = self._rows_made, self._rows_made + 1
        self._row[keyframe, place] = row
        self._by_keyframe.setdefault(keyframe, set()).add(row)
        self._of = room_for(self._of, row)
        self._seen = room_for(self._seen, row)
        self._whiten = room_for(self._whiten, row)
        self._weight = room_for(self._weight, row)
        self._of[row] = keyframe, -1
        self._seen[row] = observation.rows
        self._whiten[row] = np.linalg.cholesky(np.linalg.inv(observation.covariance)).T
        return row

    def forget(self, keyframe: int, place: int) -> None:
        """The observation is of nothing."""
        row = self._row.pop((keyframe, place))
        self._by_plane[int(self._of[row, 1])].discard(row)
        self._by_keyframe[keyframe].discard(row)
        self._of[row, 1] = -1
        self._changed.add(row)

    def weigh(self, keyframes: Iterable[int]) -> None:
        """Does what these saw count as it did? Far from where it was first seen, a plane that has
        turned a little is somewhere else."""
        rows = _rows(self._by_keyframe, keyframes)
        known = self._weight[rows]
        stale = (known > 0.0) & (np.abs(self._weights(rows) - known) > self._stale)
        self._changed.update(rows[stale].tolist())

    def settle(self, keyframes: Iterable[int], planes: Iterable[int]) -> None:
        """Gives the solver what has changed, and anew what is about keyframes and planes that are
        linearised elsewhere now."""
        changed = np.array(sorted(self._changed), dtype=np.int64)
        moved = _rows(self._by_keyframe, keyframes), _rows(self._by_plane, planes)
        rows = np.unique(np.concatenate([changed, *moved]))
        for row in rows.tolist():
            self._solver.remove((SIGHTING, row))
        rows = rows[self._of[rows, 1] >= 0]
        for row, factor in zip(rows.tolist(), self._factors(rows), strict=True):
            self._solver.add((SIGHTING, row), factor, 3)
        self._changed = set()

    def _weights(self, rows: IntArray) -> Array:
        """What they count where keyframes and planes are now."""
        return huber(self._linear(rows, self._estimates)[0], self._robust)

    def _linear(self, rows: IntArray, of: Estimates | LinearPoint) -> tuple[Array, Array, Array]:
        keyframes, planes = self._of[rows].T
        return sighting(
            *(of.poses[keyframes], self._seen[rows], self._whiten[rows]),
            *(self._estimates.charts(planes), of.coordinates[planes]),
        )

    def _factors(self, rows: IntArray) -> list[gtsam.NonlinearFactor]:
        self._weight[rows] = self._weights(rows)
        scale = np.sqrt(self._weight[rows])[:, None]
        error, by_pose, by_plane = self._linear(rows, self._at)
        parts = -scale * error, scale[:, None] * by_pose, scale[:, None] * by_plane
        keyframes, planes = self._of[rows].T.tolist()
        linear, at = gtsam.GaussianFactorGraph(), gtsam.Values()
        for keyframe, plane, b, A, B in zip(keyframes, planes, *parts, strict=True):
            linear.add(keyframe_key(keyframe), A, plane_key(plane), B, b, self._unit)
        for keyframe in dict.fromkeys(keyframes):
            at.insert(keyframe_key(keyframe), NO_STEP)
        for plane in dict.fromkeys(planes):
            at.insert(plane_key(plane), self._at.coordinates[plane])
        graph = gtsam.LinearContainerFactor.ConvertLinearGraph(linear, at)
        return [graph.at(place) for place in range(graph.size())]


def _rows(of: dict[int, set[int]], ids: Iterable[int]) -> IntArray:
    none: set[int] = set()
    return np.array(sorted(none.union(*(of.get(each, none) for each in ids))), dtype=np.int64)
