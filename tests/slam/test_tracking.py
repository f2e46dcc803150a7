import numpy as np
import pytest
from synthetic import ELEVATIONS, base_pose, box_planes, scan_box

from slam.core import Scan, inverse, pose, so3_exp, so3_log, transform_plane, transform_points
from slam.extraction import ExtractionConfig, extract, extract_planes
from slam.localplanes import LocalPlaneConfig, LocalPlanes
from slam.tracking import PlaneTracker

BOX = box_planes(6.0, 4.0, 2.7)
T_BASE_LIDAR = pose(np.eye(3), np.array([0.0, 0.0, 0.5]))


def driven(count):
    """T_world_base at the ends of sweeps: a curve, with the base nodding a little."""
    steps = np.arange(count)
    tilt = 0.003 * np.sin(steps)
    return [base_pose(1.5 + 0.05 * k, 1.5 + 0.01 * k, 0.06 * k, (tilt[k], -tilt[k])) for k in steps]


def scan_between(T_start, T_end, rng, index, blocks=60):
    """A sweep of a base in motion, each block of columns cast where the base was then."""
    turn = so3_log(T_start[:3, :3].T @ T_end[:3, :3])
    points, times, ring = [], [], []
    for block in range(blocks):
        s = (block + 0.5) / blocks
        way = T_start[:3, 3] + s * (T_end[:3, 3] - T_start[:3, 3])
        T = pose(T_start[:3, :3] @ so3_exp(s * turn), way)
        whole = scan_box(BOX, T, None, index)
        mine = slice(block * len(whole) // blocks, (block + 1) * len(whole) // blocks)
        points.append(whole.points[mine])
        times.append(np.full(len(points[-1]), 0.1 * (s - 1.0)))
        ring.append(whole.ring[mine])
    cloud = np.concatenate(points)
    reach = np.linalg.norm(cloud, axis=1, keepdims=True)
    cloud *= 1.0 + rng.normal(0.0, 0.012, reach.shape) / reach
    rings = np.concatenate(ring)
    stamp = 0.1 * (index + 1)
    return Scan(
        index, stamp, cloud, np.concatenate(times), rings, np.ones(len(cloud)), T_BASE_LIDAR
    )


def test_poses_are_ten_times_better_than_a_jittering_odometry():
    rng = np.random.default_rng(0)
    true, tracker = driven(25), PlaneTracker()
    errors, jitters = [], []
    for k, T_world_base in enumerate(true):
        scan = scan_between(true[max(k - 1, 0)], T_world_base, rng, k)
        jitter = pose(so3_exp(rng.normal(0, 0.01, 3)), rng.normal(0, 0.03, 3))
        exact = inverse(true[0]) @ T_world_base
        T = tracker.track(scan, exact @ jitter if k else np.eye(4))
        if k % 6 == 0:
            origin = T_BASE_LIDAR[:3, 3]
            tracker.learn(
                extract_planes(tracker.deskew(scan), scan.ring, origin, ExtractionConfig())
            )
        if k:
            error = inverse(exact) @ T
            errors.append(np.append(so3_log(error[:3, :3]), error[:3, 3]))
            jitters.append(np.append(so3_log(jitter[:3, :3]), jitter[:3, 3]))
    error, jitter = (np.sqrt(np.mean(np.square(e), axis=0)) for e in (errors, jitters))
    assert error[2] < 0.003  # heading [rad]
    assert error[3:].max() < 0.01
    assert (error < 0.35 * jitter).all()


def test_a_sweep_in_motion_is_made_straight():
    rng = np.random.default_rng(1)
    true, tracker = driven(12), PlaneTracker()
    for k, T_world_base in enumerate(true):
        scan = scan_between(true[max(k - 1, 0)], T_world_base, rng, k)
        tracker.track(scan, inverse(true[0]) @ T_world_base)
        points = tracker.deskew(scan)
        if k == 0:
            planes = extract_planes(points, scan.ring, T_BASE_LIDAR[:3, 3], ExtractionConfig())
            tracker.learn(planes)
    in_world = transform_points(true[-1], points)
    off = np.min([np.abs(in_world @ n + d) for n, d in BOX], axis=0)
    assert np.sqrt(np.mean(off**2)) < 0.02
    raw = transform_points(true[-1] @ T_BASE_LIDAR, scan.points)
    assert np.sqrt(np.mean(np.min([np.abs(raw @ n + d) for n, d in BOX], axis=0) ** 2)) > 0.03


def test_without_planes_the_odometry_is_passed_on():
    rng = np.random.default_rng(2)
    true, tracker = driven(5), PlaneTracker()
    for k, T_world_base in enumerate(true):
        scan = scan_between(true[max(k - 1, 0)], T_world_base, rng, k, blocks=4)
        exact = inverse(true[0]) @ T_world_base
        assert tracker.track(scan, exact) == pytest.approx(exact, abs=0.02)


def test_what_is_not_seen_for_long_is_forgotten():
    rng = np.random.default_rng(3)
    known = LocalPlanes(LocalPlaneConfig())
    scan = scan_box(BOX, base_pose(3, 2, 0), rng)
    origin = T_BASE_LIDAR[:3, 3]
    planes = extract_planes(scan.points + origin, scan.ring, origin, ExtractionConfig())
    known.learn(planes, np.eye(4))
    assert len(list(known)) == len(planes) == 5
    for _ in range(41):
        known.learn((), np.eye(4))
    assert not list(known)


def test_the_synthetic_beams_are_those_of_the_sensor():
    assert len(ELEVATIONS) == 16
    normal, d = transform_plane(np.eye(4), np.array([1.0, 0.0, 0.0]), 2.0)
    assert normal @ np.array([-2.0, 0.0, 0.0]) + d == 0.0


RAMP = np.radians(6.0)
SLOPE = np.array([-np.sin(RAMP), 0.0, np.cos(RAMP)]), 4.0 * float(np.sin(RAMP))
SHAFT = [*box_planes(16.0, 3.0, 4.0), SLOPE]


def up_a_ramp(told):
    """Tilt [deg] and height [m] by which a tracker is off after 7 m of a ramp, with an odometry
    that takes it for level; told: does it hear which way walls are plumb?"""
    rng = np.random.default_rng(4)
    tracker, start = PlaneTracker(), base_pose(1.5, 1.5, 0.0)
    for k in range(160):
        x = 1.5 + 0.06 * k
        slope = RAMP * np.clip((x - 3.8) / 0.4, 0.0, 1.0)
        T = base_pose(x, 1.5, 0.0, (0.0, -slope))
        T[2, 3] = max(0.0, x - 4.0) * np.tan(RAMP)
        scan = scan_box(SHAFT, T, rng, k)
        tracker.track(scan, inverse(start) @ base_pose(x, 1.5, 0.0))
        if k % 7 == 0:
            points, origin = tracker.deskew(scan), T_BASE_LIDAR[:3, 3]
            planes, plumb = extract(points, scan.ring, origin, ExtractionConfig())
            tracker.learn(planes, plumb if told else None)
    error = inverse(inverse(start) @ T) @ tracker.latest
    return np.degrees(np.linalg.norm(so3_log(error[:3, :3])[:2])), abs(error[2, 3])


def test_a_ramp_is_climbed_because_walls_are_plumb():
    tilt, height = up_a_ramp(told=True)
    assert tilt < 1.5
    assert height < 0.25
    not_told = up_a_ramp(told=False)
    assert not_told[0] > 1.5 * tilt
    assert not_told[1] > 1.5 * height


def led_away(turned):
    """A tracker that knows the box, and believes that the base turns so far with each sweep."""
    rng = np.random.default_rng(6)
    true, tracker = driven(4), PlaneTracker()
    for k, T_world_base in enumerate(true[:3]):
        scan = scan_between(true[max(k - 1, 0)], T_world_base, rng, k)
        tracker.track(scan, inverse(true[0]) @ T_world_base)
        if k == 0:
            origin = T_BASE_LIDAR[:3, 3]
            points = tracker.deskew(scan)
            tracker.learn(extract_planes(points, scan.ring, origin, ExtractionConfig()))
    tracker._motion = pose(so3_exp(np.array([0.0, 0.0, turned])), np.array([0.05, 0.0, 0.0]))
    exact = inverse(true[0]) @ true[3]
    T = tracker.track(scan_between(true[2], true[3], rng, 3), exact)
    return float(np.degrees(np.linalg.norm(so3_log(exact[:3, :3].T @ T[:3, :3]))))


def test_a_pose_that_is_led_away_from_the_odometry_must_explain_more(monkeypatch):
    assert led_away(0.06) < 0.3
    assert led_away(0.5) < 0.3
    monkeypatch.setattr(PlaneTracker, "_believed", lambda self, scan, stamp, *ends: ends[:2])
    assert led_away(0.06) < 0.3
    assert led_away(0.5) > 3.0
