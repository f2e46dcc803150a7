"""A box room scanned by a closed form: exact planes for the tests, no simulator."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from slam.core import Array, Scan, inverse, pose, so3_exp, transform_plane

ELEVATIONS = np.radians(np.arange(-15.0, 16.0, 2.0))
T_BASE_LIDAR = pose(np.eye(3), np.array([0.0, 0.0, 0.5]))


def box_planes(width: float, depth: float, height: float) -> list[tuple[Array, float]]:
    """Six inward planes (normal, d) of a box from (0, 0, 0) to (width, depth, height)."""
    return [
        (np.array([1.0, 0.0, 0.0]), 0.0),
        (np.array([-1.0, 0.0, 0.0]), width),
        (np.array([0.0, 1.0, 0.0]), 0.0),
        (np.array([0.0, -1.0, 0.0]), depth),
        (np.array([0.0, 0.0, 1.0]), 0.0),
        (np.array([0.0, 0.0, -1.0]), height),
    ]


def base_pose(x: float, y: float, yaw: float, tilt: tuple[float, float] = (0.0, 0.0)) -> Array:
    """T_world_base of a base on the floor."""
    turn = so3_exp(np.array([0.0, 0.0, yaw])) @ so3_exp(np.array([*tilt, 0.0]))
    return pose(turn, np.array([x, y, 0.0]))


def scan_box(
    planes: list[tuple[Array, float]],
    T_world_base: Array,
    rng: np.random.Generator | None = None,
    index: int = 0,
    noise: float = 0.012,
    columns: int = 1800,
) -> Scan:
    """A sweep from a standing base; with an rng: noise in the beams and an offset of each beam."""
    rays = _rays(columns)
    ranges = np.full(len(rays), np.inf)
    for normal, d in planes:
        n, offset = transform_plane(inverse(T_world_base @ T_BASE_LIDAR), normal, d)
        with np.errstate(divide="ignore"):
            hit = -offset / (rays @ n)
        ranges = np.minimum(ranges, np.where(hit > 0.0, hit, np.inf))
    return _measured(rays, ranges, index, rng, noise)


def scan_walls(
    walls: list[tuple[tuple[float, float], tuple[float, float]]],
    T_world_base: Array,
    rng: np.random.Generator | None = None,
    noise: float = 0.0066,
) -> tuple[Scan, NDArray[np.int64]]:
    """A sweep of upright walls, each from one place in plan view to another, on an endless floor;
    and which wall each return is from (the floor: -1)."""
    rays = _rays(1800)
    T_world_lidar = T_world_base @ T_BASE_LIDAR
    world, origin = rays @ T_world_lidar[:3, :3].T, T_world_lidar[:3, 3]
    with np.errstate(divide="ignore"):
        ranges = np.where(world[:, 2] < 0.0, -origin[2] / world[:, 2], np.inf)
    wall_of = np.full(len(rays), -1)
    for wall, ends in enumerate(walls):
        start, run = np.array(ends[0]), np.subtract(ends[1], ends[0])
        across = np.array([-run[1], run[0]])
        with np.errstate(divide="ignore", invalid="ignore"):
            hit = ((start - origin[:2]) @ across) / (world[:, :2] @ across)
            share = ((origin[:2] + hit[:, None] * world[:, :2] - start) @ run) / (run @ run)
        nearer = (hit > 0.0) & (share >= 0.0) & (share <= 1.0) & (hit < ranges)
        ranges[nearer], wall_of[nearer] = hit[nearer], wall
    return _measured(rays, ranges, 0, rng, noise), wall_of


def _rays(columns: int) -> Array:
    """(16 columns, 3) unit directions, lidar frame, column after column."""
    azimuth = np.linspace(-np.pi, np.pi, columns, endpoint=False)
    az, el = np.meshgrid(azimuth, ELEVATIONS, indexing="ij")
    rays = np.stack([np.cos(el) * np.cos(az), np.cos(el) * np.sin(az), np.sin(el)], axis=-1)
    return rays.reshape(-1, 3)


def _measured(
    rays: Array, ranges: Array, index: int, rng: np.random.Generator | None, noise: float
) -> Scan:
    """The scan of true ranges (N,); a ray that meets nothing is no number."""
    ring = np.tile(np.arange(16, dtype=np.int16), len(rays) // 16)
    if rng is not None:
        offsets = rng.normal(0.0, 0.012, 16)
        ranges = ranges + rng.normal(0.0, noise, len(ranges)) + offsets[ring]
    times = np.repeat(np.linspace(-0.1, 0.0, len(rays) // 16), 16)
    points = rays * np.where(np.isfinite(ranges), ranges, np.nan)[:, None]
    intensity = np.full(len(points), 0.5)
    return Scan(index, 0.1 * (index + 1), points, times, ring, intensity, T_BASE_LIDAR)


def in_base(scan: Scan) -> Array:
    """The scan's points (N, 3) in the base frame, where the base stood still."""
    return scan.points + scan.T_base_lidar[:3, 3]
