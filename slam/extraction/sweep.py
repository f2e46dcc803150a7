"""A deskewed sweep whose returns are sorted by beam and, within each, by azimuth."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from slam.core import Array, IntArray

COLUMNS = 900
"""Directions in which returns of two beams are one above the other."""


@dataclass(frozen=True)
class Sweep:
    """xyz: (N, 3) base frame, z roughly up; ring: (N,); azimuth: (N,) [rad]; place: (N,) where each
    return is in the scan; origin: (3,) the sensor."""

    xyz: Array
    ring: NDArray[np.int16]
    azimuth: Array
    place: IntArray
    origin: Array

    @staticmethod
    def of(points: Array, ring: NDArray[np.int16], origin: Array, max_range: float) -> Sweep:
        """Of the returns (M, 3) that are numbers and within range."""
        relative = points[:, :2] - origin[:2]
        reach2 = np.einsum("ni,ni->n", relative, relative)
        use = np.isfinite(points[:, 2]) & (reach2 < max_range**2) & (reach2 > 1e-12)
        place = np.flatnonzero(use)
        azimuth = np.arctan2(relative[place, 1], relative[place, 0])
        order = np.argsort(8.0 * ring[place] + azimuth)  # a turn is less than 8
        place = place[order]
        return Sweep(points[place], ring[place], azimuth[order], place, origin)

    def __len__(self) -> int:
        return len(self.xyz)

    def above(self) -> tuple[IntArray, IntArray]:
        """Places (P,) of returns, and of those of the next beam over them."""
        table = np.full((int(self.ring.max(initial=0)) + 1, COLUMNS), -1, dtype=np.int64)
        column = ((self.azimuth + np.pi) * (COLUMNS / (2 * np.pi))).astype(np.int64) % COLUMNS
        table[self.ring, column] = np.arange(len(self))
        low, high = table[:-1], table[1:]
        pairs = (low >= 0) & (high >= 0)
        return low[pairs], high[pairs]

    def part(self, mask: NDArray[np.bool_]) -> Sweep:
        """Those of its returns."""
        at = np.flatnonzero(mask)
        return Sweep(self.xyz[at], self.ring[at], self.azimuth[at], self.place[at], self.origin)
