"""Rooms for a building that has no word on rooms: the free areas that its walls enclose.

They are no truth about rooms. They tell where the building has an inside, so that a robot can start
there and drive about.
"""

from __future__ import annotations

from collections.abc import Sequence

import shapely
from shapely.geometry import MultiPolygon, Polygon
from shapely.geometry.base import BaseGeometry

from worlds.drafting import as_multipolygon
from worlds.plan import UNLABELLED, RoomOutline

GAP = 3.0
"""Openings in the outer walls up to this width do not let the outside in [m]."""
LEAST = 1.0
"""Free areas smaller than this are shafts and voids [m2]."""
ROBOT = 0.25
"""A disc of this radius fits into a free area [m]."""
SPUR = 0.10
"""Gaps narrower than this do not connect two areas [m]."""


def free_areas(walls: MultiPolygon) -> tuple[RoomOutline, ...]:
    """The areas between the walls, the largest first."""
    swollen = as_multipolygon(shapely.buffer(walls, GAP / 2.0, quad_segs=4))
    # Filled while swollen: what no disc of that size can enter from outside is inside.
    filled = shapely.union_all([Polygon(part.exterior) for part in swollen.geoms])
    inside = shapely.buffer(filled, -GAP / 2.0, quad_segs=4)
    gaps_closed = shapely.buffer(walls, SPUR / 2.0, join_style="mitre")
    free = inside.difference(gaps_closed)
    grown = [shapely.buffer(p, SPUR / 2.0, join_style="mitre") for p in shapely.get_parts(free)]
    return unlabelled([shape.difference(walls) for shape in grown])


def unlabelled(areas: Sequence[BaseGeometry]) -> tuple[RoomOutline, ...]:
    """Areas that a robot has room in, as outlines of that kind, the largest first."""
    parts = [part for area in areas for part in as_multipolygon(area).geoms]
    roomy = [p for p in parts if p.area > LEAST and not p.buffer(-ROBOT).is_empty]
    roomy.sort(key=lambda p: (-round(p.area, 6), p.bounds))
    return tuple(
        RoomOutline(f"area-{k}", f"area {k}", UNLABELLED, outline)
        for k, outline in enumerate(roomy, start=1)
    )
