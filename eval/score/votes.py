"""What the truth says of planes, pieces and proposals: the labels of their points, counted.

A return knows the face it was cast on and its place along that face, so a vote needs no alignment
and no distance: it is exact at every instant, however far the estimate has drifted. Only the centre
of a room needs the alignment; it waits in the vote for the end of the run.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray
from shapely.geometry import Polygon

from eval.seen import SeenFaces
from slam.core import (
    Array,
    IntArray,
    MapPlane,
    PlanePiece,
    Proposals,
    RoomProposal,
    RunError,
    WallProposal,
)
from worlds.truth import NO_FACE

Labels = NDArray[np.int32]
LOWEST_LABEL = -8
"""At or below every negative label of ``worlds.truth``."""


class LabelSource(Protocol):
    """Decodes point ids."""

    def faces_of(self, point_ids: IntArray) -> Labels:
        """(M,) labels."""
        ...

    def along_of(self, point_ids: IntArray) -> Array:
        """(M,) true places along each point's own face [m]."""
        ...


@dataclass(frozen=True, slots=True)
class PieceVote:
    """A piece's true face (or a negative label), and the stretch of it its points span [m]."""

    face: int
    low: float = np.nan
    high: float = np.nan


@dataclass(frozen=True, slots=True)
class RoomVote:
    """What the truth says of one proposed room.

    faces: the pieces' true faces, in the pieces' order; owner: the room that owns the strict
    majority of them; coverage: part of the owner's seen face length that the pieces cover; held:
    rooms of which they cover at least half; centre, inner: map frame [m]; inner is a point inside
    the proposal's own polygon (the centre where it is one, or where there is no polygon).
    """

    id: int
    faces: tuple[int, ...]
    owner: int | None
    coverage: float
    held: int
    centre: tuple[float, float]
    inner: tuple[float, float]


@dataclass(frozen=True, slots=True)
class WallVote:
    """The true faces of a proposed wall's two pieces."""

    id: int
    faces: tuple[int, int]


def majority(labels: Labels) -> tuple[int, float]:
    """The most frequent label and its share; a tie goes to the lowest (so not to a face).

    No labels at all: (NO_FACE, 0).
    """
    if len(labels) == 0:
        return NO_FACE, 0.0
    counts = np.bincount(labels - LOWEST_LABEL)
    best = int(counts.argmax())
    return best + LOWEST_LABEL, float(counts[best] / len(labels))


def strict_owner(rooms: Sequence[int | None]) -> int | None:
    """The room that more than half of the pieces belong to; None stands for a piece of no room."""
    for room in sorted({room for room in rooms if room is not None}):
        if 2 * sum(other == room for other in rooms) > len(rooms):
            return room
    return None


def coverage(room: int, pieces: Iterable[PieceVote], seen: SeenFaces) -> float:
    """Part of a room's seen face length that the pieces on its faces cover, in [0, 1]."""
    stretches: dict[int, list[tuple[float, float]]] = {}
    for piece in pieces:
        if piece.face >= 0 and seen.room_of[piece.face] == room:
            stretches.setdefault(piece.face, []).append((piece.low, piece.high))
    total = seen.room_length(room)
    covered = sum(seen.covered(face, parts) for face, parts in stretches.items())
    return covered / total if total > 0.0 else 0.0


def room_vote(proposal: RoomProposal, pieces: Sequence[PieceVote], seen: SeenFaces) -> RoomVote:
    """The vote on a room from those on its pieces, with what is seen by now."""
    rooms = [int(seen.room_of[p.face]) if p.face >= 0 else None for p in pieces]
    owner = strict_owner(rooms)
    present = sorted({room for room in rooms if room is not None})
    coverages = {room: coverage(room, pieces, seen) for room in present}
    return RoomVote(
        id=proposal.id,
        faces=tuple(piece.face for piece in pieces),
        owner=owner,
        coverage=0.0 if owner is None else coverages[owner],
        held=sum(part >= 0.5 - 1e-9 for part in coverages.values()),
        centre=(float(proposal.centre[0]), float(proposal.centre[1])),
        inner=inner_point(proposal),
    )


def inner_point(proposal: RoomProposal) -> tuple[float, float]:
    """The centre, or a point inside the proposal's own polygon where the centre is outside it."""
    x, y = float(proposal.centre[0]), float(proposal.centre[1])
    polygon = proposal.polygon
    if polygon is None or len(polygon) < 3 or inside(polygon, x, y):
        return x, y
    outline = Polygon(polygon)
    if not outline.is_valid or outline.area == 0.0:
        return x, y
    point = outline.representative_point()
    return point.x, point.y


def inside(polygon: Array, x: float, y: float) -> bool:
    """Does a polygon (K, 2) hold a point, by the even-odd rule?"""
    x0, y0 = polygon.T
    x1, y1 = np.roll(polygon, -1, axis=0).T
    crossed = (y0 > y) != (y1 > y)
    run = np.where(crossed, y1 - y0, 1.0)
    return bool(np.count_nonzero(crossed & (x < x0 + (y - y0) / run * (x1 - x0))) % 2)


@dataclass(frozen=True, slots=True)
class _Decoded:
    point_ids: IntArray
    faces: Labels
    along: Array


class Voter:
    """Votes on planes, pieces and proposals; keeps what it worked out for what has not changed."""

    def __init__(self, source: LabelSource, seen: SeenFaces) -> None:
        self._source = source
        self._seen = seen
        self._decoded: dict[int, _Decoded] = {}
        self._pieces: dict[tuple[int, int, int, bytes], PieceVote] = {}

    def decoded(self, plane: MapPlane) -> _Decoded:
        """Labels and places of a plane's points, decoded again only where the points are others."""
        known = self._decoded.get(plane.id)
        if known is None or not np.array_equal(known.point_ids, plane.point_ids):
            faces = self._source.faces_of(plane.point_ids)
            along = self._source.along_of(plane.point_ids)
            known = self._decoded[plane.id] = _Decoded(plane.point_ids, faces, along)
        return known

    def piece(self, plane: MapPlane | None, piece: PlanePiece) -> PieceVote:
        """Majority label of a piece's points; a plane that is not in the map has none."""
        if plane is None:
            return PieceVote(NO_FACE)
        labels = self.decoded(plane)
        own = piece.mask(plane.points)
        face, _ = majority(labels.faces[own])
        if face < 0:
            return PieceVote(face)
        along = labels.along[own & (labels.faces == face)]
        return PieceVote(face, float(along.min()), float(along.max()))

    def vote(
        self, planes: Sequence[MapPlane], proposals: Proposals
    ) -> tuple[tuple[RoomVote, ...], tuple[WallVote, ...]]:
        """Votes on all proposed rooms and walls, with what is seen by now."""
        check_ids("room", [room.id for room in proposals.rooms])
        check_ids("wall", [wall.id for wall in proposals.walls])
        by_id = {plane.id: plane for plane in planes}
        kept: dict[tuple[int, int, int, bytes], PieceVote] = {}

        def of(piece: PlanePiece) -> PieceVote:
            plane = by_id.get(piece.plane_id)
            state = (-1, 0) if plane is None else (plane.revision, len(plane.points))
            key = (piece.plane_id, *state, piece.segment.tobytes())
            kept[key] = self._pieces.get(key) or kept.get(key) or self.piece(plane, piece)
            return kept[key]

        rooms = tuple(room_vote(r, [of(p) for p in r.pieces], self._seen) for r in proposals.rooms)
        walls = tuple(_wall_vote(w, of(w.pieces[0]), of(w.pieces[1])) for w in proposals.walls)
        self._pieces = kept
        return rooms, walls


def check_ids(what: str, ids: Sequence[int]) -> None:
    """RunError where an id is used twice."""
    if len(set(ids)) < len(ids):
        repeated = min(id for id in ids if ids.count(id) > 1)
        raise RunError(f"detector: {what} id {repeated} was proposed twice in one update")


def _wall_vote(proposal: WallProposal, first: PieceVote, second: PieceVote) -> WallVote:
    return WallVote(proposal.id, (first.face, second.face))
