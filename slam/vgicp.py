"""Scan-to-model voxelised GICP (small_gicp): the second implementation of the odometry."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from slam.core import Array, Scan, inverse, orthonormal
from slam.odometry import Stamped, check_finite, deskew


@dataclass(frozen=True)
class VgicpConfig:
    """Scan-to-model voxelised GICP (small_gicp).

    leaf [m]: scans are thinned to it; voxel [m]: of the Gaussian map; max_range, min_range [m]: of
    the returns used; every: one in so many returns; horizon: scans after which an unseen voxel is
    dropped; threads: more than one wait for each other busily, which on a shared machine costs ten
    times what it saves.
    """

    leaf: float = 0.3
    voxel: float = 0.5
    max_range: float = 30.0
    min_range: float = 0.3
    every: int = 2
    horizon: int = 1000
    threads: int = 1


class VgicpOdometry:
    """Voxelised GICP against the map so far (Koide et al., 2021), constant-velocity prediction.

    Distribution-to-distribution residuals are blind along a surface, so unlike point-to-point ones
    they do not hold on to rings that travel with the sensor.
    """

    def __init__(self, config: VgicpConfig = VgicpConfig()):
        import small_gicp

        self._gicp = small_gicp
        self._config = config
        self._map = small_gicp.GaussianVoxelMap(config.voxel)
        self._map.set_lru(horizon=config.horizon, clear_cycle=10)
        self._last: Stamped | None = None
        self._step = np.eye(4)

    def register(self, scan: Scan) -> Array:
        """T_odom_base (4, 4) at the sweep's end; odom is the base at the first sweep's end.

        Raises RunError for a pose that is not finite.
        """
        predicted = np.eye(4) if self._last is None else self._last[1] @ self._step
        source = self._thinned(scan, predicted)
        T_odom_base = predicted
        if self._last is not None:
            result = self._gicp.align(
                self._map, source, init_T_target_source=predicted, num_threads=self._config.threads
            )
            T_target_source = np.array(result.T_target_source)
            check_finite((scan.stamp, T_target_source))
            T_odom_base = orthonormal(T_target_source)
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
