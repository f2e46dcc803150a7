"""Why rooms are missed or false: the first stage of the way to a room that had it wrong already.

A room needs three faces (all, if it has fewer). *unseen*: the sensor has not seen so many.
*planes*: the map does not hold as many on planes that are not mixed, or holds less than half of
what was seen of the room's faces. *edges*: rooms made of whatever the detector's edges join, and of
nothing else, would not have this one, or would have two rooms as one. *clustering*: they would have
it; so the fault is in what was made of the edges, the outline and its centre included.

A false detection is *planes* before all else if half of its pieces or more lie on no room's face:
on furniture, on pillars, on planes of mixed points. Otherwise it is about the room of most of its
pieces, or the one around its centre, and has that room's cause; but *edges* also if they leave the
room in parts, and most of what the detection has of the room is not in the part that would be it.

Of a detector that tells of no edges (``slam.core.Linking``) both of the last are *clustering*; one
that uses no planes has *unseen* and *clustering* alone.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from eval.score.rooms import MIN_COVERAGE, centre_in, match_centres, match_rooms
from eval.score.votes import RoomVote, Voter
from eval.seen import SeenFaces
from slam.core import Array, IntArray, Links, MapPlane, PlanePiece, Proposals, RoomProposal
from worlds.truth import Room, Truth

FACES = 3
"""A room with fewer distinct faces earns no full credit."""


@dataclass(frozen=True)
class Fault:
    """A room that was missed, or a detection that is not true. room: the true room that it is
    about, None where a false detection is about none; proposal: None of a missed room; cause: the
    stage that had it wrong."""

    room: int | None
    proposal: int | None
    cause: str


@dataclass(frozen=True)
class Fates:
    """What became of the rooms. found: room -> its true detection, by the rule that fits the
    detector; faults: what was missed, in the order of rooms, then what is false."""

    found: Mapping[int, int]
    faults: tuple[Fault, ...]

    def count(self) -> Failures:
        """How many faults of each kind and cause."""
        counts = Counter(
            f"{'missed' if fault.proposal is None else 'false'}_{fault.cause}"
            for fault in self.faults
        )
        return Failures(**{name: counts[name] for name in Failures.__dataclass_fields__})


@dataclass(frozen=True)
class Failures:
    """missed_*: entered rooms that no detection is true for, by cause; false_*: detections that are
    not true. None where rooms are not scored."""

    missed_unseen: int | None = None
    missed_planes: int | None = None
    missed_edges: int | None = None
    missed_clustering: int | None = None
    false_unseen: int | None = None
    false_planes: int | None = None
    false_edges: int | None = None
    false_clustering: int | None = None


@dataclass(frozen=True)
class Linked:
    """Rooms made of what the detector's edges join, directly or over others. rooms: room -> the
    part that would be a true detection of it, wherever its centre, and has no other room; parts:
    proposal id -> the part of each of its pieces, in their order, -1 for one that the edges do not
    know."""

    rooms: Mapping[int, int]
    parts: Mapping[int, Sequence[int]]

    def has(self, room: Room, vote: RoomVote | None) -> bool:
        """Do the edges give this room? Of a detection about it: is at least half of what it has of
        the room in that part?"""
        if room.id not in self.rooms or vote is None:
            return room.id in self.rooms
        parts = zip(vote.faces, self.parts[vote.id], strict=True)
        own = [part for face, part in parts if face in room.faces and part >= 0]
        return 2 * own.count(self.rooms[room.id]) >= len(own)


@dataclass(frozen=True)
class Evidence:
    """How far the stages before the rooms got. mapped: faces that the map holds
    (``score.planes``), None for a detector that uses no planes; linked: None for one that tells of
    no edges."""

    seen: SeenFaces
    mapped: frozenset[int] | None
    linked: Linked | None

    def cause(self, room: Room, vote: RoomVote | None = None) -> str:
        """The first stage that had this room wrong, or a detection that is about it."""
        needed = min(FACES, len(room.faces))
        if sum(bool(self.seen.seen[face]) for face in room.faces) < needed:
            return "unseen"
        if self.mapped is not None and not self._is_mapped(room, self.mapped, needed):
            return "planes"
        linked = self.linked is None or self.linked.has(room, vote)
        return "clustering" if linked else "edges"

    def _is_mapped(self, room: Room, mapped: Collection[int], needed: int) -> bool:
        held = [face for face in room.faces if face in mapped]
        length = sum(self.seen.length(face) for face in held)
        return len(held) >= needed and length >= MIN_COVERAGE * self.seen.room_length(room.id)


def linked_rooms(
    links: Links, planes: Sequence[MapPlane], voter: Voter, proposals: Proposals
) -> Linked:
    """What the edges join; proposals: of the same update."""
    count = len(links.pieces)
    ones = np.ones(len(links.pairs))
    graph = coo_array((ones, (links.pairs[:, 0], links.pairs[:, 1])), shape=(count, count))
    labels = connected_components(graph, directed=False)[1]
    parts = [np.flatnonzero(labels == part) for part in np.unique(labels)]
    rooms = tuple(
        RoomProposal(id, tuple(links.pieces[place] for place in part), None, np.zeros(2), 1.0)
        for id, part in enumerate(parts)
        if len(part) > 1
    )
    votes, _ = voter.vote(planes, Proposals(rooms))
    by_coverage = sorted(votes, key=lambda vote: (vote.coverage, -vote.id))
    alone = [vote for vote in by_coverage if vote.coverage >= MIN_COVERAGE and vote.held <= 1]
    true = {vote.owner: vote.id for vote in alone if vote.owner is not None}
    return Linked(true, _parts_of(proposals, links, labels))


def _parts_of(proposals: Proposals, links: Links, labels: IntArray) -> dict[int, list[int]]:
    """Of each proposal's pieces: the part of the nearest piece on the same plane, since a room that
    was kept may have a piece as it was some updates ago."""
    places: dict[int, list[int]] = {}
    for place, piece in enumerate(links.pieces):
        places.setdefault(piece.plane_id, []).append(place)
    middles = np.array([piece.segment.mean(axis=0) for piece in links.pieces]).reshape(-1, 2)

    def part_of(piece: PlanePiece) -> int:
        near = places.get(piece.plane_id)
        if near is None:
            return -1
        away = np.linalg.norm(middles[near] - piece.segment.mean(axis=0), axis=1)
        return int(labels[near[int(away.argmin())]])

    return {room.id: [part_of(piece) for piece in room.pieces] for room in proposals.rooms}


def room_fates(
    votes: Sequence[RoomVote],
    truth: Truth,
    T_world_map: Array,
    entered: Collection[int],
    evidence: Evidence,
    storeys: Collection[int] | None = None,
) -> Fates:
    """By the piece rule, or the centre rule where the detector uses no planes."""
    rooms = [room for room in truth.rooms if storeys is None or room.storey in storeys]
    by_pieces = evidence.mapped is not None
    matches = (
        match_rooms(votes, truth, T_world_map)
        if by_pieces
        else match_centres(votes, rooms, T_world_map)
    )
    missed = sorted(set(entered) - set(matches.values()))
    faults = [Fault(room, None, evidence.cause(truth.rooms[room])) for room in missed]
    for place, vote in enumerate(votes):
        if place not in matches:
            room, cause = _cause_of_false(vote, truth, T_world_map, evidence, rooms)
            faults.append(Fault(room, vote.id, cause))
    return Fates({room: votes[place].id for place, room in matches.items()}, tuple(faults))


def _cause_of_false(
    vote: RoomVote, truth: Truth, T_world_map: Array, evidence: Evidence, rooms: Sequence[Room]
) -> tuple[int | None, str]:
    """The room that a false detection is about, if any, and the cause."""
    owners = [truth.faces[face].room for face in vote.faces if face >= 0]
    if owners:
        about = truth.rooms[min(Counter(owners).items(), key=lambda item: (-item[1], item[0]))[0]]
    else:
        around = [room for room in rooms if centre_in(room, vote, T_world_map)]
        if not around:
            return None, "planes" if vote.faces else "clustering"
        about = around[0]
    if vote.faces and 2 * len(owners) <= len(vote.faces):
        return about.id, "planes"
    return about.id, evidence.cause(about, vote)
