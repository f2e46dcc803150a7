"""A box room scanned by a closed form: exact planes for the tests, no simulator."""

from __future__ import annotations

import numpy as np

from slam.core import Array, Scan, inverse, pose, so3_exp, transform_plane

ELEVATIONS = np.radians(np.arange(-15.0, 16.0, 2.0))
LIDAR_HEIGHT = 0.5


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
    T_base_lidar = pose(np.eye(3), np.array([0.0, 0.0, LIDAR_HEIGHT]))
    T_world_lidar = T_world_base @ T_base_lidar
    azimuth = np.linspace(-np.pi, np.pi, columns, endpoint=False)
    az, el = np.meshgrid(azimuth, ELEVATIONS, indexing="ij")
    ring = np.broadcast_to(np.arange(16, dtype=np.int16), az.shape).ravel()
    rays = np.stack([np.cos(el) * np.cos(az), np.cos(el) * np.sin(az), np.sin(el)], axis=-1)
    rays = rays.reshape(-1, 3)
    ranges = np.full(len(rays), np.inf)
    for normal, d in planes:
        n, offset = transform_plane(inverse(T_world_lidar), normal, d)
        with np.errstate(divide="ignore"):
            hit = -offset / (rays @ n)
        ranges = np.minimum(ranges, np.where(hit > 0.0, hit, np.inf))
    if rng is not None:
        offsets = rng.normal(0.0, 0.012, 16)
        ranges = ranges + rng.normal(0.0, noise, len(ranges)) + offsets[ring]
    times = np.repeat(np.linspace(-0.1, 0.0, columns), 16)
    points = rays * ranges[:, None]
    intensity = np.full(len(points), 0.5)
    return Scan(index, 0.1 * (index + 1), points, times, ring, intensity, T_base_lidar)


def in_base(scan: Scan) -> Array:
    """The scan's points (N, 3) in the base frame, where the base stood still."""
    return scan.points + scan.T_base_lidar[:3, 3]
