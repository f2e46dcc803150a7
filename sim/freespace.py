"""Where the base's centre may be, as a grid, and the cheapest ways through it."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
import shapely
from numpy.typing import NDArray
from scipy.ndimage import distance_transform_edt, map_coordinates
from scipy.sparse import csr_matrix
from shapely.geometry.base import BaseGeometry

from slam.core import Array, InputError, IntArray

MOST_CELLS = 40_000_000
"""Of a grid: 4 GB of numbers about them; at 10 cm, 600 m x 600 m."""
COMFORT = 0.6
"""Distance from walls [m] beyond which more room is worth no detour."""


@dataclass(frozen=True)
class FreeSpace:
    """A grid over the free space of a disc's centre.

    origin: (2,) world coordinates of the middle of cell (0, 0); cell [m]; clearance: (H, W)
    distance from a cell's middle to the nearest wall [m], about half a cell exact, 0 where the disc
    may not be; cells: (F, 2) row and column of the free cells; index: (H, W) a cell's place in
    ``cells`` or -1.
    """

    origin: Array
    cell: float
    clearance: Array
    cells: IntArray
    index: NDArray[np.int32]

    @cached_property
    def centres(self) -> Array:
        """(F, 2) world coordinates of the free cells."""
        return self.origin + self.cell * self.cells[:, ::-1]

    def clearance_at(self, points: Array) -> Array:
        """(N,) distance of points (N, 2) from the nearest wall [m], interpolated."""
        columns, rows = ((np.asarray(points) - self.origin) / self.cell).T
        return map_coordinates(self.clearance, [rows, columns], order=1, mode="constant")

    def clearance_along(self, start: Array, end: Array) -> float:
        """The least distance from a wall on the way straight from start to end [m]."""
        steps = int(np.ceil(np.linalg.norm(end - start) / (0.5 * self.cell))) + 1
        fractions = np.linspace(0.0, 1.0, steps)[:, None]
        return float(self.clearance_at(start + fractions * (end - start)).min())

    def nearest(self, point: Array, within: float) -> int | None:
        """The free cell nearest to a point (2,), if there is one within that distance [m]."""
        reach = int(np.ceil(within / self.cell))
        column, row = np.round((np.asarray(point) - self.origin) / self.cell).astype(int)
        top, left = max(row - reach, 0), max(column - reach, 0)
        around = self.index[top : max(row + reach + 1, 0), left : max(column + reach + 1, 0)]
        candidates = around[around >= 0]
        if not len(candidates):
            return None
        centres = self.origin + self.cell * self.cells[candidates, ::-1]
        distances = np.linalg.norm(centres - point, axis=1)
        best = int(np.argmin(distances))
        return int(candidates[best]) if distances[best] <= within else None

    def inside(self, outline: BaseGeometry) -> IntArray:
        """Free cells whose middle lies within an outline."""
        low_x, low_y, high_x, high_y = shapely.bounds(outline)
        low = np.floor((np.array([low_x, low_y]) - self.origin) / self.cell).astype(int)
        high = np.ceil((np.array([high_x, high_y]) - self.origin) / self.cell).astype(int) + 1
        near = self.index[max(low[1], 0) : max(high[1], 0), max(low[0], 0) : max(high[0], 0)]
        near = near[near >= 0].astype(np.int64)
        return near[shapely.contains_xy(outline, *self.centres[near].T)]

    def graph(self) -> csr_matrix:
        """(F, F) costs between neighbouring cells (eight each), every pair once: length, dearer
        near walls."""
        values = self.clearance[tuple(self.cells.T)]
        price = 1.0 + 6.0 * np.clip(1.0 - values / COMFORT, 0.0, 1.0) ** 2
        padded = np.pad(self.index, ((0, 1), (1, 1)), constant_values=-1)
        rows, columns = self.cells.T
        # In the order of their indices, so that the rows of the matrix are sorted.
        steps = ((0, 1), (1, -1), (1, 0), (1, 1))
        there = np.stack([padded[rows + dr, columns + 1 + dc] for dr, dc in steps], axis=1)
        free = there >= 0
        length = self.cell * np.array([np.hypot(dr, dc) for dr, dc in steps])
        cost = 0.5 * length * (price[:, None] + price[np.maximum(there, 0)])
        pointers = np.append(0, np.cumsum(free.sum(axis=1)))
        size = (len(self.cells), len(self.cells))
        return csr_matrix((cost[free], there[free], pointers), shape=size)


def free_space(
    walls: BaseGeometry, region: BaseGeometry, distance: float, cell: float = 0.05
) -> FreeSpace:
    """The free space of a point that stays in ``region`` and ``distance`` [m] off ``walls``.

    Raises InputError for a region that a grid of ``MOST_CELLS`` does not cover.
    """
    forbidden = shapely.buffer(walls, distance, quad_segs=4)
    low_x, low_y, high_x, high_y = shapely.bounds(region)
    if (high_x - low_x) * (high_y - low_y) > MOST_CELLS * cell**2:
        raise InputError(
            f"rooms over {high_x - low_x:.0f} x {high_y - low_y:.0f} m: too many for one route; "
            "choose a storey, or a smaller building"
        )
    xs = np.arange(low_x - cell, high_x + 2.0 * cell, cell)
    ys = np.arange(low_y - cell, high_y + 2.0 * cell, cell)
    free = covered(region, xs, ys) & ~covered(forbidden, xs, ys)
    off_forbidden = distance_transform_edt(_padded(free))[1:-1, 1:-1] * cell
    clearance = np.where(free, off_forbidden - 0.5 * cell + distance, 0.0)
    index = np.full(free.shape, -1, dtype=np.int32)
    index[free] = np.arange(int(free.sum()))
    return FreeSpace(np.array([xs[0], ys[0]]), cell, clearance, np.argwhere(free), index)


def covered(shape: BaseGeometry, xs: Array, ys: Array) -> NDArray[np.bool_]:
    """(H, W) which points of an even grid of columns ``xs`` and rows ``ys`` lie in polygons.

    The polygons' sides cut each row; a point with an odd number of cuts to its left is inside.
    """
    rings = [np.asarray(ring.coords) for ring in shapely.get_rings(shapely.get_parts(shape))]
    if not rings:
        return np.zeros((len(ys), len(xs)), dtype=bool)
    start = np.concatenate([ring[:-1] for ring in rings])
    end = np.concatenate([ring[1:] for ring in rings])
    cell = xs[1] - xs[0]
    first, last = (
        np.ceil((bound(start[:, 1], end[:, 1]) - ys[0]) / cell).astype(np.int64)
        for bound in (np.minimum, np.maximum)
    )
    first, last = np.clip(first, 0, len(ys)), np.clip(last, 0, len(ys))
    side = np.repeat(np.arange(len(start)), last - first)
    row = np.arange(len(side)) - np.repeat(np.cumsum(last - first) - last, last - first)
    along = (ys[0] + cell * row - start[side, 1]) / (end[side, 1] - start[side, 1])
    cut = start[side, 0] + along * (end[side, 0] - start[side, 0])
    column = np.clip(np.ceil((cut - xs[0]) / cell).astype(np.int64), 0, len(xs))
    width = len(xs) + 1
    cuts = np.bincount(row * width + column, minlength=len(ys) * width)
    odd = np.cumsum(cuts.reshape(len(ys), width).astype(np.int16), axis=1) & 1
    return odd[:, :-1].astype(bool)


def _padded(free: NDArray[np.bool_]) -> NDArray[np.bool_]:
    return np.pad(free, 1, constant_values=False)
