"""The front end when the odometry fails it."""

import numpy as np
import pytest
from synthetic import base_pose, box_planes, scan_box

from slam.core import RunError, inverse, so3_log
from slam.frontend import FrontEnd, FrontEndConfig, thinned

BOX = box_planes(6.0, 4.0, 2.7)


class Astray:
    """An odometry of a standing base, with a heading [rad] and a place [m] that it makes up."""

    def __init__(self, headings, places):
        self._headings, self._places = headings, places

    def register(self, scan):
        return base_pose(self._places[scan.index], 0.0, self._headings[scan.index])


STEPS = np.arange(40)
TURNED = np.radians(np.minimum(STEPS, 35))  # a degree a scan


@pytest.mark.parametrize(
    ("headings", "places"),
    [
        pytest.param(0.0 * STEPS, 1.0 * (STEPS == 20), id="a jump for one sweep"),
        pytest.param(TURNED, 0.0 * STEPS, id="gradually"),
        pytest.param(TURNED * (STEPS < 38), 0.5 * (STEPS >= 38), id="gradually, and back at once"),
    ],
)
def test_an_odometry_that_goes_astray_ends_no_run_where_walls_are_seen(headings, places):
    front_end, start = FrontEnd(Astray(headings, places)), base_pose(3.0, 2.0, 0.3)
    for k in STEPS:
        frame = front_end.process(scan_box(BOX, start, np.random.default_rng(k), index=int(k)))
        assert np.linalg.norm(frame.T_track_base[:3, 3]) < 0.05
        assert np.linalg.norm(so3_log(frame.T_track_base[:3, :3])) < np.radians(1.0)


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


class Nowhere:
    """An odometry that has no pose to tell."""

    def register(self, scan):
        return np.full((4, 4), np.nan)


def test_a_pose_that_is_none_is_an_error():
    with pytest.raises(RunError, match="not finite"):
        FrontEnd(Nowhere()).process(scan_box(BOX, base_pose(3.0, 2.0, 0.3)))


@pytest.mark.parametrize("lost", [0.0, 0.1])
@pytest.mark.parametrize("every", [1, 4, 5])
def test_every_beam_keeps_its_share_everywhere_in_the_sweep(every, lost):
    rng = np.random.default_rng(0)
    columns, beams = 1800, 16
    ring = np.tile(rng.permutation(beams), columns).astype(np.int16)
    column = np.repeat(np.arange(columns), beams)
    returned = rng.random(len(ring)) >= lost
    kept = thinned(ring[returned], every)
    assert (np.diff(kept) > 0).all()
    assert len(kept) == pytest.approx(returned.sum() / every, abs=beams)
    # In each stretch of three turns there is every beam, as far as it came back at all.
    stretch = column[returned][kept] // (3 * every)
    seen = {*zip(stretch, ring[returned][kept], strict=True)}
    there = columns // (3 * every) * beams
    assert len(seen) >= (0.995 if lost else 1.0) * there


def test_a_keyframe_keeps_points_of_all_beams():
    poses, start = still_poses(1)
    scan = scan_box(BOX, start, np.random.default_rng(0))
    frame = FrontEnd(Jumping(poses, 5), FrontEndConfig(every=4)).process(scan)
    away = frame.keyframe.points - frame.keyframe.origin
    elevation = np.degrees(np.arcsin(away[:, 2] / np.linalg.norm(away, axis=1)))
    beam, count = np.unique(np.rint((elevation + 15.0) / 2.0), return_counts=True)
    assert beam.tolist() == list(range(16))
    assert count.min() >= len(scan) // 16 // 4 - 1
