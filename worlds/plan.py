"""The plan of a building: what a drawing says, before anybody has built it.

Metres, z up. A storey is the footprint of its walls (any polygons), the openings cut into them, and
the rooms' outlines. An outline may reach into the walls that bound it: the room is what of it the
walls leave free.
"""

from __future__ import annotations

from dataclasses import dataclass

from shapely.geometry import MultiPolygon, Polygon

CEILING_WHERE_UNKNOWN = 2.7
"""Height of a storey whose plan gives none [m]."""


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
class Plan:
    """A building. notes: where it comes from, for people."""

    name: str
    storeys: tuple[Storey, ...]
    notes: str = ""
