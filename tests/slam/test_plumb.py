import numpy as np
import pytest

from slam.core import pose, so3_exp
from slam.plumb import FIRST, Up


def tilted(angle):
    return pose(so3_exp(np.array([0.0, angle, 0.0])), np.zeros(3))


def test_up_is_what_the_first_keyframes_saw_on_average():
    up = Up()
    for k in range(FIRST):
        angle = 0.01 * (k - FIRST // 2)
        assert up.compared(tilted(angle), np.array([0.0, 0.0, 1.0])) is None
    for _ in range(3):
        assert up.compared(tilted(0.2), np.array([0.0, 0.0, 1.0])) == pytest.approx([0, 0, 1])


def test_what_leans_at_the_start_is_no_wall():
    up, leaning = Up(), np.array([0.0, np.sin(0.1), np.cos(0.1)])
    for _ in range(FIRST):
        assert up.compared(np.eye(4), leaning) is None
    for _ in range(FIRST):
        assert up.compared(np.eye(4), np.array([0.0, 0.0, 1.0])) is None
    assert up.compared(np.eye(4), leaning) == pytest.approx([0, 0, 1])


def test_poses_and_what_was_seen_from_them_cancel():
    up = Up()
    for k in range(FIRST):
        T = tilted(0.1 * k)
        up.compared(T, T[:3, :3].T @ np.array([0.0, 0.0, 1.0]))
    assert up.compared(np.eye(4), np.array([1.0, 0.0, 0.0])) == pytest.approx([0, 0, 1])
