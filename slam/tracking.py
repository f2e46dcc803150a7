"""Tracking: every scan's pose against the planes seen lately.

An odometry that matches points jitters from scan to scan by centimetres where 16 beams see little.
The walls and the floor of the last keyframes do not, so each pose is refined until the scan's
points lie on them. What the planes leave open (the way along a corridor) stays as the odometry has
it. The planes are kept in the tracker's own frame and forgotten after a while: this is no map.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from slam.core import (
    Array,
    IntArray,
    PlaneObservation,
    Scan,
    inverse,
    orthonormal,
    plane_axes,
    pose,
    so3_exp,
    transform_plane,
    transform_points,
    yaw_of,
)
from slam.odometry import Stamped, deskew


@dataclass(frozen=True)
class TrackingConfig:
    """points: how many returns of a scan are used; gates [m]: largest distance to a plane, one per
    iteration, and level_gate for floors and ceilings; margin [m]: how far beyond its extent a plane
    is believed in; point_sigma [m]: of a return, plane_sigma [m]: of a plane, however many returns
    lie on it; prior_*: of the predicted pose, which has heading and place from the
    odometry, tilt and height from the last scan; keep: keyframes after
    which an unseen plane is forgotten; match_*: an observation is of a known plane within these;
    observed_*: added to an observation's own standard deviations, for the pose it was seen from.
    """

    points: int = 2500
    gates: tuple[float, ...] = (0.20, 0.10, 0.06)
    level_gate: float = 0.04
    margin: float = 0.2
    point_sigma: float = 0.02
    plane_sigma: float = 0.004
    prior_rotation: tuple[float, float, float] = (0.007, 0.007, 0.0175)
    prior_translation: tuple[float, float, float] = (0.03, 0.03, 0.01)
    keep: int = 40
    match_angle: float = np.radians(5.0)
    match_distance: float = 0.10
    match_reach: float = 1.0
    observed_rotation: float = np.radians(0.1)
    observed_distance: float = 0.004


@dataclass
class _LocalPlane:
    """A plane in the tracker's frame, with a covariance at its centroid (``PlaneObservation``), its
    extent along its level axis and in height, and the keyframe that saw it last."""

    normal: Array
    centroid: Array
    covariance: Array
    span: Array
    height: Array
    seen: int


class PlaneTracker:
    """Refines the odometry's poses, scan by scan. The tracker's frame is ``odom`` at the start."""

    def __init__(self, config: TrackingConfig = TrackingConfig()):
        self._config = config
        self._planes: list[_LocalPlane] = []
        self._T_track_odom = np.eye(4)
        self._ends: list[Stamped] = []
        self._keyframes = 0

    def track(self, scan: Scan, T_odom_base: Array) -> Array:
        """T_track_base (4, 4) at the sweep's end."""
        T = self._T_track_odom @ T_odom_base
        if self._planes:
            T = self._refine(scan, _kept_level(self._ends[-1][1], T))
        self._T_track_odom = orthonormal(T @ inverse(T_odom_base))
        self._ends = [*self._ends[-1:], (scan.stamp, T)]
        return T

    def deskew(self, scan: Scan) -> Array:
        """Points (N, 3) of the scan tracked last, base frame at the sweep's end."""
        return deskew(scan, self._ends)

    def learn(self, planes: tuple[PlaneObservation, ...]) -> None:
        """Takes in what a keyframe, the scan tracked last, observed."""
        self._keyframes += 1
        for observation in planes:
            self._learn(observation, self._ends[-1][1])
        oldest = self._keyframes - self._config.keep
        self._planes = [plane for plane in self._planes if plane.seen >= oldest]

    # --- the pose ---

    def _refine(self, scan: Scan, T: Array) -> Array:
        """Gauss-Newton on point-to-plane distances; correspondences are renewed at each step."""
        config = self._config
        sample = _sample(scan, config.points)
        predicted = T
        for gate in config.gates:
            points = deskew(sample, [*self._ends[-1:], (scan.stamp, T)])
            moved = transform_points(T, points)
            origin = transform_points(T, scan.T_base_lidar[:3, 3])
            which, distance = self._correspond(moved, origin, gate)
            if len(which) == 0:
                return predicted
            T = self._step(T, predicted, moved, which, distance)
        return orthonormal(T)

    def _correspond(self, points: Array, origin: Array, gate: float) -> tuple[IntArray, Array]:
        """For each point the place of its plane or -1, and its distance [m] from that plane."""
        config = self._config
        normals = np.array([plane.normal for plane in self._planes])
        offsets = -np.einsum(
            "pi,pi->p", normals, np.array([plane.centroid for plane in self._planes])
        )
        axes = np.array([plane_axes(plane.normal)[0] for plane in self._planes])
        span = np.array([plane.span for plane in self._planes])
        height = np.array([plane.height for plane in self._planes])
        level = np.abs(normals[:, 2]) > 0.7
        distance = points @ normals.T + offsets
        along = points @ axes.T
        # The feet of walls that are not known yet must not pass for floor.
        fits = np.abs(distance) < np.where(level, np.minimum(gate, config.level_gate), gate)
        fits &= normals @ origin + offsets > 0.1
        inside = (along > span[:, 0] - config.margin) & (along < span[:, 1] + config.margin)
        inside &= (points[:, 2:] > height[:, 0] - config.margin) & (
            points[:, 2:] < height[:, 1] + config.margin
        )
        fits &= inside | level
        unique = fits.sum(axis=1) == 1  # a point in a corner could be on either wall
        which = np.where(unique, fits.argmax(axis=1), -1)
        return which, distance[np.arange(len(points)), which]

    def _step(
        self, T: Array, predicted: Array, points: Array, which: IntArray, distance: Array
    ) -> Array:
        """One Gauss-Newton step; motion about the base, in the tracker's axes."""
        config = self._config
        used = np.flatnonzero(which >= 0)
        if len(used) < 50:
            return T
        count = np.bincount(which[used], minlength=len(self._planes))
        normal = np.array([plane.normal for plane in self._planes])[which[used]]
        arm = points[used] - T[:3, 3]
        jacobian = np.hstack([np.cross(arm, normal), normal])
        variance = config.point_sigma**2 + count[which[used]] * config.plane_sigma**2
        weight = 1.0 / variance
        sigma = np.array([*config.prior_rotation, *config.prior_translation])
        information = (jacobian * weight[:, None]).T @ jacobian + np.diag(sigma**-2.0)
        away = T @ inverse(predicted)
        gone = np.append(_small_rotation(away[:3, :3]), T[:3, 3] - predicted[:3, 3])
        right = -(jacobian * weight[:, None]).T @ distance[used] - gone / sigma**2
        step = np.linalg.solve(information, right)
        return pose(so3_exp(step[:3]) @ T[:3, :3], T[:3, 3] + step[3:])

    # --- the planes ---

    def _learn(self, observation: PlaneObservation, T: Array) -> None:
        config = self._config
        normal, d = transform_plane(T, observation.normal, observation.d)
        centroid = transform_points(T, observation.centroid)
        points = transform_points(T, observation.points)
        extra = [config.observed_rotation**2] * 2 + [config.observed_distance**2]
        # Residuals tell how far the true normal lies from the observed one; here it is reversed.
        reverse = np.diag([-1.0, -1.0, 1.0])
        covariance = reverse @ observation.covariance @ reverse + np.diag(extra)
        for plane in self._planes:
            if self._same(plane, normal, centroid, points):
                _update(plane, normal, d, centroid, covariance)
                break
        else:
            empty = np.array([np.inf, -np.inf])
            plane = _LocalPlane(normal, centroid, covariance, empty, empty, 0)
            self._planes.append(plane)
        along = points @ plane_axes(plane.normal)[0]
        plane.span = _grown(plane.span, along)
        plane.height = _grown(plane.height, points[:, 2])
        plane.seen = self._keyframes

    def _same(self, plane: _LocalPlane, normal: Array, centroid: Array, points: Array) -> bool:
        config = self._config
        if plane.normal @ normal < np.cos(config.match_angle):
            return False
        if abs(plane.normal @ (centroid - plane.centroid)) > config.match_distance:
            return False
        along = points @ plane_axes(plane.normal)[0]
        gap = max(along.min() - plane.span[1], plane.span[0] - along.max())
        return bool(gap < config.match_reach or abs(normal[2]) > 0.7)


def _sample(scan: Scan, count: int) -> Scan:
    """Every so-manieth return, beams and azimuths evenly."""
    use = np.flatnonzero(np.einsum("ni,ni->n", scan.points, scan.points) < 20.0**2)
    use = use[:: max(1, len(use) // count)]
    return Scan(
        scan.index,
        scan.stamp,
        scan.points[use],
        scan.times[use],
        scan.ring[use],
        scan.intensity[use],
        scan.T_base_lidar,
    )


def _kept_level(T_last: Array, T: Array) -> Array:
    """The pose T with the tilt and the height of the last one: a base in a room keeps both, and an
    odometry that sees little floor does not."""
    turn = so3_exp(np.array([0.0, 0.0, yaw_of(T) - yaw_of(T_last)]))
    return pose(turn @ T_last[:3, :3], np.array([T[0, 3], T[1, 3], T_last[2, 3]]))


def _small_rotation(rotation: Array) -> Array:
    """Rotation vector (3,) of a rotation by a few degrees."""
    return 0.5 * np.array(
        [
            rotation[2, 1] - rotation[1, 2],
            rotation[0, 2] - rotation[2, 0],
            rotation[1, 0] - rotation[0, 1],
        ]
    )


def _grown(interval: Array, values: Array) -> Array:
    """The interval that also holds the bulk of the values."""
    low, high = np.percentile(values, [1.0, 99.0])
    return np.array([min(interval[0], low), max(interval[1], high)])


def _update(
    plane: _LocalPlane, normal: Array, d: float, centroid: Array, covariance: Array
) -> None:
    """Kalman update of a plane by another estimate of it, in the plane's axes at its centroid.

    State: turns of the normal towards both tangents, and the plane's offset along its normal.
    """
    first, second = plane_axes(plane.normal)
    lever = plane.centroid - centroid
    measured = np.array([first @ normal, second @ normal, -(normal @ plane.centroid + d)])
    carry = np.eye(3)
    carry[2, :2] = -first @ lever, -second @ lever
    innovation = plane.covariance + carry @ covariance @ carry.T
    gain = plane.covariance @ np.linalg.inv(innovation)
    change = gain @ measured
    plane.covariance = (np.eye(3) - gain) @ plane.covariance
    plane.centroid = plane.centroid + change[2] * plane.normal
    turned = plane.normal + change[0] * first + change[1] * second
    plane.normal = turned / np.linalg.norm(turned)
