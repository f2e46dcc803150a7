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
from collections.abc import Collection, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from eval.score_rooms import MIN_COVERAGE, centre_in, match_centres, match_rooms
from eval.seen import SeenFaces
from eval.votes import RoomVote, Voter
from slam.core import Array, Links, MapPlane, Proposals, RoomProposal
from worlds.truth import Room, Truth

FACES = 3
"""A room with fewer distinct faces earns no full credit."""


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
    (``score_planes``), None for a detector that uses no planes; linked: rooms that the detector's
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


def score_failures(
    votes: Sequence[RoomVote],
    truth: Truth,
    T_world_map: Array,
    entered: Collection[int],
    evidence: Evidence,
    storeys: Collection[int] | None = None,
) -> Failures:
    """Count the causes, by the piece rule, or the centre rule where the detector uses no planes."""
    rooms = [room for room in truth.rooms if storeys is None or room.storey in storeys]
    by_pieces = evidence.mapped is not None
    matches = (
        match_rooms(votes, truth, T_world_map)
        if by_pieces
        else match_centres(votes, rooms, T_world_map)
    )
    missed = sorted(set(entered) - set(matches.values()))
    causes = Counter(f"missed_{evidence.cause(truth.rooms[room])}" for room in missed)
    for place, vote in enumerate(votes):
        if place not in matches:
            causes[f"false_{_cause_of_false(vote, truth, T_world_map, evidence, rooms)}"] += 1
    return Failures(**{name: causes[name] for name in Failures.__dataclass_fields__})


def _cause_of_false(
    vote: RoomVote, truth: Truth, T_world_map: Array, evidence: Evidence, rooms: Sequence[Room]
) -> str:
    owners = [truth.faces[face].room for face in vote.faces if face >= 0]
    if vote.faces and 2 * len(owners) <= len(vote.faces):
        return "planes"
    if owners:
        most, _ = min(Counter(owners).items(), key=lambda item: (-item[1], item[0]))
        return evidence.cause(truth.rooms[most])
    around = [room for room in rooms if centre_in(room, vote, T_world_map)]
    return evidence.cause(around[0]) if around else "clustering"
