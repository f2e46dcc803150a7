"""Straight runs: stretches of single beams that lie on one wall."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from slam.core import Array, IntArray
from slam.extraction.config import ExtractionConfig
from slam.extraction.moments import Lines, Split, moments_of, running, turn_between
from slam.extraction.sweep import Sweep


@dataclass(frozen=True)
class Runs:
    """Arrays over R. start, stop: places among the sweep's returns; ring: the beam; moments: (R, 6)
    in plan view about the sensor; z: mean height; sigma: (R,) of what a run's returns are off in
    common; noise: RMS distance of returns on a wall from their runs' lines [m], one number for the
    sweep."""

    start: IntArray
    stop: IntArray
    ring: IntArray
    moments: Array
    z: Array
    sigma: Array
    noise: float

    def __len__(self) -> int:
        return len(self.start)

    @property
    def count(self) -> Array:
        """(R,) how many returns."""
        return self.moments[:, 0]


def straight_runs(sweep: Sweep, config: ExtractionConfig) -> Runs:
    """Of a sweep without floor and ceiling."""
    xy = sweep.xyz[:, :2] - sweep.origin[:2]
    sums = running(moments_of(xy))
    straight, angle, noise, begun = _windows(sweep, xy, sums, config)
    start, stop = _unbroken(straight, angle, begun, config)
    start, stop = _cut(sums, start, stop, noise, config)
    start, stop = _grown(xy, sums, start, stop, begun, config.near * noise)
    length = np.hypot(*(xy[stop - 1] - xy[start]).T)
    long_enough = length >= config.min_run
    start, stop = start[long_enough], stop[long_enough]
    heights = np.concatenate([[0.0], np.cumsum(sweep.xyz[:, 2] - sweep.origin[2])])
    z = (heights[stop] - heights[start]) / (stop - start)
    ring = sweep.ring[start].astype(np.int64)
    sigma = np.full(len(start), config.beam_sigma)
    return Runs(start, stop, ring, sums[stop] - sums[start], z, sigma, noise)


def _windows(
    sweep: Sweep, xy: Array, sums: Array, config: ExtractionConfig
) -> tuple[NDArray[np.bool_], Array, float, IntArray]:
    """Of each return's neighbourhood in its beam: is it straight, the direction (mod pi) of its
    line; the sweep's noise; and where the unbroken stretch begins."""
    reach = np.hypot(*xy.T)
    jump = np.hypot(*(xy[1:] - xy[:-1]).T) > np.maximum(config.gap, config.far_gap * reach[1:])
    cut = np.flatnonzero((sweep.ring[1:] != sweep.ring[:-1]) | jump) + 1
    bounds = np.concatenate([[0], cut, [len(xy)]])
    piece = np.repeat(np.arange(len(bounds) - 1), np.diff(bounds))
    spacing = np.maximum(reach * _column_step(sweep), 0.004)
    half = np.clip((0.5 * config.window / spacing).astype(np.int64), 4, 40)
    place = np.arange(len(xy))
    start = np.maximum(place - half, bounds[piece])
    stop = np.minimum(place + half + 1, bounds[piece + 1])
    lines = Lines(sums[stop] - sums[start])
    residual = np.sqrt(lines.residual / lines.weight)
    long_enough = (lines.weight >= 5) & (lines.spread > 16.0 * lines.residual)
    low, high = config.noise
    likely = residual[long_enough & (residual < 2.0 * high)]
    noise = float(np.clip(np.median(likely), low, high)) if len(likely) else high
    return long_enough & (residual < config.straight * noise), lines.angle, noise, bounds[piece]


def _column_step(sweep: Sweep) -> float:
    """The angle between two shots of a beam, as most are apart [rad]."""
    return float(np.median(np.diff(sweep.azimuth))) if len(sweep) > 1 else np.inf


def _unbroken(
    straight: NDArray[np.bool_], angle: Array, begun: IntArray, config: ExtractionConfig
) -> tuple[IntArray, IntArray]:
    """Where runs of straight returns of like direction start and stop."""
    new = np.ones(len(straight), dtype=bool)
    new[1:] = (
        (begun[1:] != begun[:-1])
        | (straight[1:] != straight[:-1])
        | (turn_between(angle[1:], angle[:-1]) > config.turn)
    )
    start = np.flatnonzero(new)
    stop = np.append(start[1:], len(straight))
    keep = straight[start] & (stop - start >= config.min_run_points)
    return start[keep], stop[keep]


LEVELS = 5
"""A run is cut into at most two to this power."""


def _cut(
    sums: Array, start: IntArray, stop: IntArray, noise: float, config: ExtractionConfig
) -> tuple[IntArray, IntArray]:
    """Runs, those cut in two that two lines explain better, and again."""
    whole: list[tuple[IntArray, IntArray]] = []
    for _ in range(LEVELS):
        lines = Lines(sums[stop] - sums[start])
        bent = lines.residual > lines.weight * (config.bent * noise) ** 2
        cut = best_cuts(sums, start, stop, bent, config.min_run_points, noise**2, config)
        one = cut < 0
        whole.append((start[one], stop[one]))
        start, cut, stop = start[~one], cut[~one], stop[~one]
        start, stop = np.concatenate([start, cut]), np.concatenate([cut, stop])
    whole.append((start, stop))
    return np.concatenate([s for s, _ in whole]), np.concatenate([s for _, s in whole])


GROWTH = 24
"""So many returns are looked at beyond either end of a run."""


def _grown(
    xy: Array, sums: Array, start: IntArray, stop: IntArray, begun: IntArray, near: float
) -> tuple[IntArray, IntArray]:
    """Runs out to where their returns leave the line: a window across a corner is not straight, so
    that runs begin and end away from it. begun: (N,) where the beam's unbroken stretch begins."""
    order = np.argsort(start)
    start, stop = start[order], stop[order]
    lines = Lines(sums[stop] - sums[start])
    ahead = np.arange(GROWTH)
    before = start[:, None] - 1 - ahead
    free = before >= np.maximum(np.append(0, stop[:-1]), begun[start])[:, None]
    start = start - _on_line(xy, lines, before, free, near)
    after = stop[:, None] + ahead
    free = after < np.append(start[1:], len(xy))[:, None]
    free[free] &= begun[after[free]] == np.broadcast_to(begun[start][:, None], free.shape)[free]
    return start, stop + _on_line(xy, lines, after, free, near)


def _on_line(
    xy: Array, lines: Lines, places: IntArray, free: NDArray[np.bool_], near: float
) -> IntArray:
    """(R,) how many of the places (R, G) are free and near the run's line, up to the first that is
    not."""
    (x, y), (u, v) = xy[np.where(free, places, 0)].transpose(2, 0, 1), lines.direction.T
    x, y = x - lines.mean[:, :1], y - lines.mean[:, 1:]
    on = free & (np.abs(x * v[:, None] - y * u[:, None]) < near)
    return np.asarray(np.logical_and.accumulate(on, axis=1).sum(axis=1))


def best_cuts(
    sums: Array,
    start: IntArray,
    stop: IntArray,
    bent: NDArray[np.bool_],
    smallest: int,
    variance: float,
    config: ExtractionConfig,
) -> IntArray:
    """(R,) where each stretch of running moments is to be cut, -1 where it is one line.

    bent: (R,) which are no line, even if no single cut makes two of them, as where pilasters stand
    out of a wall; smallest: of the pieces; variance: of what the moments' residuals are sums of
    squares of.
    """
    room = np.maximum(stop - start - 2 * smallest + 1, 0)
    stride = np.maximum(room // 24, 1)
    tries = -(-room // stride)
    run = np.repeat(np.arange(len(start)), tries)
    nth = np.arange(len(run)) - np.repeat(np.cumsum(tries) - tries, tries)
    cuts = start[run] + smallest + nth * stride[run]
    split = Split(sums, start[run], cuts, stop[run])
    two = (split.gain > config.gain * variance) & (
        (split.gap > config.step) | (split.bend > config.bend) | bent[run]
    )
    best = np.full(len(start), -1, dtype=np.int64)
    order = np.argsort(split.gain[two], kind="stable")
    best[run[two][order]] = cuts[two][order]  # the last one written is the best
    return best
