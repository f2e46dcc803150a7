"""The detector: scans -> free space -> places -> rooms."""

from __future__ import annotations

import numpy as np

from semantics.freespace.gvd import Ints
from semantics.freespace.places import Places
from semantics.freespace.space import FreeSpace, Rhythm, Space
from semantics.hydra.clustering import assign
from semantics.hydra.config import PUBLISHED_V2, HydraConfig, RoomsConfig
from semantics.hydra.filtration import cores, dilation
from semantics.hydra.regions import RegionIds, centre, region
from slam.core import MapView, Proposals, RoomProposal


class HydraDetector:
    """Rooms from free space alone; no planes, no walls.

    Rooms are found from scratch on the whole map, as Hydra's back end does. Hydra numbers them anew
    each time; here a room keeps the number of the one that it overlaps.
    """

    def __init__(self, config: HydraConfig = PUBLISHED_V2, space: Space | None = None):
        self._config = config
        self._space: Space = FreeSpace(config.space) if space is None else space
        self._ids = RegionIds()
        self._rhythm = Rhythm(config.period)
        self._found = Proposals()

    def update(self, view: MapView) -> Proposals:
        """The rooms as found within the last ``period``; those of the last word as of now."""
        if self._rhythm.due(view, self._space.add(view)):
            self._found = Proposals(rooms=self._rooms())
        return self._found

    def _rooms(self) -> tuple[RoomProposal, ...]:
        places = self._space.places()
        rooms = rooms_of(places, self._config.rooms)
        regions = [region(places, members) for members in rooms]
        return tuple(
            RoomProposal(
                id_, (), np.array(polygon.exterior.coords[:-1]), centre(places, members)[:2], 1.0
            )
            for id_, members, polygon in zip(self._ids.update(regions), rooms, regions, strict=True)
        )


def rooms_of(places: Places, config: RoomsConfig) -> list[Ints]:
    """The places of each room."""
    threshold = dilation(places, config)
    if threshold is None:
        return []
    return assign(places, cores(places, threshold, config.min_component), config)
