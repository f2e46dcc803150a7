"""What a room of places looks like in plan view, and which room it was before."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from shapely.geometry import MultiPolygon, Polygon
from shapely.ops import unary_union

from semantics.freespace.gvd import Ints
from semantics.freespace.places import Places
from slam.core import Array

SAME_ROOM = 0.3
"""Of the smaller of two regions: less overlap than this, and it is another room."""


def region(places: Places, members: Ints) -> Polygon:
    """The ground below the free spheres about the members; the largest part of it."""
    from shapely import points

    discs = points(places.positions[members, :2])
    joined = unary_union(
        [disc.buffer(r) for disc, r in zip(discs, places.clearance[members], strict=True)]
    )
    parts = joined.geoms if isinstance(joined, MultiPolygon) else [joined]
    return Polygon(max(parts, key=lambda part: part.area).exterior)


def centre(places: Places, members: Ints) -> Array:
    """(3,) the mean of the members; where no member's free sphere holds it, the nearest point of
    one (Hydra's rule)."""
    mean = places.positions[members].mean(axis=0)
    away = mean - places.positions[members]
    distance = np.linalg.norm(away, axis=1)
    beyond = distance - places.clearance[members]
    if beyond.min() <= 0.0:
        return np.asarray(mean)
    nearest = int(np.argmin(beyond))
    share = places.clearance[members][nearest] / distance[nearest]
    return np.asarray(places.positions[members][nearest] + share * away[nearest])


class RegionIds:
    """Numbers that stay with a region while it overlaps its earlier self."""

    def __init__(self) -> None:
        self._known: dict[int, Polygon] = {}
        self._next = 0

    def update(self, regions: Sequence[Polygon]) -> list[int]:
        """One number a region; largest overlap first."""
        pairs = sorted(
            (-mine.intersection(known).area / min(mine.area, known.area), id_, k)
            for k, mine in enumerate(regions)
            for id_, known in self._known.items()
        )
        ids: dict[int, int] = {}
        for overlap, id_, k in pairs:
            if -overlap >= SAME_ROOM and k not in ids and id_ not in ids.values():
                ids[k] = id_
        for k in range(len(regions)):
            if k not in ids:
                ids[k] = self._next
                self._next += 1
        self._known = {ids[k]: mine for k, mine in enumerate(regions)}
        return [ids[k] for k in range(len(regions))]
