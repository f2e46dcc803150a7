"""KISS-ICP (Vizzo et al., 2023) with an indoor preset: the odometry, from points alone.

Composed from the library's parts, for three things that its own pipeline cannot be told. Its
threshold adapts to motions above 0.1 m a sweep, so that in a building it stays where it began, at
half a metre and more, and walls are matched with what lies before them. Its spacing of the points
that are matched, one and a half voxels, leaves 16 beams some 200 of them. And it undoes the motion
within a sweep by that of the last one: where a turn begins or ends, the sweep stays bent.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from math import ceil

import numpy as np

from slam.core import (
    Array,
    InputError,
    Scan,
    WheelOdometry,
    inverse,
    orthonormal,
    so3_log,
    thread_limit,
)
from slam.odometry import LIMITS, MotionLimits, Stamped, check_motion


@dataclass(frozen=True)
class KissConfig:
    """The indoor preset (``roomloop bench odometry``). Compared mostly on drives through generated
    buildings; voxel_size is older, and between nearly equal settings of the last step SE1 was
    looked at too (README, "The odometry").

    returns: at most about so many of a sweep are used, spread evenly; voxel_size [m]: of the local
    map, which takes a point from each half of it; source_spacing [m]: between the points that are
    matched, source_points: how many of them at most, which bounds the cost in large halls;
    threshold [m]: sigma of the robust kernel, a third of the reach of a match; convergence: the
    step [m, rad] that ends the matching; max_range, min_range [m]: rooms end earlier; returns from
    the robot itself; again_angle [rad], again_distance [m]: a sweep that moved otherwise than
    predicted by more than either is deskewed and matched a second time; wheels: predict by wheel
    odometry, not by the last motion; threads: for registration.
    """

    returns: int = 5000
    voxel_size: float = 0.4
    source_spacing: float = 0.4
    source_points: int = 300
    threshold: float = 0.1
    convergence: float = 5e-4
    max_range: float = 30.0
    min_range: float = 0.3
    again_angle: float = 0.015
    again_distance: float = 0.05
    wheels: bool = False
    threads: int = field(default_factory=lambda: thread_limit(2))


class KissOdometry:
    """KISS-ICP. Its own pose is the sensor's at the END of the sweep."""

    def __init__(self, config: KissConfig = KissConfig(), limits: MotionLimits = LIMITS):
        from kiss_icp.mapping import VoxelHashMap
        from kiss_icp.preprocess import Preprocessor
        from kiss_icp.registration import Registration
        from kiss_icp.voxelization import voxel_down_sample

        self._config = config
        self._limits = limits
        self._preprocessor = Preprocessor(config.max_range, config.min_range, True, config.threads)
        self._registration = Registration(500, config.convergence, config.threads)
        self._map = VoxelHashMap(config.voxel_size, config.max_range, max_points_per_voxel=20)
        self._voxel_down_sample = voxel_down_sample
        self._pose = np.eye(4)
        self._step = np.eye(4)
        self._wheels: WheelOdometry | None = None
        self._last: Stamped | None = None

    def register(self, scan: Scan) -> Array:
        """T_odom_base (4, 4) at the sweep's end; odom is the base at the first sweep's end.

        Raises RunError when it has lost track, InputError if it is to predict by wheels and the
        scan has no wheel odometry.
        """
        self._advance(scan, self._predicted(scan))
        T_base_lidar = scan.T_base_lidar
        T_odom_base = orthonormal(T_base_lidar @ self._pose @ inverse(T_base_lidar))
        # KISS-ICP differs in its last digits from run to run; nothing after it needs to.
        T_odom_base = np.round(T_odom_base, 9)
        check_motion(self._last, (scan.stamp, T_odom_base), self._limits)
        self._last = (scan.stamp, T_odom_base)
        return T_odom_base

    def _predicted(self, scan: Scan) -> Array:
        """How the lidar is thought to have moved since the last sweep's end, in its frame then."""
        if not self._config.wheels:
            return self._step
        if scan.wheels is None:
            raise InputError(
                f"scan {scan.index}: expected wheel odometry, which this odometry predicts by; "
                "there is none in this recording"
            )
        last, self._wheels = self._wheels or scan.wheels, scan.wheels
        T_last_now = inverse(last.T_odom_base) @ scan.wheels.T_odom_base
        return inverse(scan.T_base_lidar) @ T_last_now @ scan.T_base_lidar

    def _advance(self, scan: Scan, step: Array) -> None:
        """Takes the sweep in: its pose, and its points into the map. step: the predicted motion."""
        every = (len(scan) // self._config.returns) | 1  # an even step would leave out beams
        points = np.ascontiguousarray(scan.points[::every], dtype=np.float64)
        stamps = _stamps(scan.times[::every])
        cloud, pose = self._matched(points, stamps, step, self._pose @ step)
        moved = np.linalg.inv(self._pose) @ pose
        if self._last is not None and self._is_off(step, moved):
            cloud, pose = self._matched(points, stamps, moved, pose)
        self._map.update(cloud, pose)
        self._step = np.linalg.inv(self._pose) @ pose
        self._pose = pose

    def _matched(
        self, points: Array, stamps: Array, step: Array, guess: Array
    ) -> tuple[Array, Array]:
        """The sweep deskewed by ``step`` and thinned for the map, and its pose from ``guess``."""
        config = self._config
        whole = self._preprocessor.preprocess(points, stamps, step)
        cloud = self._voxel_down_sample(whole, 0.5 * config.voxel_size)
        source = self._voxel_down_sample(cloud, config.source_spacing)
        pose = self._registration.align_points_to_map(
            points=source[:: max(ceil(len(source) / config.source_points), 1)],
            voxel_map=self._map,
            initial_guess=guess,
            max_correspondance_distance=3.0 * config.threshold,
            kernel=config.threshold,
        )
        return cloud, pose

    def _is_off(self, predicted: Array, moved: Array) -> bool:
        """Whether the sweep was deskewed by a motion that it did not make."""
        off = inverse(predicted) @ moved
        angle = float(np.linalg.norm(so3_log(off[:3, :3])))
        distance = float(np.linalg.norm(off[:3, 3]))
        return angle > self._config.again_angle or distance > self._config.again_distance


def _stamps(times: Array) -> Array:
    """Per-point stamps, or none at all: KISS-ICP aborts the process when all of them are equal."""
    spread = len(times) > 1 and float(np.ptp(times)) > 0.0
    return np.ascontiguousarray(times) if spread else np.empty(0)
