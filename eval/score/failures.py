"""Why rooms are missed or false: the first stage of the way to a room that had it wrong already.

A room needs three faces (all, if it has fewer). *unseen*: the sensor has not seen so many.
*planes*: the map does not hold as many on planes that are not mixed, or holds less than half of
what was seen of the room's faces; of a false detection also: half of its pieces or more lie on no
room's face. *edges*: rooms made of whatever the detector's edges join, and of nothing else, would
not have this one. *clustering*: they would; so the fault is in what was made of the edges, the
outline and its centre included. Of a detector that tells of no edges (``slam.core.Linking``) both
are *clustering*; one that uses no planes has *unseen* and *clustering* alone.
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
from slam.core import Array, Links, MapPlane, Proposals, RoomProposal
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
class Evidence:
    """How far the stages before the rooms got. mapped: faces that the map holds
    (``score.planes``), None for a detector that uses no planes; linked: rooms that the detector's
    edges alone would give, None if it tells of none."""

    seen: SeenFaces
    mapped: frozenset[int] | None
    linked: frozenset[int] | None

    def cause(self, room: Room) -> str:
        """The first stage that had this room wrong."""
        needed = min(FACES, len(room.faces))
        if sum(bool(self.seen.seen[face]) for face in room.faces) < needed:
            return "unseen"
        if self.mapped is not None and not self._is_mapped(room, self.mapped, needed):
            return "planes"
        return "edges" if self.linked is not None and room.id not in self.linked else "clustering"

    def _is_mapped(self, room: Room, mapped: Collection[int], needed: int) -> bool:
        held = [face for face in room.faces if face in mapped]
        length = sum(self.seen.length(face) for face in held)
        return len(held) >= needed and length >= MIN_COVERAGE * self.seen.room_length(room.id)


def linked_rooms(links: Links, planes: Sequence[MapPlane], voter: Voter) -> frozenset[int]:
    """Rooms of which the pieces that the edges join, directly or over others, would be a true
    detection (wherever its centre)."""
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
    return frozenset(v.owner for v in votes if v.owner is not None and v.coverage >= MIN_COVERAGE)


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
    return about.id, evidence.cause(about)
