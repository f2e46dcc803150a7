"""Trajectory errors against evo, against numbers worked out by hand, and under rigid motions."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from eval.score.trajectory import (
    Trajectory,
    align,
    ate_of_subset,
    metre_pairs,
    rpe_percent,
    score_trajectory,
    travelled,
)
from slam.core import Array, InputError, inverse, pose, so3_exp

SEEDS = st.integers(0, 2**32 - 1)


def wander(rng: np.random.Generator, count: int = 120) -> Trajectory:
    """A smooth random path through space, about 0.1 m a step."""
    turns = np.cumsum(rng.normal(0.0, 0.2, (count, 3)) * [0.1, 0.1, 1.0], axis=0)
    rotations = so3_exp(turns)
    steps = rotations[:, :, 0] * rng.uniform(0.05, 0.15, (count, 1))
    poses = np.tile(np.eye(4), (count, 1, 1))
    poses[:, :3, :3] = rotations
    poses[:, :3, 3] = np.cumsum(steps, axis=0)
    return Trajectory(0.1 * np.arange(count), poses)


def disturbed(truth: Trajectory, rng: np.random.Generator, size: float = 0.03) -> Trajectory:
    noise = np.tile(np.eye(4), (len(truth), 1, 1))
    noise[:, :3, :3] = so3_exp(rng.normal(0.0, size, (len(truth), 3)))
    noise[:, :3, 3] = rng.normal(0.0, size, (len(truth), 3))
    return Trajectory(truth.stamps, truth.poses @ noise)


def motion(rng: np.random.Generator) -> Array:
    return pose(so3_exp(rng.normal(0.0, 2.0, 3)), rng.normal(0.0, 50.0, 3))


def moved(T: Array, trajectory: Trajectory) -> Trajectory:
    return Trajectory(trajectory.stamps, T @ trajectory.poses)


def loop(count: int = 40) -> Trajectory:
    """A level square of 10 m sides, 1 m a step, heading along x throughout."""
    corners = [(i, 0) for i in range(10)] + [(10, i) for i in range(10)]
    corners += [(10 - i, 10) for i in range(10)] + [(0, 10 - i) for i in range(10)]
    poses = np.tile(np.eye(4), (count, 1, 1))
    poses[:, :2, 3] = corners[:count]
    return Trajectory(np.arange(float(count)), poses)


def evo_pair(truth: Trajectory, estimate: Trajectory):
    trajectory = pytest.importorskip("evo.core.trajectory")
    return tuple(
        trajectory.PoseTrajectory3D(poses_se3=list(t.poses.copy()), timestamps=t.stamps.copy())
        for t in (truth, estimate)
    )


@pytest.mark.parametrize("seed", range(5))
def test_ate_agrees_with_evo(seed: int) -> None:
    metrics = pytest.importorskip("evo.core.metrics")
    rng = np.random.default_rng(seed)
    truth = wander(rng)
    estimate = moved(motion(rng), disturbed(truth, rng))
    reference, other = evo_pair(truth, estimate)
    other.align(reference)
    ape = metrics.APE(metrics.PoseRelation.translation_part)
    ape.process_data((reference, other))
    score = score_trajectory(estimate, truth)
    assert score.ate == pytest.approx(ape.get_statistic(metrics.StatisticsType.rmse), rel=1e-9)
    assert score.ate**2 == pytest.approx(score.ate_xy**2 + score.ate_z**2)

    reference, other = evo_pair(truth, estimate)
    other.align_origin(reference)
    ape.process_data((reference, other))
    expected = ape.get_statistic(metrics.StatisticsType.rmse)
    assert score.ate_origin == pytest.approx(expected, rel=1e-9)


@pytest.mark.parametrize("seed", range(3))
def test_rpe_agrees_with_evo_on_even_steps(seed: int) -> None:
    metrics = pytest.importorskip("evo.core.metrics")
    rng = np.random.default_rng(seed)
    truth = wander(rng, 60)
    steps = np.diff(truth.positions, axis=0)
    even = 0.25 * steps / np.linalg.norm(steps, axis=1)[:, None]
    poses = truth.poses.copy()
    poses[1:, :3, 3] = poses[0, :3, 3] + np.cumsum(even, axis=0)
    truth = Trajectory(truth.stamps, poses)
    estimate = moved(motion(rng), disturbed(truth, rng))
    rpe = metrics.RPE(metrics.PoseRelation.translation_part, 4, metrics.Unit.frames, all_pairs=True)
    rpe.process_data(evo_pair(truth, estimate))
    expected = 100.0 * rpe.get_statistic(metrics.StatisticsType.rmse)
    assert rpe_percent(estimate, truth) == pytest.approx(expected, rel=1e-9)


@given(SEEDS)
@settings(max_examples=30, deadline=None)
def test_a_rigid_motion_of_the_estimate_changes_nothing(seed: int) -> None:
    rng = np.random.default_rng(seed)
    truth = wander(rng)
    estimate = disturbed(truth, rng)
    T = motion(rng)
    before, after = score_trajectory(estimate, truth), score_trajectory(moved(T, estimate), truth)
    for name in ("ate", "ate_xy", "ate_z", "yaw_deg", "ate_origin", "rpe_percent"):
        assert getattr(after, name) == pytest.approx(getattr(before, name), abs=1e-9)
    back = after.T_truth_estimate @ T
    assert np.allclose(back, before.T_truth_estimate, atol=1e-8)


@given(SEEDS)
@settings(max_examples=30, deadline=None)
def test_no_other_alignment_is_better(seed: int) -> None:
    rng = np.random.default_rng(seed)
    truth = wander(rng)
    estimate = disturbed(truth, rng, 0.3)
    best = score_trajectory(estimate, truth)
    nudge = pose(so3_exp(rng.normal(0.0, 0.02, 3)), rng.normal(0.0, 0.02, 3))
    nudged = moved(nudge @ best.T_truth_estimate, estimate).positions - truth.positions
    assert np.sqrt((nudged**2).sum(axis=1).mean()) >= best.ate - 1e-12


def test_truth_against_itself_is_zero() -> None:
    truth = loop()
    score = score_trajectory(truth, truth)
    for value in (score.ate, score.ate_xy, score.ate_z, score.ate_origin, score.rpe_percent):
        assert value == pytest.approx(0.0, abs=1e-12)
    assert score.yaw_deg == pytest.approx(0.0, abs=1e-9)
    assert np.allclose(score.T_truth_estimate, np.eye(4), atol=1e-12)


def test_height_error_by_hand() -> None:
    """Every other pose 2 cm too high: alignment takes the mean away, 1 cm of height remains."""
    truth = loop()
    poses = truth.poses.copy()
    poses[1::2, 2, 3] += 0.02
    score = score_trajectory(Trajectory(truth.stamps, poses), truth)
    assert score.ate_z == pytest.approx(0.01, abs=1e-5)
    assert score.ate_xy == pytest.approx(0.0, abs=1e-5)
    assert score.ate_origin == pytest.approx(0.02 / np.sqrt(2.0))
    # One metre on, the height is wrong by 2 cm each time: 2 %.
    assert score.rpe_percent == pytest.approx(2.0)


def test_yaw_error_by_hand() -> None:
    """Positions right, heading turned by 3 degrees in every fourth pose: sqrt(9 / 4) = 1.5."""
    truth = loop()
    poses = truth.poses.copy()
    poses[::4, :3, :3] = so3_exp(np.array([0.0, 0.0, np.radians(3.0)]))
    score = score_trajectory(Trajectory(truth.stamps, poses), truth)
    assert score.yaw_deg == pytest.approx(1.5)
    assert score.ate == pytest.approx(0.0, abs=1e-12)


def test_yaw_errors_wrap() -> None:
    truth = loop()
    turned = truth.poses.copy()
    turned[:, :3, :3] = so3_exp(np.array([0.0, 0.0, np.pi - 0.01]))
    poses = truth.poses.copy()
    poses[:, :3, :3] = so3_exp(np.array([0.0, 0.0, -np.pi + 0.01]))
    score = score_trajectory(Trajectory(truth.stamps, poses), Trajectory(truth.stamps, turned))
    assert score.yaw_deg == pytest.approx(np.degrees(0.02))


def test_scale_is_not_aligned_away() -> None:
    """1 % too large over a 10 m square: what is left is 1 % of the distance from the middle."""
    truth = loop()
    poses = truth.poses.copy()
    poses[:, :3, 3] *= 1.01
    centred = truth.positions - truth.positions.mean(axis=0)
    expected = 0.01 * np.sqrt((centred**2).sum(axis=1).mean())
    score = score_trajectory(Trajectory(truth.stamps, poses), truth)
    assert score.ate == pytest.approx(expected)
    assert score.rpe_percent == pytest.approx(1.0)


def test_metre_pairs_by_hand() -> None:
    positions = np.array([[0, 0, 0], [0.4, 0, 0], [0.8, 0, 0], [1.3, 0, 0], [1.4, 0, 0.0]])
    i, j = metre_pairs(positions)
    assert i.tolist() == [0, 1]
    assert j.tolist() == [3, 4]
    assert travelled(positions).tolist() == pytest.approx([0.0, 0.4, 0.8, 1.3, 1.4])


def test_a_straight_path_has_no_alignment_but_keeps_what_needs_none() -> None:
    truth = Trajectory(np.arange(10.0), loop().poses[:10])
    poses = truth.poses.copy()
    poses[:, 1, 3] = 0.01 * np.arange(10)
    score = score_trajectory(Trajectory(truth.stamps, poses), truth)
    assert score.T_truth_estimate is None
    assert (score.ate, score.ate_xy, score.ate_z, score.yaw_deg) == (None,) * 4
    assert score.ate_origin == pytest.approx(0.01 * np.sqrt(np.mean(np.arange(10.0) ** 2)))
    assert score.rpe_percent == pytest.approx(1.0)


@pytest.mark.parametrize("count", [0, 1, 2])
def test_too_few_poses(count: int) -> None:
    truth = Trajectory(np.arange(float(count)), loop().poses[:count])
    score = score_trajectory(truth, truth)
    assert score.ate is None
    assert score.ate_origin == (None if count == 0 else 0.0)


def test_an_estimate_that_stands_still_is_not_aligned() -> None:
    truth = loop()
    still = np.tile(np.eye(4), (len(truth), 1, 1))
    assert align(still[:, :3, 3], truth.positions) is None
    lost = truth.positions.copy()
    lost[3] = np.nan
    assert align(lost, truth.positions) is None


def test_mirrored_positions_are_not_matched_by_a_mirror() -> None:
    rng = np.random.default_rng(3)
    positions = rng.normal(0.0, 2.0, (50, 3))
    T = align(positions * [1.0, 1.0, -1.0], positions)
    assert np.linalg.det(T[:3, :3]) == pytest.approx(1.0)


def test_keyframes_use_the_alignment_of_all() -> None:
    truth = loop()
    poses = truth.poses.copy()
    poses[7, 2, 3] += 0.4
    estimate = Trajectory(truth.stamps, poses)
    score = score_trajectory(estimate, truth)
    others = np.array([0, 10, 20, 30])
    aligned = moved(score.T_truth_estimate, estimate).positions - truth.positions
    expected = np.sqrt((aligned[others] ** 2).sum(axis=1).mean())
    assert expected > 1e-4
    found = ate_of_subset(score.T_truth_estimate, estimate, truth, others)
    assert found == pytest.approx(expected)
    assert ate_of_subset(None, estimate, truth, others) is None
    nothing = np.array([], dtype=np.int64)
    assert ate_of_subset(score.T_truth_estimate, estimate, truth, nothing) is None


def test_different_stamps_are_refused() -> None:
    truth = loop()
    with pytest.raises(InputError, match="same stamps"):
        score_trajectory(Trajectory(truth.stamps + 0.05, truth.poses), truth)
    with pytest.raises(InputError, match="same stamps"):
        score_trajectory(Trajectory(truth.stamps[:-1], truth.poses[:-1]), truth)
    with pytest.raises(InputError, match="poses of shape"):
        Trajectory(truth.stamps, truth.poses[:-1])


def test_a_frame_change_of_the_truth_moves_the_alignment_alike() -> None:
    rng = np.random.default_rng(0)
    truth = wander(rng)
    estimate = disturbed(truth, rng)
    T = motion(rng)
    first = score_trajectory(estimate, truth)
    second = score_trajectory(estimate, moved(T, truth))
    assert second.ate == pytest.approx(first.ate)
    assert np.allclose(inverse(T) @ second.T_truth_estimate, first.T_truth_estimate, atol=1e-8)


@pytest.mark.parametrize(("wobble", "aligned"), [(0.02, False), (0.5, True)])
def test_a_nearly_straight_path_is_straight(wobble: float, aligned: bool) -> None:
    """2 cm to either side over 9 m say nothing of the turn about the path; half a metre does."""
    poses = loop().poses[:10].copy()
    poses[1::2, 1, 3] += wobble
    poses[::3, 2, 3] += 0.01
    truth = Trajectory(np.arange(10.0), poses)
    assert (score_trajectory(truth, truth).ate is not None) is aligned


def test_rpe_is_per_metre_of_true_path() -> None:
    """Steps of 0.4 m: pairs are 1.2 m apart, and 1 % too long is 1 %."""
    poses = loop().poses.copy()
    poses[:, :3, 3] *= 0.4
    truth = Trajectory(np.arange(40.0), poses)
    longer = poses.copy()
    longer[:, :3, 3] *= 1.01
    i, j = metre_pairs(truth.positions)
    assert (j - i).tolist() == [3] * 37
    straight = Trajectory(np.arange(9.0), longer[:9]), Trajectory(np.arange(9.0), poses[:9])
    assert rpe_percent(*straight) == pytest.approx(1.0)
