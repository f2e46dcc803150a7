"""What of a room's floor is still free, and whether its doors are still joined."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
import shapely
from numpy.typing import NDArray
from scipy.ndimage import label
from shapely.geometry import Polygon

from slam.core import Array, IntArray
from worlds.truth import Door

CELL = 0.10
"""Of the grid [m]."""
CLEAR = 0.30
"""Distance from obstacles at which the base surely passes (its own and half a cell more) [m]."""
BEFORE_DOOR = 0.7
"""Nothing stands nearer than this to a doorway's edge [m]."""
LEAST_FREE = 0.4
"""Of the floor that could be reached, this part can be reached when everything stands."""


@dataclass
class RoomSpace:
    """A room that fills up. polygon: its clear outline; doors: that one can drive through."""

    polygon: Polygon
    doors: Sequence[Door]
    _taken: list[Polygon] = field(default_factory=list)

    def __post_init__(self) -> None:
        low_x, low_y, high_x, high_y = self.polygon.bounds
        xs, ys = np.arange(low_x, high_x, CELL), np.arange(low_y, high_y, CELL)
        x, y = np.meshgrid(xs, ys)
        self._cells = np.stack([x, y], axis=-1)
        self._free: NDArray[np.bool_] = shapely.contains_xy(self.polygon.buffer(-CLEAR), x, y)
        self._doors = [np.asarray(door.centre[:2]) for door in self.doors]
        zones = [door.width / 2.0 + BEFORE_DOOR for door in self.doors]
        self._before = shapely.union_all(
            [shapely.Point(at).buffer(zone) for at, zone in zip(self._doors, zones, strict=True)]
        )
        self._ways = [self._way(at, zone) for at, zone in zip(self._doors, zones, strict=True)]
        self._joined = self._parts(self._free)
        self._reachable = self._reached(self._free, self._joined)

    def take(self, footprint: Polygon, in_doorway: bool = False) -> bool:
        """Puts something there, if it fits and leaves a way from door to door.

        in_doorway: it may stand before a door (its leaf does).
        """
        if not self.polygon.covers(footprint) or any(t.intersects(footprint) for t in self._taken):
            return False
        if not in_doorway and footprint.intersects(self._before):
            return False
        free = self._free & ~self._near(footprint)
        parts = self._parts(free)
        if not self._still_joined(parts):
            return False
        if self._reached(free, parts) < LEAST_FREE * self._reachable:
            return False
        self._free = free
        self._taken.append(footprint)
        return True

    def _near(self, footprint: Polygon) -> NDArray[np.bool_]:
        zone = footprint.buffer(CLEAR, quad_segs=4)
        return shapely.contains_xy(zone, self._cells[..., 0], self._cells[..., 1])

    def _way(self, door: Array, zone: float) -> tuple[int, int] | None:
        """The free cell nearest to a door, which no furniture will take."""
        first = np.floor((door - zone - self.polygon.bounds[:2]) / CELL).astype(int)
        left, top = np.maximum(first, 0)
        right, bottom = np.maximum(first + round(2.0 * zone / CELL) + 2, 0)
        rows, columns = np.nonzero(self._free[top:bottom, left:right])
        if not len(rows):
            return None
        rows, columns = rows + top, columns + left
        off = np.linalg.norm(self._cells[rows, columns] - door, axis=1)
        best = int(np.argmin(off))
        return (int(rows[best]), int(columns[best])) if off[best] < zone else None

    def _parts(self, free: NDArray[np.bool_]) -> IntArray:
        """(D,) the connected part at each door, 0 where there is none."""
        parts, _ = label(free)
        return np.array([0 if way is None else parts[way] for way in self._ways], dtype=np.int64)

    def _still_joined(self, parts: IntArray) -> bool:
        """Whether doors that were joined in the empty room still are."""
        before = self._joined[:, None] == self._joined
        now = (parts[:, None] == parts) & (parts > 0)
        return not (before & (self._joined > 0) & ~now).any()

    def _reached(self, free: NDArray[np.bool_], parts: IntArray) -> int:
        """Cells that can be reached from the doors; all that are free where there is no door."""
        if not (parts > 0).any():
            return int(free.sum())
        whole, _ = label(free)
        return int(np.isin(whole, parts[parts > 0]).sum())
