"""Outlines that somebody traced, made fit for solids: united, straightened, without slivers."""

from __future__ import annotations

import numpy as np
import shapely
from shapely.geometry import MultiPolygon, Polygon
from shapely.geometry.base import BaseGeometry

from slam.core import Array
from worlds.drafting import as_multipolygon

WAVER = 0.01
"""Corners that stand out less than this from the line beside them go [m]."""
SLIVER = 0.02
"""Gaps between walls and tongues of wall narrower than this are slips of the pen [m]."""
SPECK = 0.0025
"""Pieces of wall smaller than this go: a post of 5 cm [m2]."""
POCKET = 0.02
"""Holes in walls smaller than this are filled [m2]."""
GRID = 1e-6
"""Grid on which outlines are united [m]."""
THROUGH = 0.01
"""How far an opening reaches beyond the wall on both sides, so that the cut is clean [m]."""


def clean_walls(shape: BaseGeometry, waver: float = WAVER) -> MultiPolygon:
    """Walls that waver by at most ``waver``, without slivers, specks and pockets."""
    solid = as_multipolygon(shapely.make_valid(shape))
    closed = _mitred(_mitred(solid, SLIVER / 2.0), -SLIVER / 2.0)
    whole = shapely.union_all([solid, closed], grid_size=GRID)
    kept = _without_tongues(whole)
    straight = as_multipolygon(shapely.union_all(kept.simplify(waver), grid_size=GRID))
    return MultiPolygon([_filled(part) for part in straight.geoms if part.area > SPECK])


def without_slivers(shape: BaseGeometry, width: float = SLIVER) -> MultiPolygon:
    """What of a shape is wider than ``width``."""
    whole = shapely.union_all(as_multipolygon(shape))
    opened = _mitred(_mitred(whole, -width / 2.0), width / 2.0)
    return as_multipolygon(shapely.intersection(whole, opened, grid_size=GRID))


def _without_tongues(shape: BaseGeometry) -> BaseGeometry:
    kept = without_slivers(shape)
    return kept if not kept.is_empty else shape


def _mitred(shape: BaseGeometry, distance: float) -> BaseGeometry:
    return shapely.buffer(shape, distance, join_style="mitre", mitre_limit=3.0)


def _filled(polygon: Polygon) -> Polygon:
    return Polygon(polygon.exterior, [h for h in polygon.interiors if Polygon(h).area > POCKET])


def projected(vertices: Array, triangles: np.ndarray) -> BaseGeometry:
    """The shadow of a mesh (V, 3), (T, 3) on the plane."""
    corners = vertices[:, :2][triangles]
    a, b = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    seen = np.abs(a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]) > 1e-9
    return shapely.union_all(shapely.polygons(corners[seen]), grid_size=1e-5)


def reaching_through(footprint: Polygon, walls: BaseGeometry) -> Polygon:
    """The footprint of an opening, lengthened across the wall by ``THROUGH`` on both sides.

    Only a rectangle is lengthened, and in the direction in which that takes less out of the walls:
    an opening drawn exactly as deep as its wall leaves films of wall behind once both were rounded.
    """
    frame = shapely.minimum_rotated_rectangle(footprint)
    if frame.geom_type != "Polygon" or frame.area > 1.01 * footprint.area:
        return footprint
    corners = np.asarray(frame.exterior.coords)[:4]
    variants = [_lengthened(corners), _lengthened(np.roll(corners, -1, axis=0))]
    near = shapely.intersection(walls, shapely.box(*footprint.buffer(1.0).bounds))
    return min(variants, key=lambda p: near.intersection(p).area)


def _lengthened(corners: Array) -> Polygon:
    """The rectangle with its sides 0-1 and 2-3 lengthened at both ends."""
    run = corners[1] - corners[0]
    step = THROUGH * run / np.linalg.norm(run)
    return Polygon([corners[0] - step, corners[1] + step, corners[2] + step, corners[3] - step])
