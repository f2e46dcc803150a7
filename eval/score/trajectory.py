"""How far a trajectory is from the true one: ATE after alignment, and RPE per metre.

Truth is sampled at the very instants of the estimate, so poses pair by place in the array; stamps
are compared, never searched. Metres and radians inside, degrees and percent where a name says so.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from slam.core import Array, InputError, IntArray, inverse

MIN_SPREAD = 0.1
"""Least spread of a path across its main direction [m, standard deviation] for an alignment."""


@dataclass(frozen=True)
class Trajectory:
    """stamps: (N,) seconds, ascending, at sweep ends; poses: (N, 4, 4) T_frame_base."""

    stamps: Array
    poses: Array

    def __post_init__(self) -> None:
        if self.poses.shape != (len(self.stamps), 4, 4):
            raise InputError(
                f"trajectory: {len(self.stamps)} stamps need poses of shape "
                f"({len(self.stamps)}, 4, 4), got {self.poses.shape}"
            )

    def __len__(self) -> int:
        return len(self.stamps)

    @property
    def positions(self) -> Array:
        """(N, 3)"""
        return self.poses[:, :3, 3]

    @property
    def path_m(self) -> float:
        """Length of the polyline through the positions [m]."""
        return float(travelled(self.positions)[-1]) if len(self) else 0.0


@dataclass(frozen=True)
class TrajectoryScore:
    """Errors of one trajectory; None where a path cannot be aligned (``align``) or is empty.

    ate: RMSE of 3-D positions after SE(3) alignment; ate_xy, ate_z, yaw_deg: RMSE of the same
    aligned poses in plan view, in height and in heading; ate_origin: RMSE of positions with only
    the first poses made equal; rpe_percent: see ``rpe_percent``. T_truth_estimate: the alignment.
    """

    T_truth_estimate: Array | None
    ate: float | None
    ate_xy: float | None
    ate_z: float | None
    yaw_deg: float | None
    ate_origin: float | None
    rpe_percent: float | None


def part_of(trajectory: Trajectory, rows: NDArray[np.bool_]) -> Trajectory:
    """The poses of ``rows`` (N,)."""
    return Trajectory(trajectory.stamps[rows], trajectory.poses[rows])


def travelled(positions: Array) -> Array:
    """(N,) metres driven up to each of N positions (N, 3)."""
    steps = np.linalg.norm(np.diff(positions, axis=0), axis=1)
    return np.concatenate([np.zeros(min(len(positions), 1)), np.cumsum(steps)])


def align(estimate: Array, truth: Array) -> Array | None:
    """T_truth_estimate (4, 4) that best maps positions (N, 3) onto the true (N, 3); no scale.

    Umeyama 1991, eq. 34-43. None where no rotation is determined: fewer than three poses, or a path
    (true or estimated) that is straight to within ``MIN_SPREAD``. On a straight path the RMSE would
    still have a minimum, but the turn about the path would be noise, and everything that is scored
    through T_world_map with it; ATE is therefore null there, and origin-aligned ATE and RPE, which
    need no alignment, remain.
    """
    if len(estimate) < 3 or not np.isfinite(estimate).all():
        return None
    mean_estimate, mean_truth = estimate.mean(axis=0), truth.mean(axis=0)
    cross = (truth - mean_truth).T @ (estimate - mean_estimate) / len(estimate)
    u, singular, vt = np.linalg.svd(cross)
    if singular[1] < MIN_SPREAD**2:
        return None
    mirror = np.diag([1.0, 1.0, np.sign(np.linalg.det(u) * np.linalg.det(vt))])
    T_truth_estimate = np.eye(4)
    T_truth_estimate[:3, :3] = u @ mirror @ vt
    T_truth_estimate[:3, 3] = mean_truth - T_truth_estimate[:3, :3] @ mean_estimate
    return T_truth_estimate


def rms(values: Array) -> float | None:
    """Root mean square over the first axis of (N,) values or of the norms of (N, D) vectors."""
    if len(values) == 0:
        return None
    squares = values**2 if values.ndim == 1 else (values**2).sum(axis=1)
    return float(np.sqrt(squares.mean()))


def position_errors(T_truth_estimate: Array, estimate: Trajectory, truth: Trajectory) -> Array:
    """(N, 3) estimated minus true positions, in the frame of truth, after an alignment."""
    R, t = T_truth_estimate[:3, :3], T_truth_estimate[:3, 3]
    return estimate.positions @ R.T + t - truth.positions


def yaw_errors_deg(T_truth_estimate: Array, estimate: Trajectory, truth: Trajectory) -> Array:
    """(N,) heading errors [degrees] in (-180, 180], after an alignment."""
    aligned = T_truth_estimate[:3, :3] @ estimate.poses[:, :3, :3]
    error = _headings(aligned) - _headings(truth.poses[:, :3, :3])
    return np.degrees(np.arctan2(np.sin(error), np.cos(error)))


def _headings(rotations: Array) -> Array:
    return np.arctan2(rotations[:, 1, 0], rotations[:, 0, 0])


def metre_pairs(positions: Array, metres: float = 1.0) -> tuple[IntArray, IntArray]:
    """Pairs (i, j): j is the first pose at least ``metres`` of path after i, for every such i."""
    s = travelled(positions)
    j = np.searchsorted(s, s + metres - 1e-9)
    i = np.flatnonzero(j < len(s))
    return i.astype(np.int64), j[i].astype(np.int64)


def rpe_percent(estimate: Trajectory, truth: Trajectory) -> float | None:
    """Relative pose error per metre, in percent; None on a path shorter than a metre.

    For every pair of ``metre_pairs``: the translation of (T_true_i^-1 T_true_j)^-1 (T_est_i^-1
    T_est_j), over the true path between the two poses; RMSE over the pairs. No alignment enters.
    """
    i, j = metre_pairs(truth.positions)
    if len(i) == 0:
        return None
    step_true = _steps(truth.poses, i, j)
    step_estimate = _steps(estimate.poses, i, j)
    # |R_true^T (t_est - t_true)| = |t_est - t_true|: the rotation of the true step drops out.
    error = np.linalg.norm(step_estimate - step_true, axis=1)
    s = travelled(truth.positions)
    return rms(100.0 * error / (s[j] - s[i]))


def _steps(poses: Array, i: IntArray, j: IntArray) -> Array:
    """(P, 3) translations of T_i^-1 T_j."""
    return np.einsum("nba,nb->na", poses[i, :3, :3], poses[j, :3, 3] - poses[i, :3, 3])


def origin_alignment(estimate: Trajectory, truth: Trajectory) -> Array:
    """T_truth_estimate that makes the two first poses equal."""
    return truth.poses[0] @ inverse(estimate.poses[0])


def score_trajectory(estimate: Trajectory, truth: Trajectory) -> TrajectoryScore:
    """All errors of a trajectory; raises InputError where the stamps differ."""
    _check_pairs(estimate, truth)
    if len(truth) == 0:
        return TrajectoryScore(None, None, None, None, None, None, None)
    origin = rms(position_errors(origin_alignment(estimate, truth), estimate, truth))
    rpe = rpe_percent(estimate, truth)
    T = align(estimate.positions, truth.positions)
    if T is None:
        return TrajectoryScore(None, None, None, None, None, origin, rpe)
    errors = position_errors(T, estimate, truth)
    return TrajectoryScore(
        T_truth_estimate=T,
        ate=rms(errors),
        ate_xy=rms(errors[:, :2]),
        ate_z=rms(errors[:, 2]),
        yaw_deg=rms(yaw_errors_deg(T, estimate, truth)),
        ate_origin=origin,
        rpe_percent=rpe,
    )


def ate_of_subset(
    T_truth_estimate: Array | None, estimate: Trajectory, truth: Trajectory, indices: IntArray
) -> float | None:
    """RMSE of the positions at ``indices`` (keyframes), under an alignment of the whole."""
    if T_truth_estimate is None:
        return None
    return rms(position_errors(T_truth_estimate, estimate, truth)[indices])


def _check_pairs(estimate: Trajectory, truth: Trajectory) -> None:
    if len(estimate) != len(truth) or not np.allclose(
        estimate.stamps, truth.stamps, rtol=0.0, atol=1e-6
    ):
        raise InputError(
            f"trajectory: {len(estimate)} estimated poses against {len(truth)} true ones: "
            "one pose per scan with the same stamps was expected"
        )
