"""A keyframe's pose from the mapped planes that it seems to see, before anything is decided."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from slam.core import Array, PlaneObservation, pose, skew, so3_exp

Sight = tuple[PlaneObservation, Array, float, Array]
"""An observation, the normal (3,) and d of the mapped plane that it seems to be of, and the
covariance (3, 3) of their difference."""


@dataclass(frozen=True)
class AlignmentConfig:
    """rotation [rad], translation [m]: standard deviations of the pose before; robust: residuals
    beyond so many standard deviations count less (Cauchy); iterations of Gauss-Newton."""

    rotation: float = 0.006
    translation: float = 0.03
    robust: float = 2.0
    iterations: int = 3


def aligned(
    T_map_base: Array, sights: Sequence[Sight], config: AlignmentConfig = AlignmentConfig()
) -> Array:
    """T_map_base (4, 4) moved to where the observations fit the planes best."""
    prior = np.diag([config.rotation**-2.0] * 3 + [config.translation**-2.0] * 3)
    rows = np.array([observation.rows for observation, *_ in sights])
    normals = np.array([normal for _, normal, _, _ in sights])
    d = np.array([d for _, _, d, _ in sights])
    weights = np.linalg.inv(np.array([covariance for *_, covariance in sights]))
    T: Array = T_map_base
    moved: Array = np.zeros(6)
    for _ in range(config.iterations):
        residual, jacobian = differences(T, rows, normals, d)
        weighted = np.einsum("nij,nj->ni", weights, residual)
        chi2 = np.einsum("ni,ni->n", residual, weighted)
        share = 1.0 / (1.0 + chi2 / config.robust**2)
        turned = (jacobian.transpose(0, 2, 1) @ weights) * share[:, None, None]
        information = prior + (turned @ jacobian).sum(axis=0)
        right = -prior @ moved - np.einsum("nij,nj->i", turned, residual)
        step = np.asarray(np.linalg.solve(information, right), dtype=np.float64)
        T = T @ pose(so3_exp(step[:3]), step[3:])
        moved = moved + step
    return T


def differences(T: Array, rows: Array, normals: Array, d: Array) -> tuple[Array, Array]:
    """How far planes are from where they are observed: along the observed plane's two tangents
    [rad], and at its centroid [m] (N, 3); and the derivatives (N, 3, 6) by the pose.

    T: T_map_base (4, 4), or one each (N, 4, 4), which moves by (rotation, translation) on its
    right; rows: (N, 3, 3) of the observations; normals (N, 3), d (N,): the planes, map frame.
    """
    n_base = (normals[:, None, :] @ T[..., :3, :3])[:, 0]
    residual = np.einsum("nij,nj->ni", rows, n_base)
    residual[:, 2] += d + (normals * T[..., :3, 3]).sum(axis=1)
    jacobian = np.zeros((len(rows), 3, 6))
    jacobian[:, :, :3] = rows @ skew(n_base)
    jacobian[:, 2, 3:] = n_base
    return residual, jacobian
