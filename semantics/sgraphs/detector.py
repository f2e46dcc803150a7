"""The detector: free-space clusters and the mapped planes about them -> rooms and corridors."""

from __future__ import annotations

import numpy as np

from semantics.freespace.space import FreeSpace, Rhythm, Space
from semantics.sgraphs.clusters import clusters_of
from semantics.sgraphs.config import PUBLISHED, SgraphsConfig
from semantics.sgraphs.matching import axes_of, match, side_of
from semantics.sgraphs.outlines import proposal
from semantics.sgraphs.rooms import KnownRooms
from slam.core import Array, MapPlane, MapView, Proposals


class SgraphsDetector:
    """Rooms of four planes and corridors of two; no walls (its published form finds none)."""

    def __init__(self, config: SgraphsConfig = PUBLISHED, space: Space | None = None):
        self._config = config
        self._space: Space = FreeSpace(config.space) if space is None else space
        self._clusters: list[Array] = []
        self._rooms = KnownRooms(config)
        self._axes = np.eye(2)
        self._rhythm = Rhythm(config.period)

    def update(self, view: MapView) -> Proposals:
        """All rooms so far; free space is read every ``period``, and for the last word."""
        if self._rhythm.due(view, self._space.add(view)):
            self._clusters = clusters_of(self._space.places(), self._config)
        if not self._config.faults:
            self._axes = axes_of(view.planes, self._axes)
        planes = {plane.id: plane for plane in view.planes if not plane.horizontal}
        self._rooms.refresh(planes, self._axes)
        sides = [side_of(plane, self._axes) for plane in _seen_lately(view, self._config.window)]
        for cluster in self._clusters:
            found = match(cluster, self._axes, sides, self._config)
            if found is not None:
                self._rooms.take(found)
        return Proposals(rooms=tuple(proposal(room, self._axes) for room in self._rooms))


def _seen_lately(view: MapView, window: float) -> list[MapPlane]:
    """Vertical planes that the last keyframes saw."""
    late = {k.id for k in view.keyframes if k.stamp >= view.stamp - window}
    return [
        plane
        for plane in view.planes
        if not plane.horizontal and late.intersection(plane.keyframes.tolist())
    ]
