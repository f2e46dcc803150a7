"""KISS-ICP (Vizzo et al., 2023) with an indoor preset: the odometry, from points alone.

Composed from the library's parts, for four things that its own pipeline cannot be told. Its
threshold adapts to motions above 0.1 m a sweep, so that in a building it stays where it began, at
half a metre and more, and walls are matched with what lies before them. Its spacing of the points
that are matched, one and a half voxels, leaves 16 beams too few of them. It undoes the motion
within a sweep by that of the last one: where a turn begins or ends, the sweep stays bent. And it
predicts that the base goes on rising and tilting as it did, which on wheels is noise.
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
    so3_exp,
    so3_log,
    thread_limit,
    transform_points,
)
from slam.odometry import check_finite

CLEARED = 2.0
"""Way after which what is too far for a match is taken out of the map [m]: each time the library
looks through all of it."""


@dataclass(frozen=True)
class KissConfig:
    """The indoor preset (``roomloop bench odometry``). Compared mostly on drives through generated
    buildings; voxel_size is older, and between nearly equal settings of the last step SE1 was
    looked at too (slam/README.md, "The odometry").

    returns: at most about so many of a sweep are used, spread evenly; voxel_size [m]: of the local
    map, voxel_points: how many it keeps in each, map_spacing [m]: between those that a sweep adds;
    source_spacing [m]: between the points that are matched, source_points: how many of them at
    most, which bounds the cost in large halls; reach [m]: of a match; kernel [m]: of the robust
    kernel; convergence: the
    step [m, rad] that ends the matching; max_range, min_range [m]: rooms end earlier; returns from
    the robot itself; again_angle [rad], again_distance [m]: a sweep that moved otherwise than
    predicted by more than either is deskewed and matched a second time; wheels: predict by wheel
    odometry, not by the last motion; threads: for registration.
    """

    returns: int = 5000
    voxel_size: float = 0.2
    voxel_points: int = 5
    map_spacing: float = 0.2
    source_spacing: float = 0.2
    source_points: int = 600
    reach: float = 0.2
    kernel: float = 0.05
    convergence: float = 1e-3
    max_range: float = 30.0
    min_range: float = 0.3
    again_angle: float = 0.015
    again_distance: float = 0.05
    wheels: bool = False
    threads: int = field(default_factory=lambda: thread_limit(2))


class PublishedKissOdometry:
    """KISS-ICP as its library composes it, with all of its defaults for sensors of that range [m]
    (the voxel is a hundredth of it): to compare with."""

    def __init__(self, max_range: float = 30.0):
        from kiss_icp.config import KISSConfig
        from kiss_icp.kiss_icp import KissICP

        config = KISSConfig()
        config.data.max_range = max_range
        config.mapping.voxel_size = 0.01 * max_range
        config.registration.max_num_threads = thread_limit(2)
        self._kiss = KissICP(config)

    def register(self, scan: Scan) -> Array:
        """T_odom_base (4, 4) at the sweep's end; odom is the base at the first sweep's end.

        Raises RunError for a pose that is not finite.
        """
        self._kiss.register_frame(np.array(scan.points, dtype=np.float64), _stamps(scan.times))
        return _of_base(scan, self._kiss.last_pose)


class KissOdometry:
    """KISS-ICP. Its own pose is the sensor's at the END of the sweep."""

    def __init__(self, config: KissConfig = KissConfig()):
        from kiss_icp.mapping import VoxelHashMap
        from kiss_icp.preprocess import Preprocessor
        from kiss_icp.registration import Registration
        from kiss_icp.voxelization import voxel_down_sample

        self._config = config
        self._preprocessor = Preprocessor(config.max_range, config.min_range, True, config.threads)
        self._registration = Registration(500, config.convergence, config.threads)
        self._map = VoxelHashMap(config.voxel_size, config.max_range, config.voxel_points)
        self._voxel_down_sample = voxel_down_sample
        self._pose = np.eye(4)
        self._step = np.eye(4)
        self._cleared = np.eye(4)
        self._wheels: WheelOdometry | None = None

    def register(self, scan: Scan) -> Array:
        """T_odom_base (4, 4) at the sweep's end; odom is the base at the first sweep's end.

        Raises RunError for a pose that is not finite, InputError if it is to predict by wheels and
        the scan has no wheel odometry.
        """
        self._advance(scan, self._predicted(scan))
        return _of_base(scan, self._pose)

    def _predicted(self, scan: Scan) -> Array:
        """How the lidar is thought to have moved since the last sweep's end, in its frame then."""
        if not self._config.wheels:
            return _in_plane(self._step, scan.T_base_lidar)
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
        if self._is_off(step, moved):
            cloud, pose = self._matched(points, stamps, moved, pose)
        self._map.add_points(transform_points(pose, cloud))
        if np.linalg.norm(pose[:3, 3] - self._cleared[:3, 3]) > CLEARED:
            self._map.remove_far_away_points(pose[:3, 3])
            self._cleared = pose
        self._step = np.linalg.inv(self._pose) @ pose
        self._pose = pose

    def _matched(
        self, points: Array, stamps: Array, step: Array, guess: Array
    ) -> tuple[Array, Array]:
        """The sweep deskewed by ``step`` and thinned for the map, and its pose from ``guess``."""
        config = self._config
        whole = self._preprocessor.preprocess(points, stamps, step)
        cloud = self._voxel_down_sample(whole, config.map_spacing)
        source = cloud
        if config.source_spacing > config.map_spacing:
            source = self._voxel_down_sample(cloud, config.source_spacing)
        most = config.source_points
        # The library takes arrays that are not contiguous point by point, fifty times as long.
        pose = self._registration.align_points_to_map(
            points=np.ascontiguousarray(source[:: max(ceil(len(source) / most), 1)]),
            voxel_map=self._map,
            initial_guess=guess,
            max_correspondance_distance=config.reach,
            kernel=config.kernel,
        )
        return cloud, pose

    def _is_off(self, predicted: Array, moved: Array) -> bool:
        """Whether the sweep was deskewed by a motion that it did not make."""
        off = inverse(predicted) @ moved
        angle = float(np.linalg.norm(so3_log(off[:3, :3])))
        distance = float(np.linalg.norm(off[:3, 3]))
        return angle > self._config.again_angle or distance > self._config.again_distance


def _of_base(scan: Scan, T_odom_lidar: Array) -> Array:
    """T_odom_base at the sweep's end; odom is the base at the first sweep's end."""
    check_finite((scan.stamp, T_odom_lidar))
    T_odom_base = orthonormal(scan.T_base_lidar @ T_odom_lidar @ inverse(scan.T_base_lidar))
    # KISS-ICP differs in its last digits from run to run; nothing after it needs to.
    return np.round(T_odom_base, 9)


def _in_plane(step: Array, T_base_lidar: Array) -> Array:
    """A motion of the lidar without what lifts or tilts the base: that says little of the next
    one."""
    moved = T_base_lidar @ step @ inverse(T_base_lidar)
    level = np.eye(4)
    level[:3, :3] = so3_exp(np.array([0.0, 0.0, so3_log(moved[:3, :3])[2]]))
    level[:2, 3] = moved[:2, 3]
    return inverse(T_base_lidar) @ level @ T_base_lidar


def _stamps(times: Array) -> Array:
    """Per-point stamps, or none at all: KISS-ICP aborts the process when all of them are equal."""
    spread = len(times) > 1 and float(np.ptp(times)) > 0.0
    return np.ascontiguousarray(times) if spread else np.empty(0)
