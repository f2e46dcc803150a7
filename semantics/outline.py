"""The outline of a room from the pieces that bound it.

Written out in plain numbers: a room has a handful of sides, for which arrays are slower.
"""

from __future__ import annotations

import math

import numpy as np
from shapely import make_valid
from shapely.geometry import MultiPoint, Polygon

from semantics.pieces import Pieces
from slam.core import Array

REACH = 1.5
"""How far beyond its seen end a side is taken to go on to meet the next one [m]."""
PARALLEL = 0.25
"""Sine of the angle below which two sides have no common corner."""

Point = tuple[float, float]
Side = tuple[Point, Point]


def room_outline(pieces: Pieces) -> tuple[Array, Array]:
    """Polygon (K, 2) and centre (2,) of a room; the centre lies in the polygon.

    The sides are walked around the room with its inside on the left; neighbours are extended to
    their common corner where that is near, and joined end to end where it is not.
    """
    polygon = _around(_walked(pieces))
    if polygon is None:
        polygon = MultiPoint(pieces.segment.reshape(-1, 2)).convex_hull.buffer(0.05)
    centre = polygon.centroid
    if not polygon.contains(centre):
        centre = polygon.representative_point()
    return np.array(polygon.exterior.coords[:-1]), np.array([centre.x, centre.y])


def _around(sides: list[Side]) -> Polygon | None:
    """The polygon through the corners; None where they make none."""
    order = _by_bearing(sides)
    corners: list[Point] = []
    for side, following in zip(order, [*order[1:], order[0]], strict=True):
        corners += _join(side, following)
    if len(corners) < 3:
        return None
    shape = Polygon(corners)
    if not shape.is_valid:
        mended = make_valid(shape)
        parts = [part for part in getattr(mended, "geoms", [mended]) if isinstance(part, Polygon)]
        shape = max(parts, key=lambda part: part.area, default=Polygon())
    return shape if shape.area > 0.2 else None


def _walked(pieces: Pieces) -> list[Side]:
    """Segments turned so that the normal is to the left of the way from start to end."""
    walked = []
    for ((ax, ay), (bx, by)), (nx, ny) in zip(
        pieces.segment.tolist(), pieces.normal.tolist(), strict=True
    ):
        left = (bx - ax) * ny - (by - ay) * nx >= 0.0
        walked.append(((ax, ay), (bx, by)) if left else ((bx, by), (ax, ay)))
    return walked


def _by_bearing(sides: list[Side]) -> list[Side]:
    """The sides by the direction of their middles from a point inside, the mean along the sides."""
    length = [math.dist(a, b) for a, b in sides]
    middle = [((a[0] + b[0]) / 2.0, (a[1] + b[1]) / 2.0) for a, b in sides]
    total = sum(length)
    x, y = (
        sum(m[k] * size for m, size in zip(middle, length, strict=True)) / total for k in (0, 1)
    )
    bearing = [math.atan2(my - y, mx - x) for mx, my in middle]
    return [sides[place] for place in sorted(range(len(sides)), key=lambda k: bearing[k])]


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
