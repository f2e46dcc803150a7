"""Walls and beam offsets that explain together what a sensor at rest between walls measured."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from sim.calibration.shots import Mask, Shots
from slam.core import Array, InputError, IntArray


@dataclass(frozen=True)
class WallConfig:
    """tolerance [m]: a return that far from a plane belongs to it; incidence: least cosine of what
    is fitted to; lean: how far a wall's normal may be from level (sine); planes, least_points,
    trials, sample, reach [m]: of the search; patch [rad], purity: fitted is where that share of
    what a beam returned over a patch is on one plane, without the things that stand before walls;
    flatness [m]: median residual, above which it is no wall; least_votes: returns below which a
    beam has no say about a plane."""

    tolerance: float = 0.06
    incidence: float = 0.5
    lean: float = 0.06
    planes: int = 8
    least_points: int = 800
    trials: int = 400
    sample: int = 10_000
    reach: float = 0.8
    patch: float = np.radians(2.0)
    purity: float = 0.9
    flatness: float = 0.012
    least_votes: int = 150


@dataclass(frozen=True)
class Seen:
    """Shots (F, B) against planes. plane: which one was hit, or -1; residual [m]: range minus what
    the plane and the beam's offset predict; cosine of the incidence; clean: what to fit to."""

    plane: IntArray
    residual: Array
    cosine: Array
    clean: Mask


def fit_planes(points: Array, rng: np.random.Generator, config: WallConfig) -> Array:
    """(P, 4) walls (n, d), n towards the sensor, by RANSAC, the largest first.

    Only returns that a plane meets at less than ``incidence`` count for it: else the rings on
    walls all round would pass for level planes.
    """
    planes: list[Array] = []
    left = points
    while len(planes) < config.planes and len(left) >= config.least_points:
        plane = _refined(left, _best_plane(left, rng, config), config)
        inliers = _frontal(left, plane, config)
        if inliers.sum() < config.least_points:
            break
        planes.append(plane)
        left = left[np.abs(left @ plane[:3] + plane[3]) > config.tolerance]
    return np.array(planes).reshape(-1, 4)


def _best_plane(points: Array, rng: np.random.Generator, config: WallConfig) -> Array:
    """The plane through three near returns that most of a sample agree with."""
    sample = points[rng.choice(len(points), min(config.sample, len(points)), replace=False)]
    best, most = np.array([0.0, 0.0, 1.0, 0.0]), -1
    for corner in sample[rng.integers(len(sample), size=config.trials)]:
        near = sample[np.linalg.norm(sample - corner, axis=1) < config.reach]
        a, b = near[rng.integers(len(near), size=2)] - corner
        normal = np.cross(a, b)
        length = float(np.linalg.norm(normal))
        if length < 1e-3 or abs(normal[2]) > config.lean * length:
            continue
        plane = _facing(normal / length, corner)
        count = int(_frontal(sample, plane, config).sum())
        if count > most:
            best, most = plane, count
    return best


def _refined(points: Array, plane: Array, config: WallConfig) -> Array:
    """The plane of least squares through its own inliers, three times over."""
    for _ in range(3):
        inliers = points[_frontal(points, plane, config)]
        if len(inliers) < 3:
            return plane
        centre = inliers.mean(axis=0)
        spread = (inliers - centre).T @ (inliers - centre)
        better = _facing(np.linalg.eigh(spread)[1][:, 0], centre)
        if abs(better[2]) > config.lean:
            return plane
        plane = better
    return plane


def _facing(normal: Array, point: Array) -> Array:
    """(4,) n and d of the plane through ``point``, turned to the sensor (d >= 0)."""
    plane = np.append(normal, -normal @ point)
    return plane if plane[3] >= 0.0 else -plane


def _frontal(points: Array, plane: Array, config: WallConfig) -> Mask:
    near = np.abs(points @ plane[:3] + plane[3]) < config.tolerance
    return near & (plane[3] > config.incidence * np.linalg.norm(points, axis=1))


def fit_planes_and_offsets(
    shots: Shots, planes: Array, config: WallConfig
) -> tuple[Array, Array, Seen]:
    """Planes (P, 4), offsets (B,) and the shots against them, from planes that are about right;
    those that are not flat or have too few clean returns are given up. Raises InputError when none
    is left."""
    while len(planes):
        planes, offsets, seen = fit_offsets(shots, planes, config)
        good = np.array([_is_wall(seen, number, config) for number in range(len(planes))])
        if good.all():
            return planes, offsets, seen
        planes = planes[good]
    raise InputError("calibration: no wall found, expected a level sensor at rest between walls")


def _is_wall(seen: Seen, number: int, config: WallConfig) -> bool:
    residual = seen.residual[seen.clean & (seen.plane == number)]
    enough = len(residual) >= config.least_points
    return enough and float(np.median(np.abs(residual))) < config.flatness


def fit_offsets(shots: Shots, planes: Array, config: WallConfig) -> tuple[Array, Array, Seen]:
    """Upright planes (P, 4) and beam offsets (B,) [m] that explain the ranges together.

    By turns the planes are fitted to the corrected ranges, and the offsets to what is left, by
    median polish (Tukey 1977): what one beam met in one place is outvoted. Sensor and walls are
    taken as upright: planes free to lean would take up what beams are off, and did.
    """
    offsets = np.zeros(shots.ranges.shape[1])
    for _ in range(6):
        seen = on_planes(shots, planes, offsets, config)
        offsets = offsets + _polished(_medians(seen, len(planes), config.least_votes))
        offsets = np.clip(offsets, -config.tolerance, config.tolerance)
        seen = on_planes(shots, planes, offsets, config)
        planes = np.array([_refitted(shots, seen, *item) for item in enumerate(planes)])
    return planes, offsets, on_planes(shots, planes, offsets, config)


def _medians(seen: Seen, planes: int, least: int) -> Array:
    """(P, B) median residuals, NaN where a beam has fewer clean returns from a plane."""
    table = np.full((planes, seen.plane.shape[1]), np.nan)
    for (plane, ring), _ in np.ndenumerate(table):
        here = seen.clean[:, ring] & (seen.plane[:, ring] == plane)
        if here.sum() >= least:
            table[plane, ring] = np.median(seen.residual[here, ring])
    return table


def _polished(table: Array) -> Array:
    """(B,) column effects of a (P, B) table with gaps; their mean over known columns is 0."""
    rows, columns = np.zeros((len(table), 1)), np.zeros(table.shape[1])
    for _ in range(20):
        rows += _known_median(table - rows - columns, axis=1)[:, None]
        columns += _known_median(table - rows - columns, axis=0)
    known = np.isfinite(table).any(axis=0)
    return columns - columns[known].mean() * known if known.any() else columns


def _known_median(table: Array, axis: int) -> Array:
    """Medians of what is not NaN; 0 where there is nothing."""
    known = np.isfinite(table).any(axis=axis)
    filled = np.where(np.expand_dims(known, axis), table, 0.0)
    return np.asarray(np.nanmedian(filled, axis=axis))


def _refitted(shots: Shots, seen: Seen, number: int, plane: Array) -> Array:
    """An upright plane, moved to its clean returns (Gauss-Newton, Tukey's biweight)."""
    use = seen.clean & (seen.plane == number)
    if use.sum() < 3:
        return plane
    residual, cosine = seen.residual[use], seen.cosine[use]
    level = shots.ranges[use][:, None] * shots.directions[use][:, :2]
    across = plane[0] * level[:, 1] - plane[1] * level[:, 0]
    weight = np.maximum(1.0 - (residual / 0.06) ** 2, 0.0) ** 2
    slopes = np.column_stack([across, np.ones(len(across))]) / cosine[:, None]
    matrix = (weight[:, None] * slopes).T @ slopes
    turn, shift = np.linalg.solve(matrix, (weight[:, None] * slopes).T @ residual)
    heading = np.arctan2(plane[1], plane[0]) + turn
    return np.array([np.cos(heading), np.sin(heading), 0.0, plane[3] + shift])


def on_planes(shots: Shots, planes: Array, offsets: Array, config: WallConfig) -> Seen:
    """Each return is given to the nearest plane within the tolerance."""
    shape = shots.ranges.shape
    which, residual = np.full(shape, -1), np.full(shape, np.nan)
    cosines, nearest = np.zeros(shape), np.full(shape, config.tolerance)
    for number, plane in enumerate(planes):
        cosine = -(shots.directions @ plane[:3])
        ahead = shots.returned & (cosine > 0.05)
        height = shots.heights * plane[2] + plane[3]
        off = shots.ranges - offsets - height / np.where(ahead, cosine, 1.0)
        here = ahead & (np.abs(off) * cosine < nearest)
        nearest[here] = (np.abs(off) * cosine)[here]
        which[here], residual[here], cosines[here] = number, off[here], cosine[here]
    clean = (which >= 0) & (cosines > config.incidence) & _pure(shots, which, config)
    return Seen(which, residual, cosines, clean)


def _pure(shots: Shots, which: IntArray, config: WallConfig) -> Mask:
    """(F, B) whether a shot's patch returned from its plane and from hardly anything else."""
    patches = round(2.0 * np.pi / config.patch)
    patch = shots.cells(config.patch) * shots.ranges.shape[1] + np.arange(shots.ranges.shape[1])
    size = patches * shots.ranges.shape[1] + shots.ranges.shape[1]
    all_returns = np.bincount(patch[shots.returned], minlength=size)
    pure = np.zeros(which.shape, dtype=bool)
    for number in range(which.max() + 1):
        here = which == number
        share = np.bincount(patch[here], minlength=size) / np.maximum(all_returns, 1)
        pure |= here & (share[patch] >= config.purity)
    return pure
