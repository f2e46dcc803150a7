"""Rooms and walls over time: each keeps its id from one inference to the next, none flickers."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from slam.core import PlanePiece, RoomProposal, WallProposal


@dataclass(frozen=True)
class TrackerConfig:
    """overlap: least share of common length for two rooms to be one; patience: inferences without
    evidence after which a room or wall is given up; taken: share of a missing room's pieces that
    others may have taken before it is given up at once."""

    overlap: float = 0.3
    patience: int = 3
    taken: float = 0.5


class RoomTracker:
    """Matches found rooms to known ones by the length of wall that they share."""

    def __init__(self, config: TrackerConfig = TrackerConfig()):
        self._config = config
        self._known: dict[int, RoomProposal] = {}
        self._missed: dict[int, int] = {}
        self._next = 0

    def update(self, found: Sequence[RoomProposal]) -> tuple[RoomProposal, ...]:
        """The rooms to hold true now: those found, and those missed only lately."""
        named = self._named(found)
        kept = {}
        for name, room in self._known.items():
            if name in named:
                continue
            missed = self._missed.get(name, 0) + 1
            if missed <= self._config.patience and self._is_free(room, list(named.values())):
                kept[name] = room
                self._missed[name] = missed
        self._missed = {name: self._missed[name] for name in kept}
        self._known = dict(sorted({**named, **kept}.items()))
        return tuple(self._known.values())

    def _named(self, found: Sequence[RoomProposal]) -> dict[int, RoomProposal]:
        """Found rooms by id; the best matches choose first."""
        scores = [
            (_likeness(room, known), i, name)
            for i, room in enumerate(found)
            for name, known in self._known.items()
        ]
        ids: dict[int, int] = {}
        for score, i, name in sorted(scores, key=lambda item: (-item[0], item[1], item[2])):
            if score >= self._config.overlap and i not in ids and name not in ids.values():
                ids[i] = name
        named = {}
        for i, room in enumerate(found):
            if i not in ids:
                ids[i] = self._next
                self._next += 1
            named[ids[i]] = replace(room, id=ids[i])
        return named

    def _is_free(self, room: RoomProposal, others: Sequence[RoomProposal]) -> bool:
        taken = sum(common(room.pieces, other.pieces) for other in others)
        return taken < self._config.taken * length(room.pieces)


class WallTracker:
    """A wall is known by its two planes; where a pair of planes has several, by the nearest."""

    def __init__(self, config: TrackerConfig = TrackerConfig()):
        self._config = config
        self._known: dict[int, WallProposal] = {}
        self._missed: dict[int, int] = {}
        self._next = 0

    def update(self, found: Sequence[WallProposal]) -> tuple[WallProposal, ...]:
        """The walls to hold true now."""
        free = dict(self._known)
        named: dict[int, WallProposal] = {}
        for wall in found:
            name = next((n for n, known in free.items() if _same_wall(wall, known)), None)
            if name is None:
                name = self._next
                self._next += 1
            free.pop(name, None)
            named[name] = replace(wall, id=name)
        kept = {}
        for name, wall in free.items():
            missed = self._missed.get(name, 0) + 1
            replaced = any(_same_wall(wall, other) for other in named.values())
            if missed <= self._config.patience and not replaced:
                kept[name] = wall
                self._missed[name] = missed
        self._missed = {name: self._missed[name] for name in kept}
        self._known = dict(sorted({**named, **kept}.items()))
        return tuple(self._known.values())


def _likeness(a: RoomProposal, b: RoomProposal) -> float:
    """Share of the longer one's walls that is common to both."""
    return common(a.pieces, b.pieces) / max(length(a.pieces), length(b.pieces))


def _same_wall(a: WallProposal, b: WallProposal) -> bool:
    return any(
        common(a.pieces[:1], pair[:1]) > 0.0 and common(a.pieces[1:], pair[1:]) > 0.0
        for pair in (b.pieces, b.pieces[::-1])
    )


def common(a: Sequence[PlanePiece], b: Sequence[PlanePiece]) -> float:
    """Length [m] of what two sets of pieces share of their planes."""
    return sum(
        _overlap(first, second) for first in a for second in b if first.plane_id == second.plane_id
    )


def _overlap(a: PlanePiece, b: PlanePiece) -> float:
    run = a.segment[1] - a.segment[0]
    size = float(np.linalg.norm(run))
    if size < 1e-9:
        return 0.0
    along = sorted(((b.segment - a.segment[0]) @ (run / size)).tolist())
    return max(0.0, min(along[1], size) - max(along[0], 0.0))


def length(pieces: Sequence[PlanePiece]) -> float:
    """Total length of pieces [m]."""
    return max(sum(piece.length for piece in pieces), 1e-9)
