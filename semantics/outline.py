"""The outlines of rooms from the pieces that bound them."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
import shapely
from numpy.typing import NDArray
from shapely import MultiPoint, Polygon

from semantics.around import Point, Round, Side, way_around
from semantics.pieces import Pieces
from slam.core import Array

REACH = 1.5
"""How far beyond its seen end a side is taken to go on to meet the next one [m]."""
PARALLEL = 0.25
"""Sine of the angle below which two sides have no common corner."""

EMPTY = Polygon()


def room_outlines(rooms: Sequence[Pieces]) -> list[tuple[Array, Array]]:
    """Polygon (K, 2) and centre (2,) of each room; the centre lies in the polygon.

    Sides that follow each other (``way_around``) are extended to their common corner where that is
    near, and joined end to end where it is not.
    """
    if not rooms:
        return []
    shapes = _polygons([_corners(way_around(pieces)) for pieces in rooms])
    for place in np.flatnonzero(shapely.area(shapes) <= 0.2).tolist():
        ends = MultiPoint(rooms[place].segment.reshape(-1, 2))
        shapes[place] = ends.convex_hull.buffer(0.05)
    centre = shapely.centroid(shapes)
    outside = ~shapely.contains(shapes, centre)
    centre[outside] = shapely.point_on_surface(shapes[outside])
    rings = shapely.get_exterior_ring(shapes)
    bounds = np.cumsum(shapely.get_num_coordinates(rings))
    outlines = np.split(shapely.get_coordinates(rings), bounds[:-1])
    return [
        (outline[:-1], at)
        for outline, at in zip(outlines, shapely.get_coordinates(centre), strict=True)
    ]


def _polygons(corners: Sequence[list[Point]]) -> NDArray[np.object_]:
    """The polygons through the corners; an empty one where they make none."""
    shapes = np.full(len(corners), EMPTY, dtype=object)
    number = np.array([len(points) for points in corners])
    made = np.flatnonzero(number >= 3)
    points = np.array([point for place in made.tolist() for point in corners[place]])
    if len(made):
        owner = np.repeat(np.arange(len(made)), number[made])
        shapes[made] = shapely.polygons(shapely.linearrings(points, indices=owner))
    for place in np.flatnonzero(~shapely.is_valid(shapes)).tolist():
        mended = shapely.make_valid(shapes[place])
        parts = [part for part in getattr(mended, "geoms", [mended]) if isinstance(part, Polygon)]
        shapes[place] = max(parts, key=lambda part: part.area, default=EMPTY)
    return shapes


def _corners(order: Round) -> list[Point]:
    """From side to side of the way around."""
    pairs = zip(order, [*order[1:], order[0]], strict=True)
    return [corner for side, following in pairs for corner in _join(side, following)]


def _join(side: Side, following: Side) -> list[Point]:
    """Points from the end of one side to the start of the next."""
    (ax, ay), end = side
    start, (qx, qy) = following
    dx, dy = end[0] - ax, end[1] - ay
    fx, fy = qx - start[0], qy - start[1]
    cross = dx * fy - dy * fx
    long, after = math.hypot(dx, dy), math.hypot(fx, fy)
    if abs(cross) > PARALLEL * long * after:
        at = ((start[0] - ax) * fy - (start[1] - ay) * fx) / cross
        corner = (ax + at * dx, ay + at * dy)
        reach = max(REACH, 0.5 * long, 0.5 * after)
        if math.dist(corner, end) < reach and math.dist(corner, start) < reach:
            return [corner]
    return [end, start]
