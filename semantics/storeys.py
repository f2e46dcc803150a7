"""A building of several storeys, storey by storey: above one another, rooms are no neighbours."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import replace
from typing import Generic, TypeVar

import numpy as np

from slam.core import (
    Detector,
    DetectorFactory,
    Linking,
    Links,
    MapView,
    Proposals,
    RoomProposal,
    WallProposal,
)

STRIDE = 100_000
"""Ids of the storey above start so much higher; the first storey's are the detector's own."""


def by_storey(make: DetectorFactory) -> Detector:
    """A detector of the same kind for each storey, as one; on a single storey it is just that."""
    first = make()
    return _LinkingByStorey(first, make) if isinstance(first, Linking) else _ByStorey(first, make)


T = TypeVar("T")


class _Renamed(Generic[T]):
    """Proposals as those of a building. One that comes again as the same object is given out again
    as the same: whoever reads proposals need not look at it."""

    def __init__(self, make: Callable[[T, int], T]):
        """make: of a proposal and its storey."""
        self._make = make
        self._known: dict[int, tuple[T, T]] = {}

    def __call__(self, found: Iterable[tuple[int, T]]) -> tuple[T, ...]:
        """Of storeys and proposals."""
        last, self._known = self._known, {}
        for storey, proposal in found:
            name = id(proposal)
            self._known[name] = last.get(name) or (proposal, self._make(proposal, storey))
        return tuple(renamed for _, renamed in self._known.values())


def _room_of(room: RoomProposal, storey: int) -> RoomProposal:
    return replace(room, id=storey * STRIDE + room.id, storey=storey)


def _wall_of(wall: WallProposal, storey: int) -> WallProposal:
    return replace(wall, id=storey * STRIDE + wall.id)


class _ByStorey:
    """See ``by_storey``."""

    def __init__(self, first: Detector, make: DetectorFactory):
        self._make = make
        self._of: dict[int, Detector] = {0: first}
        self._rooms, self._walls = _Renamed(_room_of), _Renamed(_wall_of)

    def update(self, view: MapView) -> Proposals:
        """All rooms and walls of all storeys."""
        storeys = sorted({0, *(plane.storey for plane in view.planes), *self._of})
        if storeys == [0]:
            return self._of[0].update(view)
        keyframes = list(view.keyframes)
        found: list[tuple[int, Proposals]] = []
        for storey in storeys:
            planes = [plane for plane in view.planes if plane.storey == storey]
            there = [keyframe for keyframe in keyframes if keyframe.storey == storey]
            if storey not in self._of:
                self._of[storey] = self._make()
            told = self._of[storey].update(MapView(view.stamp, planes, there))
            found.append((storey, told))
        return Proposals(
            self._rooms((storey, room) for storey, told in found for room in told.rooms),
            self._walls((storey, wall) for storey, told in found for wall in told.walls),
        )


class _LinkingByStorey(_ByStorey):
    """One that tells of its links."""

    def links(self) -> Links:
        """Those of all storeys."""
        told = [detector.links() for detector in self._of.values() if isinstance(detector, Linking)]
        starts = np.cumsum([0, *(len(links.pieces) for links in told)])
        pieces = tuple(piece for links in told for piece in links.pieces)
        pairs = [
            start + np.asarray(links.pairs).reshape(-1, 2)
            for start, links in zip(starts, told, strict=False)
        ]
        return Links(pieces, np.concatenate(pairs).astype(np.int64))
