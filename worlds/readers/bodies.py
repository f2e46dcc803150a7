"""Walls of any height and the holes in them, as the full-height walls and openings of a Storey.

A plan knows walls from floor to ceiling, and openings in them. A parapet is such a wall that is
open above, what hangs from the ceiling one that is open below.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import pairwise

import shapely
from shapely.geometry import MultiPolygon
from shapely.geometry.base import BaseGeometry

from worlds.drafting import as_multipolygon
from worlds.plan import Opening
from worlds.readers.carving import LOWEST, REACHES, STANDS, Slice, carve, worth_opening
from worlds.readers.outlines import SPECK, reaching_through

ROUND = 0.05
"""Heights at which walls end between floor and ceiling are rounded to this [m]."""


@dataclass(frozen=True)
class Body:
    """A piece of wall. Heights are above the storey's floor [m]."""

    footprint: BaseGeometry
    z_min: float
    z_max: float


@dataclass(frozen=True)
class Walls:
    """The walls of a storey. full: those that part rooms from floor to ceiling."""

    solid: MultiPolygon
    full: MultiPolygon
    openings: tuple[Opening, ...]


def build_up(bodies: Sequence[Body], holes: Sequence[Opening], height: float) -> Walls:
    """The walls of a storey ``height`` high. Bodies and holes beyond it are left out."""
    inside = [_within(body, height) for body in bodies if _common(body, height) > LOWEST]
    levels = sorted({0.0, height, *(z for body in inside for z in (body.z_min, body.z_max))})
    solid, open_ = carve([_slice(inside, low, high) for low, high in pairwise(levels)])
    cut = tuple(_cut(holes, solid, height))
    full = as_multipolygon(solid.difference(shapely.union_all([o.footprint for o in open_])))
    return Walls(solid, full, (*cut, *open_))


def _common(piece: Body | Opening, height: float) -> float:
    return min(piece.z_max, height) - max(piece.z_min, 0.0)


def _within(body: Body, height: float) -> Body:
    """The body from the floor and to the ceiling where it all but reaches them."""
    low = 0.0 if body.z_min <= STANDS else ROUND * round(body.z_min / ROUND)
    high = height if body.z_max >= height - REACHES else ROUND * round(body.z_max / ROUND)
    return Body(body.footprint, low, high)


def _slice(bodies: Sequence[Body], low: float, high: float) -> Slice:
    shapes = [body.footprint for body in bodies if body.z_min <= low and body.z_max >= high]
    return Slice(low, high, as_multipolygon(shapely.union_all(shapes)))


def _cut(holes: Sequence[Opening], walls: MultiPolygon, height: float) -> Iterator[Opening]:
    for hole in holes:
        if _common(hole, height) <= LOWEST or hole.footprint.intersection(walls).area < SPECK:
            continue
        low = 0.0 if hole.z_min <= STANDS and hole.kind != "window" else max(hole.z_min, 0.0)
        high = height if hole.z_max > height - LOWEST else hole.z_max
        if worth_opening(low, high, height):
            footprint = reaching_through(hole.footprint, walls)
            yield Opening(hole.kind, footprint, low, high, hole.glass)
