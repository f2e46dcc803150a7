"""A keyframe's pose from the mapped planes that it seems to see, before anything is decided."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from slam.core import Array, PlaneObservation, plane_axes, pose, skew, so3_exp

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
    weights = [np.linalg.inv(covariance) for *_, covariance in sights]
    T: Array = T_map_base
    moved: Array = np.zeros(6)
    for _ in range(config.iterations):
        information, right = prior.copy(), -prior @ moved
        for (observation, normal, d, _), weight in zip(sights, weights, strict=True):
            residual, jacobian = _difference(T, observation, normal, d)
            chi2 = float(residual @ weight @ residual)
            weighted = jacobian.T @ weight / (1.0 + chi2 / config.robust**2)
            information += weighted @ jacobian
            right -= weighted @ residual
        step = np.asarray(np.linalg.solve(information, right), dtype=np.float64)
        T = T @ pose(so3_exp(step[:3]), step[3:])
        moved = moved + step
    return T


def _difference(
    T: Array, observation: PlaneObservation, normal: Array, d: float
) -> tuple[Array, Array]:
    """The residual of ``keyframe_plane_factor`` (3,), and its derivative (3, 6) by the pose."""
    rows = np.stack([*plane_axes(observation.normal), observation.centroid])
    n_base = normal @ T[:3, :3]
    residual = rows @ n_base
    residual[2] += d + normal @ T[:3, 3]
    jacobian = np.zeros((3, 6))
    jacobian[:, :3] = rows @ skew(n_base)
    jacobian[2, 3:] = n_base
    return residual, jacobian
