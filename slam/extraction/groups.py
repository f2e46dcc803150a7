"""Groups of runs that lie on one wall.

Two walls that look the same way, one a decimetre behind the other, have a slanting line in common
that no single run is far from. But with the beams' offsets taken off, each run tells its place to
some millimetres and its direction to a fraction of a degree: a group that two lines explain far
better than one is two walls.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from slam.core import Array, IntArray
from slam.extraction.config import ExtractionConfig
from slam.extraction.moments import Lines, running, turn_between
from slam.extraction.runs import Runs, best_cuts

GROWTHS = 4
"""How often a group is gathered anew about its own line."""
LOOSEST = np.radians(6.0)
"""However short a run, it does not belong to a wall that it differs more from in direction."""


class Gatherer:
    """Runs with what is needed to compare each with a line: ends in plan view, own direction, and
    how well both are known. free: (R,) which are in no group yet."""

    def __init__(self, runs: Runs, config: ExtractionConfig):
        own = Lines(runs.moments)
        half = np.sqrt(3.0 * own.spread / own.weight)
        count = runs.count
        rest = np.maximum(runs.sigma, config.rest_sigma)
        variance = runs.noise**2 + count * (rest**2 + config.flat_sigma**2)
        accuracy = runs.noise * np.sqrt(3.0 / count) / np.maximum(half, 1e-9)
        self.config = config
        self.size = half
        self.z = runs.z
        self.moments = runs.moments / variance[:, None]
        self.residual = own.residual / variance
        self.mean, self.angle = own.mean, own.angle
        reach = half[:, None] * own.direction
        self.ends = np.stack([own.mean - reach, own.mean + reach], axis=1)
        self.tolerance = np.minimum(config.angle + 3.0 * accuracy, LOOSEST)
        self.free = np.ones(len(half), dtype=bool)

    def line(self, members: IntArray) -> tuple[Array, Array, float]:
        """A point (2,) of the line through runs, its direction (2,), and that as an angle."""
        line = Lines(self.moments[members].sum(axis=0, keepdims=True))
        return line.mean[0], line.direction[0], float(line.angle[0])

    def about(self, members: IntArray, seed: int) -> IntArray:
        """The free runs on the line through some, as far as they hang together with the seed."""
        c, along, angle = self.line(members)
        fits = self.free & (turn_between(self.angle, np.array(angle)) < self.tolerance)
        off = np.abs((self.ends - c) @ np.array([-along[1], along[0]])).max(axis=1)
        fits &= off < self.config.distance
        fits[seed] = True
        candidates = np.flatnonzero(fits)
        spans = np.sort((self.ends[candidates] - c) @ along, axis=1)
        seat = int(np.searchsorted(candidates, seed))
        return candidates[_connected(spans, seat, self.config.reach)]

    def of_one_wall(self, members: IntArray, seed: int) -> IntArray:
        """The group, or of the two walls that it is of that of the seed."""
        core = members
        while (rest := self._without_other_wall(core, seed)) is not None:
            core = rest
        if len(core) == len(members):
            return members
        c, along, _ = self.line(core)
        off = (self.mean[members] - c) @ np.array([-along[1], along[0]])
        near = (np.abs(off) < 0.5 * self.config.step) | np.isin(members, core)
        return members[near]

    def _without_other_wall(self, members: IntArray, seed: int) -> IntArray | None:
        """The seed's part of a group that two lines explain better than one: of two walls beside
        each other, one over the other, or by turns. None where it is one wall."""
        moments = self.moments[members]
        whole = Lines(moments.sum(axis=0, keepdims=True))
        if whole.residual[0] - self.residual[members].sum() < self.config.gain:
            return None
        along, mean = whole.direction[0], self.mean[members]
        for key in (mean @ along, self.z[members], mean @ np.array([-along[1], along[0]])):
            order = np.argsort(key, kind="stable")
            sums = running(moments[order])
            stretch = np.array([0]), np.array([len(members)]), np.array([False])
            cut = int(best_cuts(sums, *stretch, 1, 1.0, self.config)[0])
            if cut > 0:
                first, second = members[order[:cut]], members[order[cut:]]
                return np.sort(first if seed in first else second)
        return None


def wall_groups(runs: Runs, config: ExtractionConfig) -> list[IntArray]:
    """Places of the runs of each wall: the longest run first, each run in one group."""
    gatherer = Gatherer(runs, config)
    groups = []
    for seed in np.argsort(-gatherer.size, kind="stable").tolist():
        if not gatherer.free[seed]:
            continue
        members = np.array([seed])
        for _ in range(GROWTHS):
            grown = gatherer.about(members, seed)
            if np.array_equal(grown, members):
                break
            members = grown
        members = gatherer.of_one_wall(members, seed)
        gatherer.free[members] = False
        groups.append(members)
    return groups


def _connected(spans: Array, seed: int, reach: float) -> NDArray[np.bool_]:
    """Which intervals (C, 2) hang together with the seed's across holes up to ``reach``."""
    order = np.argsort(spans[:, 0])
    top = np.maximum.accumulate(spans[order, 1])
    breaks = np.concatenate([[0], np.cumsum(spans[order[1:], 0] > top[:-1] + reach)])
    island = np.empty(len(spans), dtype=np.int64)
    island[order] = breaks
    return np.asarray(island == island[seed])
