"""Time: when rooms are found, and how steadily they stay found.

Every instant is judged with what had been seen by then, and one T_world_map, that of the final
alignment. Times count from the start of the first sweep and include the inference.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from eval.labels import Instant
from eval.score.rooms import MIN_COVERAGE, centre_in, distinct_faces, match_rooms
from eval.score.votes import RoomVote
from slam.core import Array
from worlds.truth import Truth


@dataclass(frozen=True)
class TimeScore:
    """first_room_s: the first true detection with four true faces (all, if its room has fewer).

    latency_median_s, latency_p95_s: from entering a room to its first true detection, over the
    entered rooms that were ever found (recall tells of the others); 0 for one found before.
    retracted_true: times a room with a true detection had, one update later, no detection that
    still owns it (one that is only covered less, because more has been seen since, is kept).
    id_switches: times a room's true detection had another id than its last one. All are None for a
    detector that proposes rooms without pieces: the rule does not apply to it.
    """

    first_room_s: float | None
    latency_median_s: float | None
    latency_p95_s: float | None
    retracted_true: int | None
    id_switches: int | None


def score_time(
    instants: Sequence[Instant],
    truth: Truth,
    T_world_map: Array,
    entered: Mapping[int, float],
    start: float,
) -> TimeScore:
    """Score all updates; entered: room id -> stamp; start: when the first sweep began [s]."""
    votes = [vote for instant in instants for vote in instant.rooms]
    if votes and not any(vote.faces for vote in votes):
        return UNKNOWN_TIME
    found = [_found(instant, truth, T_world_map) for instant in instants]
    firsts = _first_times(instants, found)
    waits = [max(0.0, firsts[room] - since) for room, since in entered.items() if room in firsts]
    ready = [
        instant.stamp + instant.latency_s - start
        for instant, matches in zip(instants, found, strict=True)
        if any(_complete(vote, truth) for vote in matches.values())
    ]
    return TimeScore(
        first_room_s=min(ready, default=None),
        latency_median_s=float(np.median(waits)) if waits else None,
        latency_p95_s=float(np.percentile(waits, 95)) if waits else None,
        retracted_true=_retracted(instants, found),
        id_switches=_switches(instants, found, truth, T_world_map),
    )


UNKNOWN_TIME = TimeScore(None, None, None, None, None)

Found = dict[int, RoomVote]  # room id -> the detection that is true for it


def _found(instant: Instant, truth: Truth, T_world_map: Array) -> Found:
    matches = match_rooms(instant.rooms, truth, T_world_map)
    return {room: instant.rooms[place] for place, room in matches.items()}


def _complete(vote: RoomVote, truth: Truth) -> bool:
    assert vote.owner is not None
    return distinct_faces(vote, truth) >= min(4, len(truth.rooms[vote.owner].faces))


def _first_times(instants: Sequence[Instant], found: Sequence[Found]) -> dict[int, float]:
    firsts: dict[int, float] = {}
    for instant, matches in zip(instants, found, strict=True):
        for room in matches:
            firsts.setdefault(room, instant.stamp + instant.latency_s)
    return firsts


def _retracted(instants: Sequence[Instant], found: Sequence[Found]) -> int:
    return sum(
        len(before.keys() - {vote.owner for vote in after.rooms})
        for before, after in zip(found, instants[1:], strict=False)
    )


def _switches(
    instants: Sequence[Instant], found: Sequence[Found], truth: Truth, T_world_map: Array
) -> int:
    last: dict[int, int] = {}
    switches = 0
    for instant, matches in zip(instants, found, strict=True):
        for room, vote in matches.items():
            known = last.get(room, vote.id)
            if known != vote.id and not _still_true(known, room, instant, truth, T_world_map):
                switches += 1
                known = vote.id
            last[room] = known
    return switches


def _still_true(id: int, room: int, instant: Instant, truth: Truth, T_world_map: Array) -> bool:
    """Would the detection ``id`` be true for the room, were it not for a better-covered one?"""
    return any(
        vote.id == id
        and vote.owner == room
        and vote.coverage >= MIN_COVERAGE
        and centre_in(truth.rooms[room], vote, T_world_map)
        for vote in instant.rooms
    )
