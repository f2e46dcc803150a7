"""The outline of a room from the pieces that bound it."""

from __future__ import annotations

import numpy as np
from shapely import make_valid
from shapely.geometry import MultiPoint, Polygon

from semantics.preprocess import Pieces
from slam.core import Array

REACH = 1.5
"""How far beyond its seen end a side is taken to go on to meet the next one [m]."""


def room_outline(pieces: Pieces) -> tuple[Array, Array]:
    """Polygon (K, 2) and centre (2,) of a room; the centre lies in the polygon.

    The sides are walked around the room with its inside on the left; neighbours are extended to
    their common corner where that is near, and joined end to end where it is not.
    """
    polygon = _around(pieces)
    if polygon is None:
        polygon = MultiPoint(pieces.segment.reshape(-1, 2)).convex_hull.buffer(0.05)
    centre = (
        polygon.centroid if polygon.contains(polygon.centroid) else polygon.representative_point()
    )
    return np.array(polygon.exterior.coords[:-1]), np.array(centre.coords[0])


def _around(pieces: Pieces) -> Polygon | None:
    """The polygon through the corners; None where they make none."""
    walked = _walked(pieces)
    order = np.argsort(_bearing(walked))
    corners: list[Array] = []
    for place, following in zip(order, np.roll(order, -1), strict=True):
        corners += _join(walked[place], walked[following])
    if len(corners) < 3:
        return None
    shape = make_valid(Polygon(np.array(corners)))
    parts = [part for part in getattr(shape, "geoms", [shape]) if isinstance(part, Polygon)]
    best = max(parts, key=lambda part: part.area, default=None)
    return best if best is not None and best.area > 0.2 else None


def _walked(pieces: Pieces) -> Array:
    """(M, 2, 2) segments turned so that the normal is to the left of the way from start to end."""
    run = pieces.segment[:, 1] - pieces.segment[:, 0]
    left = np.column_stack([-run[:, 1], run[:, 0]])
    backwards = np.einsum("mc,mc->m", left, pieces.normal) < 0.0
    segment = pieces.segment.copy()
    segment[backwards] = segment[backwards][:, ::-1]
    return segment


def _bearing(walked: Array) -> Array:
    """(M,) direction of each side's middle from a point inside, the mean along the sides."""
    middle = walked.mean(axis=1)
    length = np.linalg.norm(walked[:, 1] - walked[:, 0], axis=1)
    inside = (middle * length[:, None]).sum(axis=0) / length.sum()
    away = middle - inside
    return np.arctan2(away[:, 1], away[:, 0])


def _join(side: Array, following: Array) -> list[Array]:
    """Points from the end of one side to the start of the next."""
    end, start = side[1], following[0]
    direction, after = side[1] - side[0], following[1] - following[0]
    cross = direction[0] * after[1] - direction[1] * after[0]
    if abs(cross) > 0.25 * np.linalg.norm(direction) * np.linalg.norm(after):
        away = following[0] - side[0]
        at = (away[0] * after[1] - away[1] * after[0]) / cross
        corner = side[0] + at * direction
        reach = max(
            REACH, 0.5 * float(np.linalg.norm(direction)), 0.5 * float(np.linalg.norm(after))
        )
        if np.linalg.norm(corner - end) < reach and np.linalg.norm(corner - start) < reach:
            return [corner]
    return [end, start]
