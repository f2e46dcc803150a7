"""The front end when the odometry fails it."""

import numpy as np
import pytest
from synthetic import base_pose, box_planes, scan_box

from slam.core import RunError, inverse
from slam.frontend import FrontEnd

BOX = box_planes(6.0, 4.0, 2.7)


class Jumping:
    """An odometry that is right, until it is a metre off from one scan to the next."""

    def __init__(self, poses, at):
        self._poses, self._at = poses, at

    def register(self, scan):
        T = self._poses[scan.index].copy()
        T[0, 3] += 1.0 if scan.index >= self._at else 0.0
        return T


def still_poses(count):
    start = base_pose(3.0, 2.0, 0.3)
    return [inverse(start) @ start for _ in range(count)], start


def test_a_jump_of_the_odometry_is_recovered_where_walls_are_seen():
    poses, start = still_poses(12)
    front_end = FrontEnd(Jumping(poses, 5))
    for k in range(12):
        scan = scan_box(BOX, start, np.random.default_rng(k), index=k)
        frame = front_end.process(scan)
    assert np.linalg.norm(frame.T_odom_base[:3, 3]) == pytest.approx(1.0)
    assert np.linalg.norm(frame.T_track_base[:3, 3]) < 0.05


def test_a_jump_that_nothing_catches_is_an_error():
    poses, place = still_poses(6)
    place[:3, 3] = 200.0, 200.0, 150.0
    far = box_planes(400.0, 400.0, 300.0)  # nothing within reach of the extraction
    front_end = FrontEnd(Jumping(poses, 5))
    scans = [scan_box(far, place, np.random.default_rng(k), index=k) for k in range(6)]
    for scan in scans[:5]:
        front_end.process(scan)
    with pytest.raises(RunError, match="between two sweeps"):
        front_end.process(scans[5])
