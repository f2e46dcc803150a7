"""Floor and ceiling: the returns whose neighbour in the next beam is level with them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from slam.core import Array, IntArray, PlaneObservation
from slam.extraction.config import ExtractionConfig
from slam.extraction.fit import Noise, Prior, fit_plane, thin
from slam.extraction.offsets import BeamOffsets
from slam.extraction.ramps import on_ramp
from slam.extraction.sweep import Sweep

SAMPLE = 2000
"""So many of the candidates tell where a level is, before it is fitted to all that are on it."""
STEPS = (0.15, 0.10, 0.06)
"""Half widths of what a level is fitted to, one iteration after the other [m]."""
HELD, LOOSE = 1e6, 20.0
"""How much slopes are held near zero."""


@dataclass(frozen=True)
class Levels:
    """on: (N,) which returns of a sweep are on the floor, the ceiling or a ramp; inliers: places of
    those that floor and ceiling are to be fitted to, where they are found."""

    on: NDArray[np.bool_]
    inliers: tuple[IntArray, ...]


def find_levels(sweep: Sweep, config: ExtractionConfig) -> Levels:
    """Floor and ceiling of a sweep, and what of it is on a ramp."""
    below, above = sweep.above()
    flat = _level_neighbours(sweep, below, above)
    on = np.zeros(len(sweep), dtype=bool)
    found = []
    relative = sweep.xyz - sweep.origin
    design = np.column_stack([relative[:, :2], np.ones(len(sweep))])
    for sign in (1.0, -1.0):  # the floor, then the ceiling upside down
        depth = sign * relative[:, 2]
        candidates = np.flatnonzero(flat & (depth < -0.15))
        if len(candidates) < config.floor_min_points:
            continue
        sample = candidates[:: max(1, len(candidates) // SAMPLE)]
        level = _fit_level(design[sample], depth[sample], config)
        if np.hypot(level[0], level[1]) > np.tan(config.floor_slope):  # it took in a ramp's foot
            level = _fit_level(design[sample], depth[sample], config, HELD)
        off = depth - design @ level
        inliers = candidates[np.abs(off[candidates]) < config.floor_width]
        # Without the beams that only graze the floor where it meets a wall.
        ring = sweep.ring[inliers]
        inliers = inliers[np.bincount(ring, minlength=1)[ring] >= config.floor_min_beam]
        beyond = np.count_nonzero(off < -3.0 * config.floor_distance)
        if len(inliers) < config.floor_min_points or beyond > 0.1 * len(inliers):
            continue
        on |= (np.abs(off) < config.floor_distance) & (depth < 0.0)
        found.append(inliers)
    on |= on_ramp(sweep, on, below, above, config)
    return Levels(on, tuple(found))


def level_planes(
    sweep: Sweep, levels: Levels, offsets: BeamOffsets, noise: float, config: ExtractionConfig
) -> list[PlaneObservation]:
    """Floor and ceiling, fitted to returns without their beams' offsets. noise: of a range [m]."""
    return [_level(sweep, inliers, offsets, noise, config) for inliers in levels.inliers]


def _level_neighbours(sweep: Sweep, a: IntArray, b: IntArray) -> NDArray[np.bool_]:
    """(N,) True where the line to the next beam's return is level and neither of its
    neighbours stands above or below it, as on a wall. a, b: see ``Sweep.above``."""
    step = sweep.xyz[b] - sweep.xyz[a]
    rise, run = np.abs(step[:, 2]), np.hypot(step[:, 0], step[:, 1])
    is_flat = (rise < 0.04 + 0.01 * run) & (rise < np.tan(np.radians(30.0)) * run)
    is_steep = rise > np.tan(np.radians(60.0)) * run
    flat = np.zeros(len(sweep), dtype=bool)
    flat[a[is_flat]] = True
    flat[b[is_flat]] = True
    flat[a[is_steep]] = False
    flat[b[is_steep]] = False
    return flat


def _fit_level(design: Array, depth: Array, config: ExtractionConfig, hold: float = LOOSE) -> Array:
    """depth = a x + b y + c of the lowest level that many share, outliers let go bit by bit.

    design: (N, 3) rows x, y, 1. The base stands on its floor: slopes are held near zero.
    """
    plane = np.array([0.0, 0.0, _lowest_level(depth)])
    ridge = np.diag([hold, hold, 1e-6])
    for width in (*STEPS, config.floor_width, config.floor_width):
        near = np.abs(depth - design @ plane) < width
        A = design[near]
        plane = np.linalg.solve(A.T @ A + ridge, A.T @ depth[near])
    return plane


def _lowest_level(depth: Array) -> float:
    """The lowest height that a good part of the values shares, to 5 cm."""
    bins = np.round(depth / 0.05).astype(np.int64)
    counts = np.convolve(np.bincount(bins - bins.min()), [1, 2, 1], mode="same")
    return float((np.flatnonzero(counts > 0.4 * counts.max())[0] + 1 + bins.min()) * 0.05)


def _level(
    sweep: Sweep, inliers: IntArray, offsets: BeamOffsets, noise: float, config: ExtractionConfig
) -> PlaneObservation:
    xyz = offsets.exact(sweep, inliers)
    up = 1.0 if sweep.origin[2] > xyz[:, 2].mean() else -1.0
    frame = np.diag([1.0, up, up])
    prior = Prior(np.zeros(2), np.full(2, config.level_sigma**-2.0))
    of = Noise(noise, np.maximum(offsets.sigma, config.rest_sigma), np.inf)
    plane = fit_plane(xyz, sweep.ring[inliers], frame, sweep.origin, of, prior, config)
    points = sweep.xyz[inliers]
    keep = thin(points, frame[0], frame[1], 2.0 * config.thin)
    return PlaneObservation(
        normal=plane.normal,
        d=float(-plane.normal @ plane.centroid),
        centroid=plane.centroid,
        covariance=plane.covariance,
        points=points[keep],
        point_index=sweep.place[inliers[keep]],
    )
