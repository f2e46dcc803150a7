"""Plane extraction from one sweep of a spinning multi-beam LiDAR.

Walls: the returns of one beam on a plane lie on a straight run, whose direction in plan view is
known to a fraction of a degree from a few decimetres of it, while neighbouring beams are too far
apart (and too differently offset) for local normals. So each beam is cut into straight runs, the
runs that lie on one plane are gathered, and the plane is fitted to all of them at once, as a mixed
model: every run has its own range offset beside the noise of its points. Floor and ceiling: the
returns whose neighbour in the next beam is level with them, fitted robustly.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from slam.core import Array, IntArray, PlaneObservation, plane_axes


@dataclass(frozen=True)
class ExtractionConfig:
    """Metres and radians. Sensor figures are those of a VLP-16 (range noise 1-2 cm in a beam).

    window: length of run over which a beam's local direction is fitted; straight: largest RMS
    residual of a straight run; min_run: shortest run; gap: a jump that ends a run;
    angle, distance: a run belongs to a plane when its direction and its distance are within these;
    spread: RMS distance of the runs of one plane; with more, it is two walls one behind the other;
    reach: largest hole between runs of one plane (a door is 1 m); min_points, min_length: smallest
    plane; point_sigma, beam_sigma: noise of a point and of a run's common offset; plumb_sigma: weak
    prior on a wall's tilt, so that a wall seen by one beam only does not topple, and
    level_sigma on a floor's; motion_sigma: of
    what the motion within the sweep leaves of a ray's direction; floor_distance:
    half thickness of what is taken off as floor, and floor_width of what it is fitted to, since the
    feet of the walls stand on one side of it only; thin: voxel of the sample of points kept.
    """

    window: float = 0.4
    straight: float = 0.017
    min_run: float = 0.2
    min_run_points: int = 8
    gap: float = 0.25
    angle: float = np.radians(1.2)
    distance: float = 0.055
    spread: float = 0.02
    reach: float = 1.2
    min_points: int = 60
    min_length: float = 0.35
    point_sigma: float = 0.015
    beam_sigma: float = 0.015
    plumb_sigma: float = np.radians(1.0)
    level_sigma: float = np.radians(2.0)
    motion_sigma: float = 0.002
    floor_distance: float = 0.06
    floor_width: float = 0.025
    floor_min_beam: int = 40
    floor_min_points: int = 200
    max_range: float = 25.0
    thin: float = 0.05


def extract_planes(
    points: Array, ring: NDArray[np.int16], origin: Array, config: ExtractionConfig
) -> tuple[PlaneObservation, ...]:
    """Planes in a deskewed sweep.

    points: (N, 3) base frame, z roughly up; ring: (N,) beam; origin: (3,) the sensor in that frame.
    """
    relative = points - origin
    reach = np.hypot(relative[:, 0], relative[:, 1])
    use = np.isfinite(points).all(axis=1) & (reach < config.max_range) & (reach > 1e-6)
    order = np.flatnonzero(use)
    azimuth = np.arctan2(relative[:, 1], relative[:, 0])
    order = order[np.lexsort((azimuth[order], ring[order]))]
    if len(order) < config.min_points:
        return ()
    level, planes = _level_planes(points, ring, azimuth, origin, order, config)
    upright = order[~level[order]]
    return (*planes, *_upright_planes(points, ring, origin, upright, config))


# --- floor and ceiling ---------------------------------------------------------------------------

COLUMNS = 900


def _level_planes(
    points: Array,
    ring: NDArray[np.int16],
    azimuth: Array,
    origin: Array,
    order: IntArray,
    config: ExtractionConfig,
) -> tuple[NDArray[np.bool_], list[PlaneObservation]]:
    """Mask (N,) of the returns on the floor and the ceiling, and the two planes where found."""
    flat = _level_neighbours(points, ring, azimuth, order)
    mask = np.zeros(len(points), dtype=bool)
    planes = []
    for sign in (1.0, -1.0):  # the floor, then the ceiling upside down
        depth = sign * (points[:, 2] - origin[2])
        candidates = np.flatnonzero(flat & (depth < -0.15))
        if len(candidates) < config.floor_min_points:
            continue
        design = np.column_stack([points[:, :2] - origin[:2], np.ones(len(points))])
        off = depth - design @ _fit_level(design[candidates], depth[candidates], config)
        inliers = _floor_inliers(
            candidates[np.abs(off[candidates]) < config.floor_width], ring, config
        )
        beyond = np.count_nonzero(off[order] < -3.0 * config.floor_distance)
        if len(inliers) < config.floor_min_points or beyond > 0.1 * len(inliers):
            continue
        mask |= (np.abs(off) < config.floor_distance) & (depth < 0.0)
        planes.append(_level_observation(points, ring, inliers, origin, config))
    return mask, planes


def _floor_inliers(
    inliers: IntArray, ring: NDArray[np.int16], config: ExtractionConfig
) -> IntArray:
    """Without the beams that only graze the floor where it meets a wall."""
    return inliers[np.bincount(ring[inliers])[ring[inliers]] >= config.floor_min_beam]


def _level_neighbours(
    points: Array, ring: NDArray[np.int16], azimuth: Array, order: IntArray
) -> NDArray[np.bool_]:
    """(N,) True where the line to the next beam's return is level and neither of its
    neighbours stands above or below it, as on a wall."""
    rings = int(ring.max()) + 1
    table = np.full((rings, COLUMNS), -1, dtype=np.int64)
    column = ((azimuth[order] + np.pi) * (COLUMNS / (2 * np.pi))).astype(np.int64) % COLUMNS
    table[ring[order], column] = order
    low, high = table[:-1], table[1:]
    pairs = (low >= 0) & (high >= 0)
    a, b = low[pairs], high[pairs]
    step = points[b] - points[a]
    rise, run = np.abs(step[:, 2]), np.hypot(step[:, 0], step[:, 1])
    is_flat = (rise < 0.04 + 0.01 * run) & (rise < np.tan(np.radians(30.0)) * run)
    is_steep = rise > np.tan(np.radians(60.0)) * run
    flat = np.zeros(len(points), dtype=bool)
    flat[a[is_flat]] = True
    flat[b[is_flat]] = True
    flat[a[is_steep]] = False
    flat[b[is_steep]] = False
    return flat


def _fit_level(design: Array, depth: Array, config: ExtractionConfig) -> Array:
    """depth = a x + b y + c of the lowest level that many share, outliers let go bit by bit.

    design: (N, 3) rows x, y, 1. The base stands on its floor: slopes are held near zero.
    """
    plane = np.array([0.0, 0.0, _lowest_level(depth)])
    ridge = np.diag([20.0, 20.0, 1e-6])
    for width in (0.15, 0.10, 0.06, config.floor_width, config.floor_width):
        near = np.abs(depth - design @ plane) < width
        A = design[near]
        plane = np.linalg.solve(A.T @ A + ridge, A.T @ depth[near])
    return plane


def _lowest_level(depth: Array) -> float:
    """The lowest height that a good part of the values shares, to 5 cm."""
    bins = np.round(depth / 0.05).astype(np.int64)
    counts = np.convolve(np.bincount(bins - bins.min()), [1, 2, 1], mode="same")
    return float((np.flatnonzero(counts > 0.4 * counts.max())[0] + 1 + bins.min()) * 0.05)


def _level_observation(
    points: Array,
    ring: NDArray[np.int16],
    inliers: IntArray,
    origin: Array,
    config: ExtractionConfig,
) -> PlaneObservation:
    xyz = points[inliers]
    up = 1.0 if origin[2] > xyz[:, 2].mean() else -1.0
    frame = np.diag([1.0, up, up])
    level = np.full(2, config.level_sigma**-2.0)
    normal, centroid, covariance = _fit_plane(xyz, ring[inliers], frame, origin, config, level)
    keep = _thin(xyz, frame[0], frame[1], 2.0 * config.thin)
    return PlaneObservation(
        normal=normal,
        d=float(-normal @ centroid),
        centroid=centroid,
        covariance=covariance,
        points=xyz[keep],
        point_index=inliers[keep],
    )


# --- the fit -------------------------------------------------------------------------------------


def _fit_plane(
    xyz: Array,
    ring: NDArray[np.int16],
    frame: Array,
    origin: Array,
    config: ExtractionConfig,
    upright: Array,
) -> tuple[Array, Array, Array]:
    """Normal, centroid and covariance of a plane through points (N, 3), as a mixed model.

    frame: rows u, v, w with w near the normal; the plane is w = w0 + a u + b v. What is noisy
    is the range: every point has its own error, and every beam one that its points share. So
    residuals are taken along the rays, with a random intercept per beam. upright: (2,) information
    of the priors on a and b [1/rad^2].
    """
    base = xyz.mean(axis=0)
    local = (xyz - base) @ frame.T
    rays = xyz - origin
    reach = np.linalg.norm(rays, axis=1)
    blur = reach * config.motion_sigma / config.point_sigma
    along = np.hypot(rays @ frame[2] / reach, blur)
    design = np.column_stack([local[:, :2], np.ones(len(xyz))]) / along[:, None]
    target = local[:, 2] / along
    _, member = np.unique(ring, return_inverse=True)
    count = np.bincount(member).astype(np.float64)
    sums = np.stack([np.bincount(member, weights=column) for column in design.T], axis=1)
    shared = config.beam_sigma**2 / (config.point_sigma**2 + count * config.beam_sigma**2)
    weight = 1.0 / config.point_sigma**2
    information = weight * (design.T @ design - (sums * shared[:, None]).T @ sums)
    right = weight * (design.T @ target - sums.T @ (shared * np.bincount(member, weights=target)))
    information[:2, :2] += np.diag(upright)
    information += 1e-6 * np.eye(3)
    a, b, w0 = np.linalg.solve(information, right)
    normal = np.array([-a, -b, 1.0]) @ frame
    covariance = np.linalg.inv(information)
    return normal / np.linalg.norm(normal), base + w0 * frame[2], _covariance(covariance)


def _covariance(covariance: Array) -> Array:
    """Adds what no count of points averages away: 6 mm of offset, 0.1 degrees of direction, most
    of it what is left of the motion within the sweep."""
    floor = np.diag([np.radians(0.1) ** 2, np.radians(0.1) ** 2, 0.006**2])
    return covariance + floor


# --- walls ---------------------------------------------------------------------------------------


@dataclass(frozen=True)
class _Runs:
    """Straight stretches of single beams. Arrays over R; start, stop index the sorted points."""

    start: IntArray
    stop: IntArray
    count: Array
    mean: Array  # (R, 3)
    scatter: Array  # (R, 3, 3) sum of squared deviations
    direction: Array  # (R, 2) unit, along the run
    ends: Array  # (R, 2, 2)
    length: Array


def _upright_planes(
    points: Array,
    ring: NDArray[np.int16],
    origin: Array,
    order: IntArray,
    config: ExtractionConfig,
) -> list[PlaneObservation]:
    if len(order) < config.min_points:
        return []
    xyz = points[order]
    moments = _Moments(xyz - origin)
    segment_start, segment_stop = _continuous(xyz, ring[order], config)
    straight, normal_angle = _local_lines(xyz, origin, moments, segment_start, segment_stop, config)
    starts, stops = _straight_runs(straight, normal_angle, segment_start, config)
    runs = _describe(xyz, origin, moments, starts, stops, config)
    observations = []
    for members in _gather(runs, origin, config):
        observation = _fit_wall(xyz, ring[order], order, runs, members, origin, config)
        if observation is not None:
            observations.append(observation)
    return observations


class _Moments:
    """Running sums of the points and of their products: moments of any stretch in O(1)."""

    def __init__(self, xyz: Array):
        products = xyz[:, :, None] * xyz[:, None, :]
        stacked = np.concatenate([xyz, products.reshape(-1, 9)], axis=1)
        self._sums = np.concatenate([np.zeros((1, 12)), np.cumsum(stacked, axis=0)])

    def between(self, start: IntArray, stop: IntArray) -> tuple[Array, Array, Array]:
        """Counts (R,), means (R, 3) and scatter matrices (R, 3, 3) of points[start:stop]."""
        count = (stop - start).astype(np.float64)
        sums = self._sums[stop] - self._sums[start]
        mean = sums[:, :3] / count[:, None]
        scatter = sums[:, 3:].reshape(-1, 3, 3) - count[:, None, None] * (
            mean[:, :, None] * mean[:, None, :]
        )
        return count, mean, scatter


def _continuous(
    xyz: Array, ring: NDArray[np.int16], config: ExtractionConfig
) -> tuple[IntArray, IntArray]:
    """For each point, where the unbroken stretch of its beam starts and stops."""
    step = np.hypot(*(xyz[1:, :2] - xyz[:-1, :2]).T)
    cut = np.flatnonzero((ring[1:] != ring[:-1]) | (step > config.gap)) + 1
    bounds = np.concatenate([[0], cut, [len(xyz)]])
    piece = np.repeat(np.arange(len(bounds) - 1), np.diff(bounds))
    return bounds[piece], bounds[piece + 1]


def _local_lines(
    xyz: Array,
    origin: Array,
    moments: _Moments,
    segment_start: IntArray,
    segment_stop: IntArray,
    config: ExtractionConfig,
) -> tuple[NDArray[np.bool_], Array]:
    """Is the neighbourhood straight, and the direction (mod pi) of its line in plan view."""
    reach = np.hypot(*(xyz[:, :2] - origin[:2]).T)
    spacing = np.maximum(reach * 0.0042, 0.004)
    half = np.clip((0.5 * config.window / spacing).astype(np.int64), 4, 40)
    index = np.arange(len(xyz))
    start = np.maximum(index - half, segment_start)
    stop = np.minimum(index + half + 1, segment_stop)
    count, _, scatter = moments.between(start, stop)
    small, large, angle = _line_of(scatter[:, :2, :2])
    residual = np.sqrt(np.maximum(small, 0.0) / count)
    straight = (count >= 5) & (residual < config.straight) & (large > 16.0 * small)
    return straight, angle


def _line_of(scatter: Array) -> tuple[Array, Array, Array]:
    """Smaller and larger eigenvalue of (N, 2, 2), and the angle of the larger one's direction."""
    a, b, c = scatter[:, 0, 0], scatter[:, 0, 1], scatter[:, 1, 1]
    middle = 0.5 * (a + c)
    spread = np.sqrt((0.5 * (a - c)) ** 2 + b * b)
    return middle - spread, middle + spread, 0.5 * np.arctan2(2.0 * b, a - c)


def _straight_runs(
    straight: NDArray[np.bool_], angle: Array, segment_start: IntArray, config: ExtractionConfig
) -> tuple[IntArray, IntArray]:
    """Where runs of straight points of like direction start and stop."""
    turn = np.abs(np.angle(np.exp(2j * (angle[1:] - angle[:-1])))) / 2.0
    new = np.ones(len(straight), dtype=bool)
    new[1:] = (
        (segment_start[1:] != segment_start[:-1])
        | (straight[1:] != straight[:-1])
        | (turn > np.radians(8.0))
    )
    starts = np.flatnonzero(new)
    stops = np.append(starts[1:], len(straight))
    keep = straight[starts] & (stops - starts >= config.min_run_points)
    return starts[keep], stops[keep]


def _describe(
    xyz: Array,
    origin: Array,
    moments: _Moments,
    starts: IntArray,
    stops: IntArray,
    config: ExtractionConfig,
) -> _Runs:
    """Runs that are straight as a whole; a bent one is halved twice before it is given up."""
    kept_starts, kept_stops = [], []
    for _ in range(3):
        count, _, scatter = moments.between(starts, stops)
        small, _, _ = _line_of(scatter[:, :2, :2])
        good = np.sqrt(np.maximum(small, 0.0) / count) < config.straight
        kept_starts.append(starts[good])
        kept_stops.append(stops[good])
        middle = (starts[~good] + stops[~good]) // 2
        starts, stops = (
            np.concatenate([starts[~good], middle]),
            np.concatenate([middle, stops[~good]]),
        )
        long_enough = stops - starts >= config.min_run_points
        starts, stops = starts[long_enough], stops[long_enough]
    starts, stops = np.concatenate(kept_starts), np.concatenate(kept_stops)
    count, mean, scatter = moments.between(starts, stops)
    _, _, angle = _line_of(scatter[:, :2, :2])
    mean = mean + origin
    direction = np.column_stack([np.cos(angle), np.sin(angle)])
    first = np.einsum("ri,ri->r", xyz[starts, :2] - mean[:, :2], direction)
    last = np.einsum("ri,ri->r", xyz[stops - 1, :2] - mean[:, :2], direction)
    span = np.sort(np.column_stack([first, last]), axis=1)
    ends = mean[:, None, :2] + span[:, :, None] * direction[:, None, :]
    length = span[:, 1] - span[:, 0]
    keep = length >= config.min_run
    return _Runs(
        starts[keep],
        stops[keep],
        count[keep],
        mean[keep],
        scatter[keep],
        direction[keep],
        ends[keep],
        length[keep],
    )


def _gather(runs: _Runs, origin: Array, config: ExtractionConfig) -> list[IntArray]:
    """Groups of runs that lie on one plane: the longest run first, each run in one group."""
    normal = np.column_stack([-runs.direction[:, 1], runs.direction[:, 0]])
    facing = np.einsum("ri,ri->r", normal, origin[:2] - runs.mean[:, :2])
    normal = np.where(facing[:, None] < 0.0, -normal, normal)
    free = np.ones(len(runs.length), dtype=bool)
    groups = []
    for seed in np.argsort(-runs.length):
        if not free[seed]:
            continue
        members = np.array([seed])
        for _ in range(4):
            n, c = _line_through(runs, members, origin)
            axis = np.array([-n[1], n[0]])
            fits = free & (normal @ n > np.cos(config.angle + 0.015 / runs.length))
            off = np.abs((runs.ends - c) @ n).max(axis=1)
            fits &= off < config.distance
            fits[seed] = True
            candidates = np.flatnonzero(fits)
            spans = np.sort((runs.ends[candidates] - c) @ axis, axis=1)
            connected = _connected(spans, int(np.flatnonzero(candidates == seed)[0]), config.reach)
            grown = candidates[connected]
            if np.array_equal(grown, members):
                break
            members = grown
        members = _of_one_plane(runs, members, seed, origin, config)
        free[members] = False
        groups.append(members)
    return groups


def _of_one_plane(
    runs: _Runs, members: IntArray, seed: int, origin: Array, config: ExtractionConfig
) -> IntArray:
    """The group, or of two walls that a slanting line took together that of the longest run."""
    n, c = _line_through(runs, members, origin)
    off = (runs.mean[members, :2] - c) @ n
    if np.sqrt(np.average(off**2, weights=runs.count[members])) < config.spread:
        return members
    n, c = _line_through(runs, np.array([seed]), origin)
    off = np.abs((runs.ends[members] - c) @ n).max(axis=1)
    return members[off < 0.5 * config.distance]


def _line_through(runs: _Runs, members: IntArray, origin: Array) -> tuple[Array, Array]:
    """Normal towards the sensor and a point of the line in plan view through several runs."""
    weight = runs.count[members]
    c = (weight @ runs.mean[members, :2]) / weight.sum()
    off = runs.mean[members, :2] - c
    scatter = runs.scatter[members, :2, :2].sum(axis=0) + (off * weight[:, None]).T @ off
    _, _, angle = _line_of(scatter[None])
    n = np.array([-np.sin(angle[0]), np.cos(angle[0])])
    return (n if n @ (origin[:2] - c) > 0.0 else -n), c


def _connected(spans: Array, seed: int, reach: float) -> NDArray[np.bool_]:
    """Which intervals (C, 2) hang together with the seed's across holes up to ``reach``."""
    order = np.argsort(spans[:, 0])
    top = np.maximum.accumulate(spans[order, 1])
    breaks = np.concatenate([[0], np.cumsum(spans[order[1:], 0] > top[:-1] + reach)])
    island = np.empty(len(spans), dtype=np.int64)
    island[order] = breaks
    return island == island[seed]


def _fit_wall(
    xyz: Array,
    ring: NDArray[np.int16],
    order: IntArray,
    runs: _Runs,
    members: IntArray,
    origin: Array,
    config: ExtractionConfig,
) -> PlaneObservation | None:
    """The plane through a group of runs; None where it is too small."""
    if runs.count[members].sum() < config.min_points:
        return None
    n2, c2 = _line_through(runs, members, origin)
    frame = np.array([[-n2[1], n2[0], 0.0], [0.0, 0.0, 1.0], [n2[0], n2[1], 0.0]])
    if np.ptp((runs.ends[members] - c2) @ frame[0, :2]) < config.min_length:
        return None
    places = np.concatenate([np.arange(runs.start[m], runs.stop[m]) for m in members])
    upright = np.array([0.0, config.plumb_sigma**-2.0])
    normal, centroid, covariance = _fit_plane(
        xyz[places], ring[places], frame, origin, config, upright
    )
    off = (xyz[places] - centroid) @ normal
    places = places[np.abs(off) < 3.0 * config.straight + config.beam_sigma]
    if len(places) < config.min_points:
        return None
    keep = places[_thin(xyz[places], *plane_axes(normal), config.thin)]
    return PlaneObservation(
        normal=normal,
        d=float(-normal @ centroid),
        centroid=centroid,
        covariance=covariance,
        points=xyz[keep],
        point_index=order[keep],
    )


def _thin(xyz: Array, level: Array, up: Array, voxel: float) -> IntArray:
    """Places of one point per cell of a grid laid on the plane."""
    u = np.floor((xyz @ level) / voxel).astype(np.int64)
    v = np.floor((xyz @ up) / voxel).astype(np.int64)
    _, first = np.unique((u - u.min()) * (1 << 24) + (v - v.min()), return_index=True)
    return np.sort(first)
