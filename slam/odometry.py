"""LiDAR odometry behind one small interface: KISS-ICP with an indoor preset."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from slam.core import (
    Array,
    RunError,
    Scan,
    inverse,
    orthonormal,
    rotate,
    so3_log,
    thread_limit,
    transform_points,
)

Stamped = tuple[float, Array]
"""The end of a sweep [s], and T_odom_base (4, 4) then."""


@dataclass(frozen=True)
class KissConfig:
    """KISS-ICP for rooms instead of streets.

    voxel_size [m]: of the local map; the library's default is a hundredth of the range. max_range
    [m]: rooms end earlier. min_range [m]: returns from the robot itself. threads: for registration.
    """

    voxel_size: float = 0.4
    max_range: float = 30.0
    min_range: float = 0.3
    initial_threshold: float = 0.5
    threads: int = field(default_factory=lambda: thread_limit(2))


@dataclass(frozen=True)
class MotionLimits:
    """What no indoor base does between two sweeps; beyond it the odometry has lost track.

    speed [m/s] and turning rate [rad/s]: several times those of any base that drives in rooms.
    """

    speed: float = 5.0
    turning_rate: float = 6.0


class KissOdometry:
    """KISS-ICP (Vizzo et al., 2023). Its pose is the sensor's at the END of the sweep."""

    def __init__(self, config: KissConfig = KissConfig(), limits: MotionLimits = MotionLimits()):
        from kiss_icp.config import KISSConfig
        from kiss_icp.kiss_icp import KissICP

        settings = KISSConfig()
        settings.data.max_range = config.max_range
        settings.data.min_range = config.min_range
        settings.mapping.voxel_size = config.voxel_size
        settings.adaptive_threshold.initial_threshold = config.initial_threshold
        settings.registration.max_num_threads = config.threads
        self._kiss = KissICP(settings)
        self._limits = limits
        self._last: Stamped | None = None

    def register(self, scan: Scan) -> Array:
        """T_odom_base (4, 4) at the sweep's end; odom is the base at the first sweep's end."""
        self._kiss.register_frame(
            np.ascontiguousarray(scan.points, dtype=np.float64), _stamps(scan)
        )
        T_base_lidar = scan.T_base_lidar
        T_odom_base = orthonormal(T_base_lidar @ self._kiss.last_pose @ inverse(T_base_lidar))
        # KISS-ICP differs in its last digits from run to run; nothing after it needs to.
        T_odom_base = np.round(T_odom_base, 9)
        check_motion(self._last, (scan.stamp, T_odom_base), self._limits)
        self._last = (scan.stamp, T_odom_base)
        return T_odom_base


def _stamps(scan: Scan) -> Array:
    """Per-point stamps, or none at all: KISS-ICP aborts the process when all of them are equal."""
    spread = len(scan) > 1 and float(np.ptp(scan.times)) > 0.0
    return np.ascontiguousarray(scan.times) if spread else np.empty(0)


def check_motion(last: Stamped | None, now: Stamped, limits: MotionLimits) -> None:
    """Raise RunError when the motion between two (stamp, pose) is none that a base can make."""
    if not np.isfinite(now[1]).all():
        raise RunError(f"the odometry diverged at t = {now[0]:.1f} s: the pose is not finite")
    if last is None:
        return
    seconds = max(now[0] - last[0], 1e-3)
    step = inverse(last[1]) @ now[1]
    speed = float(np.linalg.norm(step[:3, 3])) / seconds
    rate = float(np.linalg.norm(so3_log(step[:3, :3]))) / seconds
    if speed > limits.speed or rate > limits.turning_rate:
        raise RunError(
            f"the odometry diverged at t = {now[0]:.1f} s: {speed:.1f} m/s and {rate:.1f} rad/s"
            " between two sweeps"
        )


def deskew(scan: Scan, ends: Sequence[Stamped]) -> Array:
    """The scan's points (N, 3) in the base frame at the sweep's end.

    ends: where the base was at the ends of the last sweep and of this one, between which it moved
    at constant rates; this one alone: it stood.
    """
    points_base = scan.points @ scan.T_base_lidar[:3, :3].T + scan.T_base_lidar[:3, 3]
    if len(ends) < 2:
        return points_base
    (stamp_last, T_last), (stamp, T_now) = ends[-2:]
    T_last_now = inverse(T_last) @ T_now
    elapsed = (1.0 + scan.times / (stamp - stamp_last))[:, None]
    way = elapsed * _twist(T_last_now)
    moved = rotate(way[:, :3], points_base) + way[:, 3:]
    return transform_points(inverse(T_last_now), moved)


def _twist(T_a_b: Array) -> Array:
    """(6,) rotation vector and translation."""
    return np.append(so3_log(T_a_b[:3, :3]), T_a_b[:3, 3])


@dataclass(frozen=True)
class VgicpConfig:
    """Scan-to-model voxelised GICP (small_gicp).

    leaf [m]: scans are thinned to it; voxel [m]: of the Gaussian map; reach [m]: largest
    correspondence; max_range, min_range [m]: of the returns used; every: one in so many returns;
    horizon: scans after which an unseen voxel is dropped; threads.
    """

    leaf: float = 0.1
    voxel: float = 0.5
    max_range: float = 30.0
    min_range: float = 0.3
    every: int = 2
    horizon: int = 1000
    threads: int = field(default_factory=lambda: thread_limit(2))


class VgicpOdometry:
    """Voxelised GICP against the map so far (Koide et al., 2021), constant-velocity prediction.

    Distribution-to-distribution residuals are blind along a surface, so unlike point-to-point ones
    they do not hold on to rings that travel with the sensor.
    """

    def __init__(self, config: VgicpConfig = VgicpConfig(), limits: MotionLimits = MotionLimits()):
        import small_gicp

        self._gicp = small_gicp
        self._config = config
        self._limits = limits
        self._map = small_gicp.GaussianVoxelMap(config.voxel)
        self._map.set_lru(horizon=config.horizon, clear_cycle=10)
        self._last: Stamped | None = None
        self._step = np.eye(4)

    def register(self, scan: Scan) -> Array:
        """T_odom_base (4, 4) at the sweep's end; odom is the base at the first sweep's end."""
        predicted = np.eye(4) if self._last is None else self._last[1] @ self._step
        source = self._thinned(scan, predicted)
        T_odom_base = predicted
        if self._last is not None:
            result = self._gicp.align(
                self._map, source, init_T_target_source=predicted, num_threads=self._config.threads
            )
            T_odom_base = orthonormal(np.array(result.T_target_source))
            check_motion(self._last, (scan.stamp, T_odom_base), self._limits)
            self._step = inverse(self._last[1]) @ T_odom_base
        self._map.insert(source, T_odom_base)
        self._last = (scan.stamp, T_odom_base)
        return T_odom_base

    def _thinned(self, scan: Scan, predicted: Array) -> object:
        """The scan deskewed by the predicted motion, base frame, with covariances."""
        reach = np.linalg.norm(scan.points, axis=1)
        use = np.flatnonzero((reach > self._config.min_range) & (reach < self._config.max_range))
        use = use[:: self._config.every]
        part = Scan(
            scan.index,
            scan.stamp,
            scan.points[use],
            scan.times[use],
            scan.ring[use],
            scan.intensity[use],
            scan.T_base_lidar,
        )
        ends = [self._last, (scan.stamp, predicted)] if self._last else []
        points = deskew(part, ends)
        cloud, _ = self._gicp.preprocess_points(
            points, downsampling_resolution=self._config.leaf, num_threads=self._config.threads
        )
        return cloud
