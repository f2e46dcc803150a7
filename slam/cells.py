"""Which cells of a plane have a point already: keeps maps thin at a fixed cost per point."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from slam.core import Array, IntArray

MARGIN = 64
"""Cells by which a grid grows beyond what is asked of it."""


class CellGrid:
    """Cells of one size on a plane, each taken or free; grows where it is needed."""

    def __init__(self, size: float):
        self._size = size
        self._low = np.zeros(2, dtype=np.int64)
        self._taken = np.zeros((0, 0), dtype=bool)

    def take(self, places: Array) -> IntArray:
        """Takes the cells of places (N, 2) [m]; which of the places were first in a free one."""
        if len(places) == 0:
            return np.empty(0, dtype=np.int64)
        cells = np.floor(places / self._size).astype(np.int64)
        self._cover(cells.min(axis=0), cells.max(axis=0))
        u, v = (cells - self._low).T
        flat = u * self._taken.shape[1] + v
        free = np.flatnonzero(~self._taken.ravel()[flat])
        _, first = np.unique(flat[free], return_index=True)
        fresh = np.sort(free[first])
        self._taken[u[fresh], v[fresh]] = True
        return fresh

    def _cover(self, low: IntArray, high: IntArray) -> None:
        """Makes the grid reach from one cell to the other."""
        shape = np.array(self._taken.shape)
        if not shape.all():
            self._low = low - MARGIN
            self._taken = np.zeros(tuple(high - low + 1 + 2 * MARGIN), dtype=bool)
            return
        before = np.where(low < self._low, self._low - low + MARGIN, 0)
        after = np.where(high >= self._low + shape, high + 1 - self._low - shape + MARGIN, 0)
        if before.any() or after.any():
            self._taken = np.pad(self._taken, list(zip(before, after, strict=True)))
            self._low = self._low - before


class Stretches:
    """How far a plane reaches along its level axis, with its holes, in cells of a quarter metre."""

    SIZE = 0.25

    def __init__(self) -> None:
        self._low = 0
        self._on: NDArray[np.bool_] = np.zeros(0, dtype=bool)

    def add(self, along: Array) -> None:
        """Takes in places (N,) [m] along the axis."""
        if len(along) == 0:
            return
        cells = np.floor(along / self.SIZE).astype(np.int64)
        low, high = int(cells.min()), int(cells.max())
        if len(self._on) == 0:
            self._low, self._on = low, np.zeros(high - low + 1, dtype=bool)
        before = max(0, self._low - low)
        after = max(0, high + 1 - self._low - len(self._on))
        if before or after:
            self._on = np.pad(self._on, (before, after))
            self._low -= before
        self._on[cells - self._low] = True

    def gap(self, along: Array) -> float:
        """Smallest distance [m] of places (N,) from where there is plane; 0 on the same cells."""
        on = np.flatnonzero(self._on) + self._low
        if len(on) == 0 or len(along) == 0:
            return np.inf
        cells = np.unique(np.floor(along / self.SIZE).astype(np.int64))
        after = np.minimum(np.searchsorted(on, cells), len(on) - 1)
        before = np.maximum(after - 1, 0)
        nearest = np.minimum(np.abs(on[after] - cells), np.abs(on[before] - cells))
        return max(0.0, float(nearest.min() - 1) * self.SIZE)
