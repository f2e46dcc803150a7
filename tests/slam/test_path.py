import numpy as np
import pytest

from slam.core import Frame, KeyframeScan, inverse, pose, so3_exp
from slam.path import Path

NOTHING = KeyframeScan((), np.zeros((0, 3)), np.zeros(3))


def at(x, y=0.0, yaw=0.0):
    return pose(so3_exp(np.array([0.0, 0.0, yaw])), np.array([x, y, 0.0]))


def path_of(tracked, anchors):
    """Anchors of some places: {place: (keyframe, T_keyframe_base)}."""
    path = Path()
    for k, T in enumerate(tracked):
        keyframe = NOTHING if k in anchors else None
        path.add(Frame(k, 0.1 * k, at(1.1 * k), T, keyframe), T, anchors.get(k))
    return path


def keyframes(*places):
    return {place: (k, np.eye(4)) for k, place in enumerate(places)}


def test_between_keyframes_the_correction_goes_over_from_one_to_the_other():
    tracked = [at(0.5 * k, 0.0, 0.1 * k) for k in range(9)]
    first, second = at(0.0, 1.0), at(2.0, 3.0, 0.4)
    path = path_of(tracked, keyframes(0, 4, 8))
    corrections = ((first, 0), (second, 4), (second, 8))
    poses = path.trajectory(np.array([T @ tracked[k] for T, k in corrections]))
    assert poses[0] == pytest.approx(first @ tracked[0])
    assert poses[4] == pytest.approx(second @ tracked[4])
    half = poses[2] @ inverse(tracked[2])
    assert half == pytest.approx(at(1.0, 2.0, 0.2))
    for k in range(4, 9):
        assert poses[k] == pytest.approx(second @ tracked[k])


def test_after_the_last_keyframe_its_correction_holds():
    tracked = [at(0.5 * k) for k in range(4)]
    correction = at(1.0, -1.0, 0.3)
    poses = path_of(tracked, keyframes(0)).trajectory(np.array([correction @ tracked[0]]))
    assert poses == pytest.approx(np.array([correction @ T for T in tracked]))


def test_it_tells_what_was_known_when():
    tracked = [at(0.5 * k) for k in range(4)]
    path = path_of(tracked, keyframes(0))
    assert path.stamp == pytest.approx(0.3)
    assert path.stamps() == pytest.approx([0.0, 0.1, 0.2, 0.3])
    assert path.online() == pytest.approx(np.array(tracked))
    assert path.latest() == pytest.approx(tracked[-1])
    assert path.odometry()[2] == pytest.approx(at(2.2))


def test_a_frame_beside_an_earlier_keyframe_moves_with_it():
    tracked = [at(0.5 * k) for k in range(5)]
    beside = at(0.1, 0.2, 0.3)
    path = path_of(tracked, {**keyframes(0, 2), 4: (0, beside)})
    moved = at(0.0, 1.0, 0.1)
    poses = path.trajectory(np.array([moved @ tracked[0], tracked[2]]))
    assert poses[4] == pytest.approx(moved @ tracked[0] @ beside)
