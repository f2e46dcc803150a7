"""Loop closure on scans of a box whose geometry is known."""

import numpy as np
import pytest
from synthetic import base_pose, box_planes, in_base, scan_box

from slam.core import KeyframeScan, inverse, pose, so3_exp
from slam.extraction import ExtractionConfig, extract_planes
from slam.loops import LoopCloser

HERE = (base_pose(2.0, 1.5, 0.2), base_pose(2.4, 1.8, 1.0))


def keyframe(box, T_world_base, seed):
    scan = scan_box(box, T_world_base, np.random.default_rng(seed))
    points = in_base(scan)
    origin = np.array([0.0, 0.0, 0.5])
    planes = extract_planes(points, scan.ring, origin, ExtractionConfig())
    return KeyframeScan(planes, points[::4].astype(np.float32), origin)


@pytest.fixture(scope="module")
def scans():
    office, hall = box_planes(6.0, 4.0, 2.7), box_planes(9.0, 2.5, 2.7)
    return {
        "before": keyframe(office, HERE[0], 0),
        "again": keyframe(office, HERE[1], 1),
        "elsewhere": keyframe(hall, HERE[1], 2),
    }


def closed(scans, names, drift=(0.0, 0.0, 0.0), yaw=0.0, way=30.0):
    error = pose(so3_exp(np.array([0.0, 0.0, yaw])), np.array(drift))
    poses = np.array([HERE[0], base_pose(15.0, 0.0, 0.0), HERE[1] @ error])
    kept = [scans[names[0]], scans["elsewhere"], scans[names[1]]]
    closer = LoopCloser()
    found = None
    for k, driven in enumerate((0.0, way / 2.0, way)):
        found = closer.find(poses[: k + 1], kept[: k + 1], driven)
    return found, closer


@pytest.mark.parametrize("drift", [(0.0, 0.0, 0.0), (0.3, -0.2, 0.05)])
def test_a_loop_is_closed_where_the_scans_say(scans, drift):
    loop, closer = closed(scans, ("before", "again"), drift, yaw=0.05)
    assert (loop.earlier, loop.later) == (0, 2)
    error = inverse(inverse(HERE[0]) @ HERE[1]) @ loop.T_earlier_later
    assert np.linalg.norm(error[:3, 3]) < 0.04
    assert np.abs(error[:3, :3] - np.eye(3)).max() < 0.01
    assert closer.loops == [loop]


def test_another_room_is_no_loop(scans):
    assert closed(scans, ("before", "elsewhere"))[0] is None


def test_what_was_just_here_is_no_loop(scans):
    assert closed(scans, ("before", "again"), way=5.0)[0] is None


def test_nothing_is_found_far_away(scans):
    assert closed(scans, ("before", "again"), drift=(3.0, 0.0, 0.0))[0] is None


def test_a_scan_without_points_closes_nothing(scans):
    bare = KeyframeScan((), np.zeros((0, 3), np.float32), np.zeros(3))
    assert closed({**scans, "again": bare}, ("before", "again"))[0] is None
