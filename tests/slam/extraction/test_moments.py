import numpy as np
import pytest

from slam.extraction.moments import Lines, Split, moments_of, moved, running, turn_between


def points(rng, angle, count=50, across=0.01):
    along, off = rng.uniform(-2.0, 2.0, count), rng.normal(0.0, across, count)
    turn = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
    return np.column_stack([along, off]) @ turn.T + rng.uniform(-3.0, 3.0, 2)


@pytest.mark.parametrize("angle", [-1.5, -0.3, 0.0, 0.8, 1.55])
def test_lines_are_those_of_a_principal_component_analysis(angle):
    xy = points(np.random.default_rng(1), angle)
    line = Lines(moments_of(xy).sum(axis=0, keepdims=True))
    values, vectors = np.linalg.eigh(np.cov(xy.T, bias=True) * len(xy))
    assert line.mean[0] == pytest.approx(xy.mean(axis=0))
    assert (line.residual[0], line.spread[0]) == pytest.approx(tuple(values), rel=1e-6)
    assert abs(line.direction[0] @ vectors[:, 1]) == pytest.approx(1.0)
    assert turn_between(line.angle, np.array([angle])) == pytest.approx([0.0], abs=0.01)


def test_sums_of_a_stretch_are_those_of_its_points():
    xy = points(np.random.default_rng(2), 0.4)
    sums = running(moments_of(xy))
    assert sums[31] - sums[7] == pytest.approx(moments_of(xy[7:31]).sum(axis=0))


def test_moments_move_with_their_points():
    xy, shift = points(np.random.default_rng(3), 0.4), np.array([[0.3, -1.2]])
    before = moments_of(xy).sum(axis=0, keepdims=True)
    after = moments_of(xy + shift).sum(axis=0, keepdims=True)
    assert moved(before, shift) == pytest.approx(after)


def test_angles_between_lines_know_no_direction():
    first, second = np.array([0.1, 1.5, 3.0, 0.0]), np.array([-0.1, -1.5, 0.1, 0.5 * np.pi])
    expected = [0.2, np.pi - 3.0, np.pi - 2.9, 0.5 * np.pi]
    assert turn_between(first, second) == pytest.approx(expected)


@pytest.mark.parametrize("yaw", [0.0, 0.7, 0.5 * np.pi, -2.0])
@pytest.mark.parametrize(("gap", "bend"), [(0.1, 0.0), (0.05, 0.0), (0.0, 0.1), (0.08, -0.05)])
def test_a_cut_tells_gap_and_bend_of_two_lines(yaw, gap, bend):
    x = np.linspace(-1.0, 2.0, 61)
    right = x > 0.5
    y = np.where(right, gap + np.tan(bend) * (x - 0.5), 0.0)
    turn = np.array([[np.cos(yaw), -np.sin(yaw)], [np.sin(yaw), np.cos(yaw)]])
    sums = running(moments_of(np.column_stack([x, y]) @ turn.T + [4.0, 1.0]))
    cuts = np.arange(5, 56)
    split = Split(sums, np.zeros(51, dtype=int), cuts, np.full(51, 61))
    best = int(split.gain.argmax())
    # What lies on the hinge of a bend lies on both lines.
    assert cuts[best] == pytest.approx(np.count_nonzero(~right), abs=1.0 if bend else 0.0)
    assert split.gap[best] == pytest.approx(gap, abs=0.003)
    assert split.bend[best] == pytest.approx(abs(bend), abs=1e-6)
