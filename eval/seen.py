"""What of the true faces the sensor has seen so far, and which rooms the base has been in.

A face is seen with 100 returns within 15 m that touch 0.5 m of its length (README, "What is
scored"). Length is counted in bins of 5 cm along the face: door gaps give no returns, so they never
count.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
import shapely
from numpy.typing import NDArray

from slam.core import Array, IntArray
from worlds.truth import Truth


@dataclass(frozen=True)
class SeenRule:
    """When a face is seen (the scoring's text); bin_m: resolution along a face."""

    bin_m: float = 0.05
    max_range_m: float = 15.0
    min_returns: int = 100
    min_length_m: float = 0.5

    @property
    def min_bins(self) -> int:
        """Bins that must have returns."""
        return round(self.min_length_m / self.bin_m)


SCORING = SeenRule()


@dataclass(frozen=True)
class SeenStep:
    """What one scan adds: faces (U,) with returns, how many on each (U,), and the bins (B,) that
    have returns for the first time."""

    faces: IntArray
    returns: IntArray
    bins: IntArray


class SeenFaces:
    """Bins with returns, per face, and since when. Grows monotonically with ``apply``.

    first: (bins,) stamp of each bin's first return, inf without; since: (F,) stamp at which each
    face became seen, inf while it is not; touched: (F,) bins with returns.
    """

    def __init__(self, truth: Truth, rule: SeenRule = SCORING) -> None:
        segments = np.array([face.segment for face in truth.faces]).reshape(-1, 2, 2)
        runs = segments[:, 1] - segments[:, 0]
        lengths = np.maximum(np.linalg.norm(runs, axis=1), 1e-9)
        direction = runs / lengths[:, None]
        self.rule = rule
        self.room_of = np.array([face.room for face in truth.faces], dtype=np.int64)
        # Metres along face f of a point: x * _x[f] + y * _y[f] + _from[f].
        self._x, self._y = np.ascontiguousarray(direction.T)
        self._from = -np.einsum("fi,fi->f", segments[:, 0], direction)
        self.bins = np.maximum(np.ceil(lengths / rule.bin_m - 1e-6), 1).astype(np.int64)
        self.offset = np.concatenate([[0], np.cumsum(self.bins)])
        self.first = np.full(self.offset[-1], np.inf)
        self.since = np.full(len(self.bins), np.inf)
        self.returns = np.zeros(len(self.bins), dtype=np.int64)
        self.touched = np.zeros(len(self.bins), dtype=np.int64)
        self._faces_of_room = {room.id: np.array(room.faces, np.int64) for room in truth.rooms}

    def along(self, face: NDArray[np.int32], points: NDArray[np.floating]) -> Array:
        """(N,) metres from the face's first end, of points (N, 3) world; NaN without a face."""
        along = np.full(len(face), np.nan)
        on = np.flatnonzero(face >= 0)
        along[on] = self._along(face[on], points[on, 0], points[on, 1])
        return along

    def _along(
        self, f: NDArray[np.int32], x: NDArray[np.floating], y: NDArray[np.floating]
    ) -> Array:
        return x * self._x.take(f) + y * self._y.take(f) + self._from.take(f)

    def digest(
        self,
        face: NDArray[np.int32],
        points: NDArray[np.floating],
        ranges: NDArray[np.floating],
    ) -> SeenStep:
        """What one scan's returns add to what has been seen up to now; changes nothing. face: (N,)
        labels; points: (N, 3) world frame [m]; ranges: (N,) [m]."""
        near = np.flatnonzero((face >= 0) & (ranges <= self.rule.max_range_m))
        f = face[near]
        along = self._along(f, points[near, 0], points[near, 1])
        count = np.bincount(f, minlength=len(self.bins))
        last = self.bins.take(f) - 1
        places = np.floor(along / self.rule.bin_m + 1e-6).astype(np.int64)
        bins = self.offset.take(f) + np.minimum(np.maximum(places, 0), last)
        fresh = np.unique(bins[np.isinf(self.first.take(bins))])
        faces = np.flatnonzero(count)
        return SeenStep(faces, count[faces], fresh)

    def apply(self, step: SeenStep, stamp: float) -> None:
        """Take in what a scan adds, in the order in which it was worked out."""
        self.returns[step.faces] += step.returns
        self.first[step.bins] = stamp
        of_face = np.searchsorted(self.offset, step.bins, side="right") - 1
        np.add.at(self.touched, of_face, 1)
        f = step.faces
        ready = (self.returns[f] >= self.rule.min_returns) & (self.touched[f] >= self.rule.min_bins)
        fresh = f[ready & np.isinf(self.since[f])]
        self.since[fresh] = stamp

    @property
    def seen(self) -> NDArray[np.bool_]:
        """(F,) which faces are seen by now."""
        return np.isfinite(self.since)

    def length(self, face: int) -> float:
        """Seen length of a face [m]: 0 until it is seen, then its bins with returns."""
        return float(self.touched[face] * self.rule.bin_m) if self.seen[face] else 0.0

    def room_length(self, room: int) -> float:
        """Seen face length of a room [m]."""
        faces = self._faces_of_room[room]
        return float(self.touched[faces][np.isfinite(self.since[faces])].sum() * self.rule.bin_m)

    def covered(self, face: int, stretches: Iterable[tuple[float, float]]) -> float:
        """Seen length [m] of a face that lies on the union of stretches (low, high) along it."""
        if not np.isfinite(self.since[face]):
            return 0.0
        returned = np.isfinite(self.first[self.offset[face] : self.offset[face + 1]])
        on = np.zeros(len(returned), dtype=bool)
        for low, high in stretches:
            first, last = (int(end / self.rule.bin_m + 1e-6) for end in (max(low, 0.0), high))
            on[min(first, len(on) - 1) : max(last, 0) + 1] = True
        return float(np.count_nonzero(returned & on) * self.rule.bin_m)


class RoomVisits:
    """Which rooms the base has entered: it was inside, without a break, for 1 s.

    entered: room id -> stamp at which that first stretch of a second began; storeys: where the
    base has been (rooms on different storeys overlap in plan view).
    """

    MIN_STAY = 1.0

    def __init__(self, truth: Truth) -> None:
        self.entered: dict[int, float] = {}
        self.storeys: set[int] = set()
        self._truth = truth
        self._tree = shapely.STRtree([room.polygon for room in truth.rooms])
        self._current: int | None = None
        self._since = 0.0

    def add(self, stamp: float, position: Array) -> None:
        """Take in the base's true position (3,), world frame."""
        room = self._room_at(position)
        if room != self._current:
            self._current, self._since = room, stamp
        if room is not None and stamp - self._since >= self.MIN_STAY - 1e-6:
            self.entered.setdefault(room, self._since)

    def _room_at(self, position: Array) -> int | None:
        storey = self._storey_at(float(position[2]))
        self.storeys.add(storey)
        hits = self._tree.query(shapely.Point(position[:2]), predicate="intersects")
        rooms = (self._truth.rooms[i] for i in sorted(hits))
        return next((room.id for room in rooms if room.storey == storey), None)

    def _storey_at(self, z: float) -> int:
        """The highest storey whose floor is not more than half a metre above z."""
        floors = sorted(self._truth.floors, key=lambda floor: floor.z_floor)
        below = [floor.storey for floor in floors if floor.z_floor <= z + 0.5]
        return below[-1] if below else floors[0].storey
