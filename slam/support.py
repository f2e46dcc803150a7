"""What a mapped plane was built from, and how far it reaches."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from slam.association import PlaneBelief
from slam.cells import CellGrid, Stretches
from slam.core import (
    HORIZONTAL,
    Array,
    Floats,
    IntArray,
    PlaneObservation,
    point_ids,
    transform_points,
)
from slam.estimates import room_for


@dataclass(frozen=True)
class Observed:
    """One observation that supports a plane: its keyframe, and its place among that one's."""

    keyframe: int
    place: int
    observation: PlaneObservation


@dataclass(frozen=True)
class Chunk:
    """The points that one observation added. points: base frame; shown: those that a detector is
    shown."""

    keyframe: int
    points: Floats
    ids: IntArray
    shown: NDArray[np.bool_]

    def dense(self, poses: Array) -> Array:
        """All points in the map frame."""
        return transform_points(poses[self.keyframe], self.points)


class Told:
    """The shown points of chunks, map frame, as they were told last: only what is new or has moved
    is worked out again, however many there are."""

    def __init__(self) -> None:
        self._chunks: list[tuple[Floats, int]] = []
        self._of_keyframe: dict[int, list[int]] = {}
        self._points = np.zeros((64, 3))
        self._ids = np.zeros(64, dtype=np.int64)
        self._end = 0

    def now(
        self, chunks: Sequence[Chunk], poses: Array, moved: Iterable[int]
    ) -> tuple[Array, IntArray]:
        """Points (M, 3) and their ids (M,). chunks: those of last time, then new ones; moved: the
        keyframes whose poses are others."""
        for keyframe in moved:
            for place in self._of_keyframe.get(keyframe, ()):
                self._put(place, poses[keyframe])
        for chunk in chunks[len(self._chunks) :]:
            place, count = len(self._chunks), int(chunk.shown.sum())
            self._points = room_for(self._points, self._end + count)
            self._ids = room_for(self._ids, self._end + count)
            self._ids[self._end : self._end + count] = chunk.ids[chunk.shown]
            self._chunks.append((chunk.points[chunk.shown], self._end))
            self._of_keyframe.setdefault(chunk.keyframe, []).append(place)
            self._end += count
            self._put(place, poses[chunk.keyframe])
        return self._points[: self._end].copy(), self._ids[: self._end]

    def _put(self, place: int, T_map_base: Array) -> None:
        points, start = self._chunks[place]
        self._points[start : start + len(points)] = transform_points(T_map_base, points)


class Support:
    """voxel [m]: of the points that are kept, and coarse_voxel of those that a detector is shown;
    grown: a floor or ceiling, which has no end, has changed when it has grown by this share;
    storey: the one that it was seen from."""

    def __init__(self, voxel: float, coarse_voxel: float, grown: float, storey: int):
        self.observed: list[Observed] = []
        self.chunks: list[Chunk] = []
        self.stretches = Stretches()
        self.belief = PlaneBelief()
        self.z_range = (np.inf, -np.inf)
        self.seen_at = 0.0
        self.keyframes: set[int] = set()
        self.shown = 0
        self.storey = storey
        self.changed = True
        self.told = Told()
        self._cells = CellGrid(voxel)
        self._coarse_cells = CellGrid(coarse_voxel)
        self._grown = grown

    @property
    def point_count(self) -> int:
        """How many points are kept."""
        return sum(len(chunk.ids) for chunk in self.chunks)

    def add(self, observed: Observed, scan_index: int, mapped: Array, places: Array) -> None:
        """Takes in an observation; of its points those that there were not yet. mapped: (N, 3) all
        of them, map frame; places: (N, 2) in the plane's chart."""
        self.observed.append(observed)
        self.keyframes.add(observed.keyframe)
        self.stretches.add(places[:, 0])
        if len(mapped):
            self.z_range = _hull(self.z_range, (mapped[:, 2].min(), mapped[:, 2].max()))
        self._keep_points(observed, scan_index, places)

    def _keep_points(self, observed: Observed, scan_index: int, places: Array) -> None:
        observation = observed.observation
        new = self._cells.take(places)
        if len(new) == 0:
            return
        shown = np.zeros(len(new), dtype=bool)
        shown[self._coarse_cells.take(places[new])] = True
        ids = point_ids(scan_index, observation.point_index[new])
        self.chunks.append(Chunk(observed.keyframe, observation.points[new], ids, shown))
        count = int(shown.sum())
        level = bool(abs(observation.normal[2]) > HORIZONTAL)
        self.changed |= not level or count > self._grown * self.shown
        self.shown += count

    def absorb(self, other: Support, places: Array) -> None:
        """Takes over another's observations and points; places: (N, 2) where they are in this
        plane's chart (what is believed of it is the caller's to merge)."""
        self.stretches.add(places[:, 0])
        self._cells.take(places)
        self._coarse_cells.take(places)
        self.observed += other.observed
        self.chunks += other.chunks
        self.z_range = _hull(self.z_range, other.z_range)
        self.seen_at = max(self.seen_at, other.seen_at)
        self.keyframes |= other.keyframes
        self.shown += other.shown
        self.changed = True


def _hull(a: tuple[float, float], b: tuple[float, float]) -> tuple[float, float]:
    return min(a[0], b[0]), max(a[1], b[1])
