"""What the odometries share: stamped poses, what no base does, and deskewing."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from slam.core import Array, RunError, Scan, inverse, rotate, so3_log, transform_points

Stamped = tuple[float, Array]
"""The end of a sweep [s], and T_odom_base (4, 4) then."""


@dataclass(frozen=True)
class MotionLimits:
    """What no indoor base does between two sweeps; beyond it track is lost.

    speed [m/s] and turning rate [rad/s]: several times those of any base that drives in rooms.
    """

    speed: float = 5.0
    turning_rate: float = 6.0


def check_finite(now: Stamped) -> None:
    """Raise RunError for a pose that is none."""
    if not np.isfinite(now[1]).all():
        raise RunError(f"the odometry diverged at t = {now[0]:.1f} s: the pose is not finite")


def check_motion(last: Stamped | None, now: Stamped, limits: MotionLimits) -> None:
    """Raise RunError when the motion between two (stamp, pose) is none that a base can make."""
    check_finite(now)
    if last is None:
        return
    seconds = max(now[0] - last[0], 1e-3)
    step = inverse(last[1]) @ now[1]
    speed = float(np.linalg.norm(step[:3, 3])) / seconds
    rate = float(np.linalg.norm(so3_log(step[:3, :3]))) / seconds
    if speed > limits.speed or rate > limits.turning_rate:
        raise RunError(
            f"lost track at t = {now[0]:.1f} s: {speed:.1f} m/s and {rate:.1f} rad/s between two"
            " sweeps"
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
    elapsed = 1.0 + scan.times / (stamp - stamp_last)
    moved = rotate(so3_log(T_last_now[:3, :3]), elapsed, points_base)
    moved += elapsed[:, None] * T_last_now[:3, 3]
    return transform_points(inverse(T_last_now), moved)
