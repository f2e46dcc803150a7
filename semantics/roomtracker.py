"""Rooms over time: each keeps its id from one inference to the next, none flickers."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace

import shapely

from semantics.overlap import common, length
from slam.core import RoomProposal


@dataclass(frozen=True)
class RoomTrackerConfig:
    """overlap: least share of common length, of the longer and of the shorter one, for two rooms to
    be one; area: least share of the area of both that is common to both, for two rooms to be one
    whose planes have become others; patience: inferences without
    evidence after which a room is given up, and for which two known rooms stay two although
    they are found as one; taken: share of a missing room's pieces that others may have taken before
    it is given up at once, and of a known room that is in another one."""

    overlap: tuple[float, float] = (0.3, 0.5)
    area: float = 0.5
    patience: int = 3
    taken: float = 0.5


class RoomTracker:
    """Matches found rooms to known ones by the length of wall that they share, and by where they
    are, since planes may have been merged; one that was given up and is found again gets its old
    id back.

    A room that comes as the very object it came as last time is known without looking.
    """

    def __init__(self, config: RoomTrackerConfig = RoomTrackerConfig()):
        self._config = config
        self._known: dict[int, RoomProposal] = {}
        self._sources: dict[int, RoomProposal] = {}
        self._missed: dict[int, int] = {}
        self._retired: dict[int, RoomProposal] = {}
        self._mergers: dict[frozenset[int], int] = {}
        self._shared: dict[tuple[int, int], float] = {}
        self._next = 0

    def update(self, found: Sequence[RoomProposal]) -> tuple[RoomProposal, ...]:
        """The rooms to hold true now: those found, and those missed only lately."""
        self._shared = {}
        found = self._believed(found)
        names = self._names(found)
        named = {
            name: self._known[name] if self._sources.get(name) is room else replace(room, id=name)
            for name, room in zip(names, found, strict=True)
        }
        kept = self._missing(named)
        gone = {n: room for n, room in self._known.items() if n not in named and n not in kept}
        self._retired = {n: r for n, r in {**self._retired, **gone}.items() if n not in named}
        self._sources = dict(zip(names, found, strict=True))
        self._known = dict(sorted({**named, **kept}.items()))
        return tuple(self._known.values())

    def _names(self, found: Sequence[RoomProposal]) -> list[int]:
        """The id of each found room: of a known one, else of one that was given up, else new."""
        same = {id(room): name for name, room in self._sources.items()}
        names = [same.get(id(room)) for room in found]
        taken = set(names)
        missing = {n: room for n, room in self._known.items() if n not in taken}
        self._match(names, found, missing)
        self._match_areas(names, found, missing)
        self._match(names, found, self._retired)
        return [self._new() if name is None else name for name in names]

    def _match(
        self,
        names: list[int | None],
        found: Sequence[RoomProposal],
        rivals: Mapping[int, RoomProposal],
    ) -> None:
        """Gives found rooms without a name those of the rivals that they are most like."""
        by_plane = _by_plane(rivals)
        least_long, least_short = self._config.overlap
        scores = []
        for place, room in enumerate(found):
            if names[place] is not None:
                continue
            near = {n for piece in room.pieces for n in by_plane.get(piece.plane_id, ())}
            for name in sorted(near):
                of_longer, of_shorter = self._likeness(room, name, rivals[name])
                if of_longer >= least_long and of_shorter >= least_short:
                    scores.append((-of_longer, place, name))
        _give(names, scores)

    def _match_areas(
        self,
        names: list[int | None],
        found: Sequence[RoomProposal],
        rivals: Mapping[int, RoomProposal],
    ) -> None:
        """Gives found rooms that still have no name those of the rivals that lie where they do."""
        mine = _outlines((place, found[place]) for place, name in enumerate(names) if name is None)
        if not mine:
            return
        theirs = _outlines((name, rival) for name, rival in rivals.items() if name not in names)
        scores = []
        for place, outline in mine.items():
            for name, other in theirs.items():
                shared = outline.intersection(other).area if outline.intersects(other) else 0.0
                share = shared / (outline.area + other.area - shared)
                if share >= self._config.area:
                    scores.append((-share, place, name))
        _give(names, scores)

    def _believed(self, found: Sequence[RoomProposal]) -> list[RoomProposal]:
        """Without rooms that have only lately been found where several known ones are."""
        by_plane = _by_plane(self._known)
        last = {id(room) for room in self._sources.values()}
        mergers, believed = {}, []
        for room in found:
            names = frozenset() if id(room) in last else self._inside(room, by_plane)
            if len(names) > 1:
                mergers[names] = self._mergers.get(names, 0) + 1
            if len(names) < 2 or mergers[names] > self._config.patience:
                believed.append(room)
        self._mergers = mergers
        return believed

    def _inside(self, room: RoomProposal, by_plane: Mapping[int, list[int]]) -> frozenset[int]:
        """Known rooms that are mostly in this one."""
        near = {n for piece in room.pieces for n in by_plane.get(piece.plane_id, ())}
        return frozenset(
            n
            for n in near
            if self._common(room, n, self._known[n])
            > self._config.taken * length(self._known[n].pieces)
        )

    def _likeness(self, room: RoomProposal, name: int, rival: RoomProposal) -> tuple[float, float]:
        """Shares of the longer and of the shorter one's walls that are common to both."""
        shared = self._common(room, name, rival)
        sizes = sorted((length(room.pieces), length(rival.pieces)))
        return shared / sizes[1], shared / sizes[0]

    def _common(self, room: RoomProposal, name: int, rival: RoomProposal) -> float:
        """Length [m] that a found room has in common with one of this name; asked twice."""
        key = id(room), name
        if key not in self._shared:
            self._shared[key] = common(room.pieces, rival.pieces)
        return self._shared[key]

    def _new(self) -> int:
        self._next += 1
        return self._next - 1

    def _missing(self, named: Mapping[int, RoomProposal]) -> dict[int, RoomProposal]:
        """Known rooms that were not found but are kept for now."""
        lost = {name: room for name, room in self._known.items() if name not in named}
        by_plane = _by_plane(named) if lost else {}
        kept = {}
        for name, room in lost.items():
            rivals = {n for piece in room.pieces for n in by_plane.get(piece.plane_id, ())}
            taken = sum(common(room.pieces, named[n].pieces) for n in sorted(rivals))
            patient = self._missed.get(name, 0) < self._config.patience
            if patient and taken < self._config.taken * length(room.pieces):
                kept[name] = room
        self._missed = {name: self._missed.get(name, 0) + 1 for name in kept}
        return kept


def _give(names: list[int | None], scores: Sequence[tuple[float, int, int]]) -> None:
    """Gives each place the name that suits it best (least score), no name twice."""
    for _, place, name in sorted(scores):
        if names[place] is None and name not in names:
            names[place] = name


def _outlines(rooms: Iterable[tuple[int, RoomProposal]]) -> dict[int, shapely.Polygon]:
    """The outlines of rooms that have one."""
    return {name: shapely.Polygon(room.polygon) for name, room in rooms if room.polygon is not None}


def _by_plane(rooms: Mapping[int, RoomProposal]) -> dict[int, list[int]]:
    """Plane id -> names of the rooms that have a piece of it."""
    found: dict[int, list[int]] = {}
    for name, room in rooms.items():
        for piece in room.pieces:
            found.setdefault(piece.plane_id, []).append(name)
    return found
