"""Where the base's centre may be, as a grid, and the cheapest ways through it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import shapely
from numpy.typing import NDArray
from scipy.ndimage import distance_transform_edt, map_coordinates
from scipy.sparse import csr_matrix
from shapely.geometry.base import BaseGeometry

from slam.core import Array, IntArray

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
    index: IntArray

    @property
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

    def graph(self) -> csr_matrix:
        """(F, F) costs between neighbouring cells (eight each): length, dearer near walls."""
        values = self.clearance[tuple(self.cells.T)]
        price = 1.0 + 6.0 * np.clip(1.0 - values / COMFORT, 0.0, 1.0) ** 2
        rows, columns, costs = [], [], []
        for dr, dc in ((0, 1), (1, 0), (1, 1), (1, -1)):
            here, there = self._neighbours(dr, dc)
            rows.append(here)
            columns.append(there)
            costs.append(self.cell * np.hypot(dr, dc) * 0.5 * (price[here] + price[there]))
        count = len(self.cells)
        entries = (np.concatenate(costs), (np.concatenate(rows), np.concatenate(columns)))
        upper = csr_matrix(entries, shape=(count, count))
        return (upper + upper.T).tocsr()

    def _neighbours(self, dr: int, dc: int) -> tuple[IntArray, IntArray]:
        """Pairs of free cells that lie (dr, dc) apart."""
        height, width = self.index.shape
        left, right = max(-dc, 0), width - max(dc, 0)
        here = self.index[: height - dr, left:right]
        there = self.index[dr:, left + dc : right + dc]
        both = (here >= 0) & (there >= 0)
        return here[both], there[both]


def free_space(
    walls: BaseGeometry, region: BaseGeometry, distance: float, cell: float = 0.05
) -> FreeSpace:
    """The free space of a point that stays in ``region`` and ``distance`` [m] off ``walls``."""
    forbidden = shapely.buffer(walls, distance, quad_segs=4)
    low_x, low_y, high_x, high_y = shapely.bounds(region)
    xs = np.arange(low_x - cell, high_x + 2.0 * cell, cell)
    ys = np.arange(low_y - cell, high_y + 2.0 * cell, cell)
    shapely.prepare([forbidden, region])
    x, y = np.meshgrid(xs, ys)
    free = shapely.contains_xy(region, x, y)
    free[free] = ~shapely.intersects_xy(forbidden, x[free], y[free])
    off_forbidden = distance_transform_edt(_padded(free))[1:-1, 1:-1] * cell
    clearance = np.where(free, off_forbidden - 0.5 * cell + distance, 0.0)
    index = np.full(free.shape, -1, dtype=np.int64)
    index[free] = np.arange(int(free.sum()))
    return FreeSpace(np.array([xs[0], ys[0]]), cell, clearance, np.argwhere(free), index)


def _padded(free: NDArray[np.bool_]) -> NDArray[np.bool_]:
    return np.pad(free, 1, constant_values=False)
