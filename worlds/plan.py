"""The plan of a building: what a drawing says, before anybody has built it.

Metres, z up. A storey is the footprint of its walls (any polygons), the openings cut into them, and
the rooms' outlines. An outline may reach into the walls that bound it: the room is what of it the
walls leave free.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from shapely.geometry import MultiPolygon, Polygon

from slam.core import Array

MAX_STOREYS, MAX_ROOMS, MAX_DOORS = 200, 5_000, 5_000
"""Most storeys of a building in a file, and rooms and doors of a storey."""
MAX_NEIGHBOURS = 100_000
"""Most pairs of rooms on a storey that touch each other."""
CEILING_WHERE_UNKNOWN = 2.7
"""Height of a storey whose plan gives none [m]."""
UNLABELLED = "unlabelled"
"""Kind of a free area that nobody has called a room: where to drive, but no truth about rooms."""


@dataclass(frozen=True)
class RoomOutline:
    """A room as drawn. kind: room | corridor | stairs | ... (free text, lower case)."""

    id: str
    name: str
    kind: str
    outline: Polygon


@dataclass(frozen=True)
class Opening:
    """A hole through walls: a footprint across the wall, and the heights between which it is open.

    kind: door | window | opening. Heights are above the storey's floor [m]. glass: a pane closes it
    (so nobody drives through, whatever its kind).
    """

    kind: str
    footprint: Polygon
    z_min: float
    z_max: float
    glass: bool = False


@dataclass(frozen=True)
class Storey:
    """One floor of a building. Heights are absolute [m]."""

    name: str
    z_floor: float
    z_ceiling: float
    rooms: tuple[RoomOutline, ...]
    walls: MultiPolygon
    openings: tuple[Opening, ...] = ()


@dataclass(frozen=True)
class Ramp:
    """An inclined floor from a storey (its place in the plan) up to the next one.

    foot, head: (2, 2) its lower and its upper edge, left end first when seen from below [m].
    """

    storey: int
    foot: Array
    head: Array

    @property
    def outline(self) -> Polygon:
        """What it covers in plan view."""
        return Polygon([*self.foot, *self.head[::-1]])

    @property
    def run(self) -> float:
        """Its length in plan view, from the middle of the foot to that of the head [m]."""
        return float(np.linalg.norm(self.head.mean(axis=0) - self.foot.mean(axis=0)))


@dataclass(frozen=True)
class NamedRoute:
    """A part of a building to drive through. rooms: ids on one storey; the first is its start."""

    name: str
    rooms: tuple[str, ...]
    storey: int = 0


@dataclass(frozen=True)
class Plan:
    """A building. notes: where it comes from, for people; conditions: the preset that it is built
    under unless another is asked for; routes: parts of it that a run may name.
    """

    name: str
    storeys: tuple[Storey, ...]
    notes: str = ""
    conditions: str = "as-built"
    routes: tuple[NamedRoute, ...] = ()
    ramps: tuple[Ramp, ...] = ()
