"""What a mapped plane was built from, and how far it reaches."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from slam.association import PlaneBelief
from slam.cells import CellGrid, Stretches
from slam.core import Array, Floats, IntArray, PlaneObservation, point_ids, transform_points


@dataclass(frozen=True)
class Observed:
    """One observation that supports a plane: its keyframe, and its place among that one's."""

    keyframe: int
    place: int
    observation: PlaneObservation


@dataclass
class Chunk:
    """The points that one observation added. points: base frame; shown: those that a detector is
    shown; mapped: those, map frame, as they were told last."""

    keyframe: int
    points: Floats
    ids: IntArray
    shown: NDArray[np.bool_]
    mapped: Array | None = None

    def told(self, poses: Array, moved: NDArray[np.bool_]) -> Array:
        """The shown points in the map frame, worked out again if the keyframe moved."""
        if self.mapped is None or moved[self.keyframe]:
            self.mapped = transform_points(poses[self.keyframe], self.points[self.shown])
        return self.mapped

    def dense(self, poses: Array) -> Array:
        """All points in the map frame."""
        return transform_points(poses[self.keyframe], self.points)


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
        level = bool(abs(observation.normal[2]) > 0.7)
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
