import dataclasses
from types import SimpleNamespace

import numpy as np
import pytest
from synthetic import base_pose, box_planes, scan_box

from slam.core import (
    InputError,
    RunError,
    Scan,
    WheelOdometry,
    inverse,
    pose,
    so3_exp,
    transform_points,
)
from slam.frontend import FrontEnd
from slam.kiss import KissConfig, KissOdometry, PublishedKissOdometry, _in_plane
from slam.odometry import MotionLimits, check_motion, deskew
from slam.vgicp import VgicpOdometry

BOX = box_planes(6.0, 4.0, 2.7)


def test_a_standing_base_stays_where_it_is():
    odometry, rng = KissOdometry(), np.random.default_rng(0)
    for k in range(5):
        T = odometry.register(scan_box(BOX, base_pose(3.0, 2.0, 0.5), rng, index=k))
    assert np.abs(T - np.eye(4)).max() < 0.02


def test_a_moving_base_is_followed():
    odometry, rng = KissOdometry(), np.random.default_rng(0)
    for k in range(20):
        scan = scan_box(BOX, base_pose(2.0 + 0.06 * k, 2.0, 0.02 * k), rng, index=k)
        # A snapshot: that all instants are equal must not abort the process.
        T = odometry.register(dataclasses.replace(scan, times=np.zeros(len(scan))))
    # An empty box is the worst case: the rings on its walls travel with the sensor, and KISS-ICP
    # falls short of the way and of the turn. More is asked of it where there is more to see.
    assert np.arctan2(T[1, 0], T[0, 0]) == pytest.approx(0.02 * 19, abs=0.15)
    assert 0.7 < T[0, 3] < 1.2
    assert abs(T[1, 3]) < 0.1


def test_the_published_pipeline_is_the_library_s_own():
    from kiss_icp.config import KISSConfig
    from kiss_icp.kiss_icp import KissICP

    config = KISSConfig()
    config.data.max_range, config.mapping.voxel_size = 20.0, 0.2
    library, ours = KissICP(config), PublishedKissOdometry(max_range=20.0)
    T_base_lidar = pose(so3_exp(np.array([0.0, 0.0, 0.5])), np.array([0.2, 0.1, 0.5]))
    for k in range(3):
        scan = scan_box(BOX, base_pose(2.0 + 0.05 * k, 2.0, 0.1 * k), None, index=k)
        scan = dataclasses.replace(scan, T_base_lidar=T_base_lidar)
        library.register_frame(scan.points, scan.times)
        T = ours.register(scan)
        expected = T_base_lidar @ library.last_pose @ inverse(T_base_lidar)
        assert pytest.approx(expected, abs=1e-8) == T


def test_the_next_motion_is_predicted_in_the_plane_of_the_base():
    T_base_lidar = pose(so3_exp(np.array([0.1, -0.2, 0.3])), np.array([0.2, 0.1, 0.5]))

    def of_lidar(T):
        return inverse(T_base_lidar) @ T @ T_base_lidar

    driven = pose(so3_exp(np.array([0.0, 0.0, 0.08])), np.array([0.06, 0.01, 0.0]))
    assert _in_plane(of_lidar(driven), T_base_lidar) == pytest.approx(of_lidar(driven), abs=1e-12)
    shaken = pose(so3_exp(np.array([0.01, -0.02, 0.0])), np.array([0.0, 0.0, 0.03]))
    assert _in_plane(of_lidar(shaken), T_base_lidar) == pytest.approx(np.eye(4), abs=1e-12)


def test_wheels_predict_the_motion_of_the_lidar():
    odometry = KissOdometry(KissConfig(wheels=True))
    T_base_lidar = pose(so3_exp(np.array([0.1, -0.2, 0.3])), np.array([0.2, 0.1, 0.5]))
    places = [base_pose(3.0, 2.0, 0.2), base_pose(3.05, 2.01, 0.3)]
    for k, T in enumerate(places):
        wheels = WheelOdometry(0.1 * (k + 1), T, np.zeros(6))
        scan = scan_box(BOX, T, index=k)
        scan = dataclasses.replace(scan, wheels=wheels, T_base_lidar=T_base_lidar)
        predicted = odometry._predicted(scan)
    expected = inverse(places[0] @ T_base_lidar) @ places[1] @ T_base_lidar
    assert predicted == pytest.approx(expected, abs=1e-12)


def test_predicting_by_wheels_where_there_are_none_is_refused():
    with pytest.raises(InputError, match="scan 4: expected wheel odometry"):
        KissOdometry(KissConfig(wheels=True)).register(
            scan_box(BOX, base_pose(3.0, 2.0, 0.0), index=4)
        )


def test_a_sweep_of_nothing_near_enough_leaves_the_odometry_where_it_was():
    odometry = KissOdometry()
    scan = scan_box(BOX, base_pose(3.0, 2.0, 0.5))
    odometry.register(scan)
    far = dataclasses.replace(scan, index=1, stamp=0.2, points=scan.points * 100.0)
    assert odometry.register(far) == pytest.approx(np.eye(4), abs=0.02)


def test_vgicp_follows_a_moving_base():
    odometry, rng = VgicpOdometry(), np.random.default_rng(0)
    for k in range(20):
        scan = scan_box(BOX, base_pose(2.0 + 0.06 * k, 2.0, 0.02 * k), rng, index=k)
        T = odometry.register(dataclasses.replace(scan, times=np.zeros(len(scan))))
    assert T[:2, 3] == pytest.approx([1.14, 0.0], abs=0.1)


def test_deskewing_undoes_the_motion_within_the_sweep():
    T_last = pose(np.eye(3), np.zeros(3))
    T_now = pose(so3_exp(np.array([0.0, 0.0, 0.08])), np.array([0.06, 0.01, 0.0]))
    rng = np.random.default_rng(0)
    still = rng.uniform(-5, 5, (200, 3))  # in odom
    times = rng.uniform(-0.1, 0.0, 200)
    T_base_lidar = pose(np.eye(3), np.array([0.0, 0.0, 0.5]))
    points = np.empty_like(still)
    for i, t in enumerate(times):
        s = 1.0 + t / 0.1
        T = pose(so3_exp(np.array([0.0, 0.0, 0.08 * s])), s * T_now[:3, 3])
        points[i] = transform_points(inverse(T @ T_base_lidar), still[i : i + 1])[0]
    scan = Scan(1, 0.2, points, times, np.zeros(200, np.int16), np.zeros(200), T_base_lidar)
    recovered = deskew(scan, [(0.1, T_last), (0.2, T_now)])
    # The chord of a straight-line interpolation against the arc: below a millimetre.
    assert np.abs(recovered - transform_points(inverse(T_now), still)).max() < 1e-3


def test_a_jump_is_not_taken_for_motion():
    jumped = pose(np.eye(3), np.array([1.0, 0.0, 0.0]))
    with pytest.raises(RunError, match="lost track at t = 0.2 s"):
        check_motion((0.1, np.eye(4)), (0.2, jumped), MotionLimits())
    with pytest.raises(RunError, match="not finite"):
        check_motion(None, (0.2, np.full((4, 4), np.nan)), MotionLimits())


def find(odometry, T, monkeypatch):
    """Lets every match from now on end at T."""
    if isinstance(odometry, KissOdometry):
        found = SimpleNamespace(align_points_to_map=lambda **_: T)
        monkeypatch.setattr(odometry, "_registration", found)
    elif isinstance(odometry, PublishedKissOdometry):
        found = SimpleNamespace(register_frame=lambda *_: None, last_pose=T)
        monkeypatch.setattr(odometry, "_kiss", found)
    else:
        found = SimpleNamespace(T_target_source=T)
        monkeypatch.setattr("small_gicp.align", lambda *_, **__: found)


@pytest.mark.parametrize("make", [KissOdometry, PublishedKissOdometry, VgicpOdometry])
def test_an_odometry_reports_a_jump_but_no_pose_that_is_not_finite(make, monkeypatch):
    odometry = make()
    scans = [scan_box(BOX, base_pose(3.0, 2.0, 0.0), index=k) for k in range(3)]
    odometry.register(scans[0])
    find(odometry, pose(np.eye(3), np.array([2.0, 0.0, 0.0])), monkeypatch)
    assert odometry.register(scans[1])[:3, 3] == pytest.approx([2.0, 0.0, 0.0], abs=1e-6)
    find(odometry, np.full((4, 4), np.nan), monkeypatch)
    with pytest.raises(RunError, match=r"diverged at t = 0.3 s: the pose is not finite"):
        odometry.register(scans[2])


class Standing:
    """An odometry for tests that never moves."""

    def register(self, scan):
        return np.eye(4)


def test_the_first_scan_is_a_keyframe_and_a_standing_base_makes_no_other():
    frontend = FrontEnd(Standing())
    frames = [frontend.process(scan_box(BOX, base_pose(3, 2, 0), index=k)) for k in range(4)]
    assert [frame.keyframe is not None for frame in frames] == [True, False, False, False]
    assert len(frames[0].keyframe.planes) == 5


def test_a_scan_of_uneven_columns_or_without_returns_is_refused():
    scan = scan_box(BOX, base_pose(3, 2, 0))
    uneven = Scan(0, 0.1, scan.points, scan.times[:-1], scan.ring, scan.intensity)
    with pytest.raises(InputError, match="differ in length"):
        FrontEnd(Standing()).process(uneven)
    empty = Scan(3, 0.1, np.zeros((0, 3)), np.zeros(0), np.zeros(0, np.int16), np.zeros(0))
    with pytest.raises(InputError, match="scan 3: not a single return"):
        FrontEnd(Standing()).process(empty)
