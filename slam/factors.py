"""The factors of the layered graph that gtsam lacks, with analytic Jacobians.

gtsam's OrientedPlane3Factor weighs a plane's direction in a basis that jumps (its axis is the
smallest component of the normal, so for walls it flips between two), and its distance at the
sensor, where direction and distance are correlated. Here both are measured in the plane's own axes
and at the centroid of the points, where the covariance of a fitted plane is block-diagonal.

A residual is a function of values; Jacobians are with respect to gtsam's tangents: a Pose3 moves by
(rotation, translation) on its right, an OrientedPlane3 by two numbers in ``Unit3.basis()`` and d.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import gtsam
import numpy as np

from slam.core import Array, PlaneObservation, plane_axes, skew

Residual = Callable[[Sequence[Array]], tuple[Array, list[Array]]]


def plane_of(values: gtsam.Values, key: int) -> tuple[Array, float, Array]:
    """Normal (3,), d and the basis (3, 2) of the normal's tangent of a plane variable."""
    plane = values.atOrientedPlane3(key)
    coefficients = plane.planeCoefficients()
    return coefficients[:3], float(coefficients[3]), plane.normal().basis()


def keyframe_plane_factor(
    pose_key: int, plane_key: int, observation: PlaneObservation
) -> gtsam.CustomFactor:
    """A keyframe's observation of a mapped plane, three residuals.

    The mapped plane's normal in the keyframe along the observed plane's two tangents [rad], and the
    distance of the observed centroid from the mapped plane [m].
    """
    first, second = plane_axes(observation.normal)
    rows = np.stack([first, second, observation.centroid])
    noise = gtsam.noiseModel.Gaussian.Covariance(observation.covariance)

    def error(
        factor: gtsam.CustomFactor, values: gtsam.Values, jacobians: list[Array] | None
    ) -> Array:
        T = values.atPose3(pose_key).matrix()
        n, d, basis = plane_of(values, plane_key)
        R, t = T[:3, :3], T[:3, 3]
        n_base = R.T @ n
        residual = rows @ n_base
        residual[2] += d + n @ t
        if jacobians is not None:
            by_pose = np.zeros((3, 6))
            by_pose[:, :3] = rows @ skew(n_base)
            by_pose[2, 3:] = n_base
            by_plane = np.zeros((3, 3))
            by_plane[:, :2] = rows @ (R.T @ basis)
            by_plane[2, :2] += t @ basis
            by_plane[2, 2] = 1.0
            jacobians[0], jacobians[1] = by_pose, by_plane
        return residual

    return gtsam.CustomFactor(noise, [pose_key, plane_key], error)


def room_factor(
    room_key: int,
    plane_keys: Sequence[int],
    pairs: Sequence[tuple[int, int]],
    point: Array,
    noise: gtsam.noiseModel.Base,
) -> gtsam.CustomFactor:
    """A room's centre against its planes (paper eq. 6 and 7), two residuals [m].

    pairs: places in ``plane_keys`` of planes that face each other (two pairs: eq. 6; one: eq. 7).
    point: (3,) where the room's planes were when it was found. Along each pair the centre is the
    middle between the two planes, across all pairs it stays at ``point``. For perpendicular pairs
    that is the published formula, but it neither depends on the map's origin nor is it singular.
    """

    def error(
        factor: gtsam.CustomFactor, values: gtsam.Values, jacobians: list[Array] | None
    ) -> Array:
        planes = [plane_of(values, key) for key in plane_keys]
        residual = values.atPoint2(room_key) - point[:2]
        by_plane = [np.zeros((2, 3)) for _ in planes]
        for i, j in pairs:
            shift, by_i, by_j = middle_shift(planes[i], planes[j], point)
            residual = residual - shift[:2]
            by_plane[i] -= by_i[:2]
            by_plane[j] -= by_j[:2]
        if jacobians is not None:
            jacobians[0] = np.eye(2)
            for place, jacobian in enumerate(by_plane):
                jacobians[place + 1] = jacobian
        return residual

    return gtsam.CustomFactor(noise, [room_key, *plane_keys], error)


def wall_factor(
    wall_key: int, plane_keys: Sequence[int], point: Array, noise: gtsam.noiseModel.Base
) -> gtsam.CustomFactor:
    """A wall's middle against its two faces (the paper's wall cost, eq. 7), three residuals [m]."""

    def error(
        factor: gtsam.CustomFactor, values: gtsam.Values, jacobians: list[Array] | None
    ) -> Array:
        first, second = (plane_of(values, key) for key in plane_keys)
        shift, by_first, by_second = middle_shift(first, second, point)
        if jacobians is not None:
            jacobians[0], jacobians[1], jacobians[2] = np.eye(3), -by_first, -by_second
        return values.atPoint3(wall_key) - point - shift

    return gtsam.CustomFactor(noise, [wall_key, *plane_keys], error)


def middle_shift(
    first: tuple[Array, float, Array], second: tuple[Array, float, Array], point: Array
) -> tuple[Array, Array, Array]:
    """From ``point`` to the middle plane of two opposed planes, along their common normal.

    Returns the shift (3,) and its derivatives (3, 3) by the tangents of either plane.
    """
    (n1, d1, basis1), (n2, d2, basis2) = first, second
    sum_ = n1 - n2
    length = np.linalg.norm(sum_)
    u = sum_ / length
    gap = 0.5 * ((n1 @ point + d1) - (n2 @ point + d2))
    project = (np.eye(3) - np.outer(u, u)) / length
    by_first, by_second = np.zeros((3, 3)), np.zeros((3, 3))
    by_first[:, :2] = -gap * project @ basis1 - 0.5 * np.outer(u, point @ basis1)
    by_first[:, 2] = -0.5 * u
    by_second[:, :2] = gap * project @ basis2 + 0.5 * np.outer(u, point @ basis2)
    by_second[:, 2] = 0.5 * u
    return -gap * u, by_first, by_second
