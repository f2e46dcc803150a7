"""What of a building mesh is solid at a height, from the lines in which a level plane cuts it.

Meshes of buildings are seldom closed. Where their surfaces are oriented, the winding number tells
solid from free; where they are not (each triangle twice, or at random), what is thin is wall;
single sheets get a thickness.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import shapely
from numpy.typing import NDArray
from shapely.geometry import MultiPolygon

from slam.core import Array
from worlds.readers.meshfile import Mesh
from worlds.readers.outlines import clean_walls
from worlds.tangle import tangled

SNAP = 0.001
"""Ends of lines that are nearer than this meet [m]."""
SHEET = 0.04
"""Thickness of a wall that is a single sheet [m]."""
THICKEST = 0.7
"""Walls are at most this thick, where no orientation tells solid from free [m]."""
ROOMY = 0.3
"""A cell of which more than this part is wider than a wall is not one."""
LOOSE = 0.2
"""Part of the ends of lines that may meet no beginning, in an oriented mesh."""
VOID = 1.5
"""Closed cells below this are solid, where no orientation tells [m2]."""
MAX_LINES = 200_000
"""Most lines in one slice: an office floor has five thousand."""
CHUNK = 2_000_000
"""Pairs of points and lines that are held at once."""


@dataclass(frozen=True)
class Lines:
    """ends: (L, 2, 2) with the solid to the left, where the mesh is oriented."""

    ends: Array


def lines_at(mesh: Mesh, z: float) -> Lines:
    """The lines in which the plane at height z cuts a mesh. No vertex may lie on it."""
    corners = mesh.vertices[mesh.faces]
    above = corners[:, :, 2] > z
    cut = above.any(axis=1) & ~above.all(axis=1)
    corners, above = corners[cut], above[cut]
    # The corner that is alone on its side goes first; the order around stays.
    alone = np.where(above.sum(axis=1) == 1, np.argmax(above, axis=1), np.argmin(above, axis=1))
    a, b, c = (corners[np.arange(len(alone)), (alone + k) % 3] for k in range(3))
    ends = np.stack([_crossing(a, b, z), _crossing(a, c, z)], axis=1)
    # With outward triangles, a lone corner above sees its line run with the solid to its left.
    upward = above[np.arange(len(alone)), alone]
    ends[~upward] = ends[~upward][:, ::-1]
    return Lines(ends)


def _crossing(p: Array, q: Array, z: float) -> Array:
    """(K, 2) where the lines from p to q (K, 3) have the height z."""
    share = (z - p[:, 2]) / (q[:, 2] - p[:, 2])
    return p[:, :2] + share[:, None] * (q[:, :2] - p[:, :2])


def solid_in(lines: Lines) -> MultiPolygon:
    """What is solid among the lines of a slice. Raises ValueError for lines that are a tangle."""
    ends, once = lines.ends, _once(lines.ends)
    if not len(once):
        return MultiPolygon()
    drawn = shapely.linestrings(once)
    if tangled(drawn):
        raise ValueError("lines that cross without end")
    network = shapely.union_all(drawn, grid_size=SNAP)
    cells = shapely.get_parts(shapely.polygonize(shapely.get_parts(network)))
    solid = shapely.union_all(cells[_is_solid(cells, ends)])
    loose = network.difference(shapely.buffer(solid, 2.0 * SNAP))
    sheets = shapely.buffer(loose, SHEET / 2.0, cap_style="square", join_style="mitre")
    return clean_walls(shapely.union_all([solid, sheets]))


def _once(ends: Array) -> Array:
    """Lines on the grid, without those of no length and those that repeat others either way."""
    grid = np.round(ends / SNAP).astype(np.int64)
    grid = grid[(grid[:, 0] != grid[:, 1]).any(axis=1)]
    swap = (grid[:, 0, 0] > grid[:, 1, 0]) | (
        (grid[:, 0, 0] == grid[:, 1, 0]) & (grid[:, 0, 1] > grid[:, 1, 1])
    )
    grid[swap] = grid[swap][:, ::-1]
    return np.unique(grid, axis=0) * SNAP


def _is_solid(cells: NDArray[np.object_], ends: Array) -> NDArray[np.bool_]:
    if not len(cells):
        return np.zeros(0, dtype=bool)
    inside = shapely.get_coordinates(shapely.point_on_surface(cells))
    winding = winding_numbers(inside, ends)
    area = shapely.area(cells)
    core = shapely.buffer(cells, -THICKEST / 2.0, join_style="mitre")
    wide = shapely.area(shapely.buffer(core, THICKEST / 2.0, join_style="mitre"))
    thin = wide < ROOMY * area
    turned = area[thin & (np.abs(winding) > 0.5)].sum() > 0.5 * area[thin].sum()
    if turned and _oriented(ends):
        return (winding > 0.5) | (thin & (winding < -0.5))
    return thin | (area < VOID)


def _oriented(ends: Array) -> bool:
    """Whether lines mostly begin where others end, as those of an oriented mesh do."""
    places, index = np.unique(
        np.round(ends.reshape(-1, 2) / SNAP).astype(np.int64), axis=0, return_inverse=True
    )
    signs = np.tile([1.0, -1.0], len(ends))
    loose = np.abs(np.bincount(index.ravel(), signs, len(places))).sum()
    return bool(loose < LOOSE * 2.0 * len(ends))


def winding_numbers(points: Array, ends: Array) -> Array:
    """(P,) how often lines (L, 2, 2) run round each of the points (P, 2), anticlockwise."""
    step = max(1, CHUNK // max(len(ends), 1))
    found = [_turns(points[k : k + step], ends) for k in range(0, len(points), step)]
    return np.concatenate([np.empty(0), *found])


def _turns(points: Array, ends: Array) -> Array:
    a, b = (ends[None, :, k] - points[:, None] for k in (0, 1))
    cross = a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0]
    return np.arctan2(cross, (a * b).sum(axis=-1)).sum(axis=1) / (2.0 * np.pi)
