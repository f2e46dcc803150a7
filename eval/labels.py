"""Everything the truth says while a run goes on, kept small enough for long runs."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from eval.score.trajectory import Trajectory
from eval.score.votes import Labels, RoomVote, Voter, WallVote
from eval.seen import SCORING, RoomVisits, SeenFaces, SeenRule, SeenStep
from sim.truth import ScanTruth
from slam.core import Array, InputError, IntArray, MapView, Proposals, Scan, point_ids
from worlds.truth import Truth


@dataclass(frozen=True)
class Instant:
    """One detector update: when it was asked, how long it took, and the votes on its rooms."""

    stamp: float
    latency_s: float
    rooms: tuple[RoomVote, ...]


@dataclass(frozen=True)
class KeptReturns:
    """The truth of those returns of a keyframe that will ever be asked for.

    rows: (N,) their places in the scan, ascending; faces: (N,) labels; along: (N,) [m] along their
    faces, NaN off them; points: (N, 3) as measured, at true poses, world frame.
    """

    rows: IntArray
    faces: Labels
    along: NDArray[np.float32]
    points: NDArray[np.float32]


@dataclass(frozen=True)
class TruthStep:
    """All that the scoring keeps of one scan's truth. stamp, start: the sweep's end and start [s];
    T_world_base: NaN where a recording does not tell; kept: None unless the scan is a keyframe."""

    index: int
    stamp: float
    start: float
    T_world_base: Array
    seen: SeenStep
    kept: KeptReturns | None


class _Column:
    """A growing array: appending is cheap, reading is a view."""

    def __init__(self, dtype: type, width: int | None = None) -> None:
        self._data: NDArray = np.empty((1024,) if width is None else (1024, width), dtype=dtype)
        self._size = 0

    def append(self, rows: NDArray) -> None:
        need = self._size + len(rows)
        if need > len(self._data):
            grown = np.empty(
                (max(need, 2 * len(self._data)), *self._data.shape[1:]), self._data.dtype
            )
            grown[: self._size] = self._data[: self._size]
            self._data = grown
        self._data[self._size : need] = rows
        self._size = need

    @property
    def rows(self) -> NDArray:
        return self._data[: self._size]


class LabelStore:
    """Labels of kept returns by point id; ids must come in ascending order."""

    def __init__(self) -> None:
        self._ids = _Column(np.int64)
        self._faces = _Column(np.int32)
        self._along = _Column(np.float32)
        self._points = _Column(np.float32, 3)

    def add(self, ids: IntArray, faces: Labels, along: NDArray, points: NDArray) -> None:
        """Keep returns: ids (N,), labels (N,), places along their faces (N,), points (N, 3)."""
        if len(ids) and len(self._ids.rows) and ids[0] <= self._ids.rows[-1]:
            raise InputError(f"labels: scan of point id {ids[0]} was added twice or out of order")
        self._ids.append(ids)
        self._faces.append(faces)
        self._along.append(along)
        self._points.append(points)

    def faces_of(self, ids: IntArray) -> Labels:
        """(M,) int32 face labels."""
        return self._faces.rows[self._slots(ids)]

    def along_of(self, ids: IntArray) -> Array:
        """(M,) metres along each return's own face, at its true place; NaN off the faces."""
        return self._along.rows[self._slots(ids)].astype(np.float64)

    def points_of(self, ids: IntArray) -> Array:
        """(M, 3) returns at true poses, world frame."""
        return self._points.rows[self._slots(ids)].astype(np.float64)

    def _slots(self, ids: IntArray) -> IntArray:
        known = self._ids.rows
        slots = np.searchsorted(known, ids)
        missing = slots >= len(known)
        missing[~missing] = known[slots[~missing]] != ids[~missing]
        if missing.any():
            first = np.asarray(ids)[missing][0]
            raise InputError(f"labels: point id {first} is not of a keyframe return that was kept")
        return slots.astype(np.int64)


class TruthKeeper:
    """Collects the truth of every scan, and what it says of every detector update.

    Call ``digest`` and ``add`` for every scan in order, ``snapshot`` at each detector update.
    Memory: a pose per scan, 5 cm bins of the faces, and 24 bytes per kept return.
    """

    def __init__(self, truth: Truth, rule: SeenRule = SCORING) -> None:
        self.truth = truth
        self.seen = SeenFaces(truth, rule)
        self.visits = RoomVisits(truth)
        self.instants: list[Instant] = []
        self.start = 0.0
        self.keyframe_scans: list[int] = []
        self._store = LabelStore()
        self._stamps: list[float] = []
        self._poses: list[Array] = []
        self._last_votes: dict[int, RoomVote] = {}
        self.voter = Voter(self, self.seen)

    def digest(
        self,
        scan: Scan,
        truth: ScanTruth,
        keyframe: bool,
        point_index: IntArray | None = None,
    ) -> TruthStep:
        """What ``add`` needs of the next scan; changes nothing.

        Of a keyframe the labels are kept, so that ids can be decoded. point_index: the only returns
        of it that will ever be asked for (those of its plane observations); without it all are.
        """
        kept = None
        if keyframe:
            rows = np.arange(len(scan)) if point_index is None else np.unique(point_index)
            faces, points = truth.face[rows], truth.points_world[rows]
            along = self.seen.along(faces, points).astype(np.float32)
            kept = KeptReturns(rows, faces, along, points)
        ranges = np.sqrt(np.einsum("ni,ni->n", scan.points, scan.points))
        return TruthStep(
            index=scan.index,
            stamp=scan.stamp,
            start=scan.stamp + float(np.min(scan.times, initial=0.0)),
            T_world_base=np.array(truth.T_world_base),
            seen=self.seen.digest(truth.face, truth.points_world, ranges),
            kept=kept,
        )

    def add(self, step: TruthStep) -> None:
        """Take in a scan's truth, digested after all earlier scans were taken in."""
        if not self._stamps:
            self.start = step.start
        if step.kept is not None:
            self.keyframe_scans.append(len(self._stamps))
            ids = point_ids(step.index, step.kept.rows)
            self._store.add(ids, step.kept.faces, step.kept.along, step.kept.points)
        self._stamps.append(step.stamp)
        self._poses.append(step.T_world_base)
        if np.isfinite(step.T_world_base).all():
            self.visits.add(step.stamp, step.T_world_base[:3, 3])
        self.seen.apply(step.seen, step.stamp)

    def snapshot(self, stamp: float, latency_s: float, view: MapView, proposals: Proposals) -> None:
        """Store what the truth, as seen up to now, says of a detector's rooms."""
        rooms, _ = self.voter.vote(view.planes, proposals)
        # Most rooms stay as they were: sharing their votes keeps a long run small.
        rooms = tuple(old if (old := self._last_votes.get(v.id)) == v else v for v in rooms)
        self._last_votes = {vote.id: vote for vote in rooms}
        self.instants.append(Instant(stamp, latency_s, rooms))

    def votes(
        self, view: MapView, proposals: Proposals
    ) -> tuple[tuple[RoomVote, ...], tuple[WallVote, ...]]:
        """Votes on rooms and walls as of now (at the end: the final ones)."""
        return self.voter.vote(view.planes, proposals)

    def faces_of(self, point_ids: IntArray) -> Labels:
        """(M,) int32 true faces or negative labels of keyframe returns."""
        return self._store.faces_of(point_ids)

    def along_of(self, point_ids: IntArray) -> Array:
        """(M,) true places of keyframe returns along their own faces [m]."""
        return self._store.along_of(point_ids)

    def true_points(self, point_ids: IntArray) -> Array:
        """(M, 3) keyframe returns as measured, at the true poses of their instants, world frame."""
        return self._store.points_of(point_ids)

    def poses_at(self, stamps: Array) -> Array:
        """(K, 4, 4) true T_world_base of scans by when they ended; NaN where it is not known."""
        known = np.array([*self._stamps, np.inf])
        places = np.searchsorted(known, stamps)
        poses = np.array([*self._poses, np.full((4, 4), np.nan)])[places]
        poses[known[places] != stamps] = np.nan
        return np.asarray(poses)

    @property
    def trajectory(self) -> Trajectory:
        """The true trajectory, world frame, one pose per scan; NaN where it is not known."""
        return Trajectory(np.array(self._stamps), np.array(self._poses).reshape(-1, 4, 4))
