"""The factors of the layered graph that gtsam lacks, with analytic Jacobians.

Planes are three numbers in their charts (``slam.charts``), poses and points are gtsam's. A Pose3
moves by (rotation, translation) on its right. What a keyframe saw of a plane is compared in the
observed plane's own axes and at the centroid of its points, where the covariance of a fitted plane
is block-diagonal. When they are linearised is decided in ``slam.linearised``.
"""

from __future__ import annotations

from collections.abc import Sequence

import gtsam
import numpy as np

from slam.alignment import differences
from slam.charts import Chart, Charts
from slam.core import Array, plane_axes, skew

PlaneKey = tuple[int, Chart]
"""A plane variable: gtsam's key, and the chart that its three numbers are in."""

Jacobians = list[Array] | None
Plane = tuple[Array, float, Array, Array]
"""Normal (3,), d, and their derivatives (3, 3) and (3,) by the variable."""


class Planes:
    """The plane variables of a factor."""

    def __init__(self, planes: Sequence[PlaneKey]):
        self._keys = [key for key, _ in planes]
        self._charts = Charts.of([chart for _, chart in planes])

    def of(self, values: gtsam.Values) -> tuple[Array, Array, Array, Array]:
        """Normals (N, 3), d (N,) and their derivatives (``Charts.planes``)."""
        return self._charts.planes(np.array([values.atPoint3(key) for key in self._keys]))

    def each(self, values: gtsam.Values) -> list[Plane]:
        """One by one."""
        return list(zip(*self.of(values), strict=True))


def sighting(
    T: Array, rows: Array, whiten: Array, planes: Charts, x: Array
) -> tuple[Array, Array, Array]:
    """What keyframes observed of mapped planes: residuals (N, 3) in standard deviations, and their
    derivatives (N, 3, 6) and (N, 3, 3) by the keyframe's pose and by the plane's coordinates.

    The mapped plane's normal in the keyframe along the observed plane's two tangents, and the
    distance of the observed centroid from the mapped plane. T: (N, 4, 4) T_map_base of the
    keyframes; rows: (N, 3, 3) of the observations; whiten: (N, 3, 3) roots of their information;
    x: (N, 3) coordinates of the planes.
    """
    n, d, by_n, by_d = planes.planes(x)
    residual, by_pose = differences(T, rows, n, d)
    by_plane = (rows @ T[:, :3, :3].transpose(0, 2, 1)) @ by_n
    by_plane[:, 2] += (T[:, None, :3, 3] @ by_n)[:, 0] + by_d
    return (whiten @ residual[:, :, None])[:, :, 0], whiten @ by_pose, whiten @ by_plane


def huber(white: Array, robust: float) -> Array:
    """(N,) weights of residuals (N, M) in standard deviations: less than 1 beyond ``robust``."""
    return robust / np.maximum(np.linalg.norm(white, axis=1), robust)


def plumb_factor(
    pose_key: int, plumb: Array, up: Array, noise: gtsam.noiseModel.Base
) -> gtsam.CustomFactor:
    """A keyframe saw walls that are plumb; two residuals [rad].

    plumb: (3,) unit, up along them in the keyframe; up: (3,) unit, in the map.
    """
    rows = np.stack(plane_axes(plumb))
    turned = skew(rows)

    def error(_: gtsam.CustomFactor, values: gtsam.Values, jacobians: Jacobians) -> Array:
        here = up @ values.atPose3(pose_key).rotation().matrix()
        if jacobians is not None:
            jacobians[0] = np.zeros((2, 6))
            jacobians[0][:, :3] = turned @ here
        return rows @ here

    return gtsam.CustomFactor(noise, [pose_key], error)


def room_factor(
    room_key: int,
    planes: Sequence[PlaneKey],
    pairs: Sequence[tuple[int, int]],
    point: Array,
    noise: gtsam.noiseModel.Base,
) -> gtsam.CustomFactor:
    """A room's centre against its planes (paper eq. 5 and 6), two residuals [m].

    pairs: places in ``planes`` of planes that face each other (two pairs: eq. 5; one: eq. 6).
    point: (3,) where the room's planes were when it was found. Along each pair the centre is the
    middle between the two planes, across all pairs it stays at ``point``. For perpendicular pairs
    that is the published formula, but it neither depends on the map's origin nor is it singular.
    """

    variables = Planes(planes)

    def error(_: gtsam.CustomFactor, values: gtsam.Values, jacobians: Jacobians) -> Array:
        seen = variables.each(values)
        residual = values.atPoint2(room_key) - point[:2]
        by_plane = [np.zeros((2, 3)) for _ in seen]
        for i, j in pairs:
            shift, by_i, by_j = middle_shift(seen[i], seen[j], point)
            residual = residual - shift[:2]
            by_plane[i] -= by_i[:2]
            by_plane[j] -= by_j[:2]
        if jacobians is not None:
            jacobians[0] = np.eye(2)
            for place, jacobian in enumerate(by_plane):
                jacobians[place + 1] = jacobian
        return residual

    return gtsam.CustomFactor(noise, [room_key, *(key for key, _ in planes)], error)


def wall_factor(
    wall_key: int, planes: Sequence[PlaneKey], point: Array, noise: gtsam.noiseModel.Base
) -> gtsam.CustomFactor:
    """A wall's middle against its two faces (the paper's wall cost, eq. 6), three residuals [m]."""

    both = Planes(planes)

    def error(_: gtsam.CustomFactor, values: gtsam.Values, jacobians: Jacobians) -> Array:
        first, second = both.each(values)
        shift, by_first, by_second = middle_shift(first, second, point)
        if jacobians is not None:
            jacobians[0], jacobians[1], jacobians[2] = np.eye(3), -by_first, -by_second
        return values.atPoint3(wall_key) - point - shift

    return gtsam.CustomFactor(noise, [wall_key, *(key for key, _ in planes)], error)


def parallel_factor(
    first: PlaneKey, second: PlaneKey, axes: Array, same: bool, noise: gtsam.noiseModel.Base
) -> gtsam.CustomFactor:
    """Two planes are parallel, facing the same way or away from each other; two residuals [rad].

    axes: (2, 3) two tangents of either plane as it was when the factor was made.
    """
    sign = 1.0 if same else -1.0
    both = Planes([first, second])

    def error(_: gtsam.CustomFactor, values: gtsam.Values, jacobians: Jacobians) -> Array:
        (n1, n2), _d, (by_n1, by_n2), _by_d = both.of(values)
        if jacobians is not None:
            jacobians[0], jacobians[1] = axes @ by_n1, -sign * axes @ by_n2
        return axes @ (n1 - sign * n2)

    return gtsam.CustomFactor(noise, [first[0], second[0]], error)


def perpendicular_factor(
    first: PlaneKey, second: PlaneKey, noise: gtsam.noiseModel.Base
) -> gtsam.CustomFactor:
    """Two planes are perpendicular; one residual, the cosine between them (about radians)."""
    both = Planes([first, second])

    def error(_: gtsam.CustomFactor, values: gtsam.Values, jacobians: Jacobians) -> Array:
        (n1, n2), _d, (by_n1, by_n2), _by_d = both.of(values)
        if jacobians is not None:
            jacobians[0], jacobians[1] = (n2 @ by_n1)[None], (n1 @ by_n2)[None]
        return np.array([n1 @ n2])

    return gtsam.CustomFactor(noise, [first[0], second[0]], error)


def thickness_factor(
    first: PlaneKey,
    second: PlaneKey,
    thickness_key: int,
    point: Array,
    noise: gtsam.noiseModel.Base,
) -> gtsam.CustomFactor:
    """A wall between two faces that look away from each other is as thick as a scalar variable
    says; one residual [m]. point: (3,) between the faces, where the thickness is taken."""
    both = Planes([first, second])

    def error(_: gtsam.CustomFactor, values: gtsam.Values, jacobians: Jacobians) -> Array:
        (n1, n2), (d1, d2), (by_n1, by_n2), (by_d1, by_d2) = both.of(values)
        if jacobians is not None:
            jacobians[0] = -(point @ by_n1 + by_d1)[None]
            jacobians[1] = -(point @ by_n2 + by_d2)[None]
            jacobians[2] = np.array([[-1.0]])
        return np.array([-((n1 + n2) @ point + d1 + d2) - values.atDouble(thickness_key)])

    return gtsam.CustomFactor(noise, [first[0], second[0], thickness_key], error)


def middle_shift(first: Plane, second: Plane, point: Array) -> tuple[Array, Array, Array]:
    """From ``point`` to the middle plane of two opposed planes, along their common normal.

    Returns the shift (3,) and its derivatives (3, 3) by either plane's variable.
    """
    (n1, d1, by_n1, by_d1), (n2, d2, by_n2, by_d2) = first, second
    sum_ = n1 - n2
    length = np.linalg.norm(sum_)
    u = sum_ / length
    gap = 0.5 * ((n1 @ point + d1) - (n2 @ point + d2))
    project = (np.eye(3) - np.outer(u, u)) / length
    by_first = -gap * project @ by_n1 - 0.5 * np.outer(u, point @ by_n1 + by_d1)
    by_second = gap * project @ by_n2 + 0.5 * np.outer(u, point @ by_n2 + by_d2)
    return -gap * u, by_first, by_second
