"""Where along planes something was seen, and how high: lookups between two places."""

from __future__ import annotations

import numpy as np

from semantics.pieces import PreprocessConfig
from semantics.runs import LONGEST, Runs
from slam.core import Array, IntArray


class Bins:
    """Every bin of planes where they were seen, B in all. middle: (B,) along the plane [m]."""

    def __init__(self, runs: Runs):
        self._ids = runs.plane_id
        self.middle, heights = runs.bins[0], runs.bins[1:]
        self._total = np.zeros((2, len(self.middle) + 1))
        np.cumsum(heights, axis=1, out=self._total[:, 1:])
        # Planes one behind the other on one line, so that one search finds all.
        shift = 4.0 * LONGEST * np.arange(len(runs))
        self._key = self.middle + np.repeat(shift, runs.bin_count)

    def places(self, plane_id: IntArray, along: Array) -> tuple[IntArray, IntArray]:
        """The first bin (M,) between two places (M, 2) along planes (M,), and one past the last."""
        shift = 4.0 * LONGEST * np.searchsorted(self._ids, plane_id)
        first, last = np.searchsorted(self._key, along.T + shift)
        return first, last

    def between(self, plane_id: IntArray, along: Array) -> tuple[IntArray, Array]:
        """How many bins (M,) there are between two places (M, 2) along planes (M,), and where they
        were seen lowest and highest on average (2, M) [m]; 0 where there are none."""
        first, last = self.places(plane_id, along)
        count = last - first
        total = self._total.take(last, axis=1) - self._total.take(first, axis=1)
        return count, total / np.maximum(count, 1)

    def holes(self, config: PreprocessConfig) -> IntArray:
        """Bins after which there is a hole as wide as a wall is thick, all about it being seen."""
        step = self._key[1:] - self._key[:-1] - config.bin
        low, high = config.stub
        hole = np.flatnonzero((step > low) & (step < high))
        beside = np.arange(1, config.stub_bins + 1)
        hole = hole[(hole >= beside[-1]) & (hole < len(step) - beside[-1])]
        about = hole[:, None] + np.concatenate([-beside, beside])
        return np.asarray(hole[(step[about] < low).all(axis=1)])
