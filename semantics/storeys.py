"""A building of several storeys, storey by storey: above one another, rooms are no neighbours."""

from __future__ import annotations

from dataclasses import replace

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


class _ByStorey:
    """See ``by_storey``."""

    def __init__(self, first: Detector, make: DetectorFactory):
        self._make = make
        self._of: dict[int, Detector] = {0: first}

    def update(self, view: MapView) -> Proposals:
        """All rooms and walls of all storeys."""
        storeys = sorted({0, *(plane.storey for plane in view.planes), *self._of})
        if storeys == [0]:
            return self._of[0].update(view)
        keyframes = list(view.keyframes)
        rooms: list[RoomProposal] = []
        walls: list[WallProposal] = []
        for storey in storeys:
            planes = [plane for plane in view.planes if plane.storey == storey]
            there = [keyframe for keyframe in keyframes if keyframe.storey == storey]
            if storey not in self._of:
                self._of[storey] = self._make()
            found = self._of[storey].update(MapView(view.stamp, planes, there))
            first = storey * STRIDE
            rooms += [replace(room, id=first + room.id, storey=storey) for room in found.rooms]
            walls += [replace(wall, id=first + wall.id) for wall in found.walls]
        return Proposals(tuple(rooms), tuple(walls))


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
