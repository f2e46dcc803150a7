"""Rooms: which detections are true, one-to-one, and what follows from it.

A detection is true if one room owns the strict majority of its pieces' faces (each piece votes
once; a piece of a pillar or of a jamb is a wrong piece), the pieces cover at least half of that
room's seen face length, and the centre lies in the room's polygon. The better-covered detection of
a room wins, the others are false. A true detection with fewer than three distinct faces of its room
earns half, in both numerators and in the precision denominator: so alone it gives 0.5/0.5. A false
detection always weighs one, whatever it is made of, so that rubbish is not cheaper for being small.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
from shapely.geometry import Point, Polygon

from eval.score.votes import RoomVote
from slam.core import Array, transform_points
from worlds.truth import Room, Truth

MIN_COVERAGE = 0.5 - 1e-9
CONVEX = 0.99
"""A room that fills this much of its convex hull is convex."""


@dataclass(frozen=True)
class RoomScore:
    """The figures of metrics.json's ``rooms``, and what they were counted from.

    detected and true_positive are sums of credit, so precision = true_positive / detected; recall =
    the credit of entered rooms / entered. mean_iou: over true detections that have a polygon.
    piece_f1: harmonic mean of (pieces on a face of the room that their detection is matched to /
    all pieces) and (seen and mapped faces of entered rooms that have such a piece / those faces).
    over_segmented: detections beyond the first that own one room by strict majority;
    under_segmented: rooms beyond the first of which one detection covers at least half.
    matches: proposal id -> room of true detections. The piece rule's figures are None for a
    detector that proposes rooms without pieces; IoU then follows the centre rule. All are None in
    a world without room truth.
    """

    truth: int | None = None
    entered: int | None = None
    detected: float | None = None
    true_positive: float | None = None
    precision: float | None = None
    recall: float | None = None
    centre_precision: float | None = None
    centre_recall: float | None = None
    mean_iou: float | None = None
    piece_f1: float | None = None
    over_segmented: int | None = None
    under_segmented: int | None = None
    matches: Mapping[int, int] = field(default_factory=dict)


def centre_in(room: Room, vote: RoomVote, T_world_map: Array) -> bool:
    """Does the detection's centre lie in the room's polygon (its border included)?

    In a room that is not convex a geometric centre may lie outside: there the centre is a point
    inside the detection's own polygon.
    """
    polygon = room.polygon
    convex = polygon.area >= CONVEX * polygon.convex_hull.area
    centre = vote.centre if convex else vote.inner
    return bool(polygon.covers(Point(to_world(T_world_map, np.array([centre]))[0])))


def to_world(T_world_map: Array, points: Array) -> Array:
    """(N, 2) points in plan view of the map, at height 0, in plan view of the world."""
    return transform_points(T_world_map, np.column_stack([points, np.zeros(len(points))]))[:, :2]


def match_rooms(votes: Sequence[RoomVote], truth: Truth, T_world_map: Array) -> dict[int, int]:
    """True detections: place in ``votes`` -> room id, one-to-one."""
    candidates = [
        (-vote.coverage, -distinct_faces(vote, truth), vote.id, place)
        for place, vote in enumerate(votes)
        if vote.owner is not None
        and vote.coverage >= MIN_COVERAGE
        and centre_in(truth.rooms[vote.owner], vote, T_world_map)
    ]
    return _first_per_room(candidates, {c[-1]: votes[c[-1]].owner for c in candidates})


def match_centres(
    votes: Sequence[RoomVote], rooms: Sequence[Room], T_world_map: Array
) -> dict[int, int]:
    """The centre rule: place in ``votes`` -> room whose polygon holds the centre, one-to-one; of
    rooms above each other the one that owns the pieces, if there are any."""
    holders: dict[int, int | None] = {}
    for place, vote in enumerate(votes):
        by_likelihood = sorted(rooms, key=lambda room: room.id != vote.owner)
        holding = (room.id for room in by_likelihood if centre_in(room, vote, T_world_map))
        holders[place] = next(holding, None)
    candidates = [
        (-vote.coverage, vote.id, place)
        for place, vote in enumerate(votes)
        if holders[place] is not None
    ]
    return _first_per_room(candidates, holders)


def _first_per_room(
    candidates: Sequence[tuple[float, ...]], room_of: Mapping[int, int | None]
) -> dict[int, int]:
    matches: dict[int, int] = {}
    for *_, place in sorted(candidates):
        room = room_of[int(place)]
        if room is not None and room not in matches.values():
            matches[int(place)] = room
    return matches


def distinct_faces(vote: RoomVote, truth: Truth) -> int:
    """Distinct faces of the owner among a detection's pieces."""
    return len({f for f in vote.faces if f >= 0 and truth.faces[f].room == vote.owner})


def credit(vote: RoomVote, truth: Truth) -> float:
    """1 for a true detection, 0.5 for one with fewer than three distinct true faces."""
    return 1.0 if distinct_faces(vote, truth) >= 3 else 0.5


def iou(polygon: Polygon, other: Polygon) -> float:
    """Intersection over union of two polygons; one that crosses itself is mended first."""
    mended = polygon if polygon.is_valid else polygon.buffer(0)
    union = mended.union(other).area
    return float(mended.intersection(other).area / union) if union > 0.0 else 0.0


def score_rooms(
    votes: Sequence[RoomVote],
    polygons: Mapping[int, Array],
    truth: Truth,
    T_world_map: Array,
    entered: Collection[int],
    mapped_faces: Collection[int],
    storeys: Collection[int] | None = None,
) -> RoomScore:
    """Score the final detections.

    votes: in any order; polygons: proposal id -> (K, 2) map frame, where there is one; entered:
    room ids; mapped_faces: seen faces that the map holds (``score.planes``); storeys: where the
    centre rule looks for rooms (they overlap in plan view), all if None.
    """
    matches = match_rooms(votes, truth, T_world_map)
    rooms = [room for room in truth.rooms if storeys is None or room.storey in storeys]
    centres = match_centres(votes, rooms, T_world_map)
    by_pieces = not votes or any(vote.faces for vote in votes)
    earned = {place: credit(votes[place], truth) for place in matches}
    gained = sum(earned.values())
    detected = gained + (len(votes) - len(matches))
    recalled = sum(c for place, c in earned.items() if matches[place] in entered)
    recalled_centres = sum(room in entered for room in centres.values())
    return RoomScore(
        truth=len(truth.rooms),
        entered=len(entered),
        detected=detected if by_pieces else None,
        true_positive=gained if by_pieces else None,
        precision=ratio(gained, detected) if by_pieces else None,
        recall=ratio(recalled, len(entered)) if by_pieces else None,
        centre_precision=ratio(len(centres), len(votes)),
        centre_recall=ratio(recalled_centres, len(entered)),
        mean_iou=_mean_iou(votes, matches if by_pieces else centres, polygons, truth, T_world_map),
        piece_f1=piece_f1(votes, matches, truth, entered, mapped_faces) if by_pieces else None,
        over_segmented=_over_segmented(votes) if by_pieces else None,
        under_segmented=_under_segmented(votes) if by_pieces else None,
        matches={votes[place].id: room for place, room in sorted(matches.items())},
    )


def ratio(part: float, whole: float) -> float | None:
    """part / whole, None where there is no whole."""
    return part / whole if whole > 0 else None


def piece_f1(
    votes: Sequence[RoomVote],
    matches: Mapping[int, int],
    truth: Truth,
    entered: Collection[int],
    mapped_faces: Collection[int],
) -> float | None:
    """F1 of pieces assigned to the right room, see ``RoomScore``; None without pieces and faces."""
    right = [
        face
        for place, room in matches.items()
        for face in votes[place].faces
        if face >= 0 and truth.faces[face].room == room
    ]
    pieces = sum(len(vote.faces) for vote in votes)
    wanted = {face for face in mapped_faces if truth.faces[face].room in entered}
    if pieces == 0 and not wanted:
        return None
    precision = ratio(len(right), pieces) or 0.0
    recall = ratio(len(wanted & set(right)), len(wanted)) or 0.0
    return 2 * precision * recall / (precision + recall) if right and recall > 0.0 else 0.0


def _mean_iou(
    votes: Sequence[RoomVote],
    matches: Mapping[int, int],
    polygons: Mapping[int, Array],
    truth: Truth,
    T_world_map: Array,
) -> float | None:
    values = [
        iou(Polygon(to_world(T_world_map, polygons[votes[p].id])), truth.rooms[room].polygon)
        for p, room in matches.items()
        if votes[p].id in polygons
    ]
    return float(np.mean(sorted(values))) if values else None


def _over_segmented(votes: Sequence[RoomVote]) -> int:
    owners = [vote.owner for vote in votes if vote.owner is not None]
    return len(owners) - len(set(owners))


def _under_segmented(votes: Sequence[RoomVote]) -> int:
    return sum(max(0, vote.held - 1) for vote in votes)
