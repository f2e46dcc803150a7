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

Sigmas = tuple[float, float, float, float, float, float]


@dataclass(frozen=True)
class TrackingConfig:
    """points: how many returns of a scan are used; gates [m]: largest distance to a plane, one per
    iteration, and level_gate for floors and ceilings; margin [m]: how far beyond its extent a plane
    is believed in; point_sigma [m]: of a return, plane_sigma [m]: of a plane, however many returns
    lie on it; *_sigma: how far (turns about x, y, z [rad], shifts along x, y, z [m]) the
    pose at the sweep's end may lie from the odometry's, that at its start from the last sweep's
    end, and the motion between them from that of the last sweep; keep: keyframes after
    which an unseen plane is forgotten; match_*: an observation is of a known plane within these;
    observed_*: added to an observation's own standard deviations, for the pose it was seen from.
    """

    points: int = 2000
    gates: tuple[float, ...] = (0.20, 0.10, 0.06)
    level_gate: float = 0.04
    margin: float = 0.2
    point_sigma: float = 0.02
    plane_sigma: float = 0.004
    odometry_sigma: Sigmas = (0.007, 0.007, 0.05, 0.05, 0.05, 0.01)
    last_sigma: Sigmas = (0.003, 0.003, 0.003, 0.003, 0.003, 0.003)
    motion_sigma: Sigmas = (0.004, 0.004, 0.015, 0.006, 0.006, 0.003)
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


class _Stack:
    """The planes as arrays over P: normals (P, 3), offsets, level axes, extents, and which of them
    are floors or ceilings."""

    def __init__(self, planes: list[_LocalPlane]):
        self.normals = np.array([plane.normal for plane in planes]).reshape(-1, 3)
        centroids = np.array([plane.centroid for plane in planes]).reshape(-1, 3)
        self._offsets = -np.einsum("pi,pi->p", self.normals, centroids)
        self._axes = np.array([plane_axes(plane.normal)[0] for plane in planes]).reshape(-1, 3)
        self._span = np.array([plane.span for plane in planes]).reshape(-1, 2)
        self._height = np.array([plane.height for plane in planes]).reshape(-1, 2)
        self._level = np.abs(self.normals[:, 2]) > 0.7

    def correspond(
        self, points: Array, origin: Array, gate: float, config: TrackingConfig
    ) -> tuple[IntArray, IntArray, Array]:
        """Places of the points (N, 3) that lie on one plane, which, and how far off it [m]."""
        # The feet of walls that are not known yet must not pass for floor.
        gates = np.where(self._level, np.minimum(gate, config.level_gate), gate)
        gates[self.normals @ origin + self._offsets <= 0.1] = -1.0
        distance = points @ self.normals.T + self._offsets
        place, plane = np.nonzero(np.abs(distance) < gates)
        near = points[place]
        along = np.einsum("ci,ci->c", near, self._axes[plane])
        span, height = self._span[plane], self._height[plane]
        inside = (along > span[:, 0] - config.margin) & (along < span[:, 1] + config.margin)
        inside &= near[:, 2] > height[:, 0] - config.margin
        inside &= near[:, 2] < height[:, 1] + config.margin
        inside |= self._level[plane]
        place, plane = place[inside], plane[inside]
        # A point in a corner could be on either wall.
        alone = np.bincount(place, minlength=len(points))[place] == 1
        place, plane = place[alone], plane[alone]
        return place, plane, distance[place, plane]


class PlaneTracker:
    """Refines the odometry's poses, scan by scan. The tracker's frame is ``odom`` at the start."""

    def __init__(self, config: TrackingConfig = TrackingConfig()):
        self._config = config
        self._planes: list[_LocalPlane] = []
        self._stack = _Stack([])
        self._T_track_odom = np.eye(4)
        self._ends: list[Stamped] = []
        self._motion = np.eye(4)
        self._keyframes = 0

    def track(self, scan: Scan, T_odom_base: Array) -> Array:
        """T_track_base (4, 4) at the sweep's end."""
        T = self._T_track_odom @ T_odom_base
        if self._ends:
            stamp, T_last = self._ends[-1]
            start, T = self._refine(scan, stamp, T_last, _kept_level(T_last, T))
            self._motion = orthonormal(inverse(start) @ T)
            self._ends = [(stamp, start), (scan.stamp, T)]
        else:
            self._ends = [(scan.stamp, T)]
        self._T_track_odom = orthonormal(T @ inverse(T_odom_base))
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
        self._stack = _Stack(self._planes)

    # --- the pose ---

    def _refine(
        self, scan: Scan, stamp: float, T_last: Array, T_odom: Array
    ) -> tuple[Array, Array]:
        """T_track_base at the sweep's start and at its end.

        Both are free: a start that is held where the last sweep ended makes every error return with
        the other sign in the next sweep. A loose one is worse: beams that are differently off make
        a corridor look wider or narrower, and a motion across it within the sweep would explain
        that. Gauss-Newton; correspondences are renewed at each step.
        """
        config = self._config
        steady = T_last @ self._motion
        if not self._planes:
            return T_last, T_odom
        start, end = T_last, steady
        sample = _sample(scan, config.points)
        elapsed = 1.0 + sample.times / (scan.stamp - stamp)
        points = transform_points(end, deskew(sample, [(stamp, start), (scan.stamp, end)]))
        for gate in config.gates:
            origin = transform_points(end, scan.T_base_lidar[:3, 3])
            used, which, distance = self._stack.correspond(points, origin, gate, config)
            equations = self._prior(start, end, T_last, steady, T_odom)
            lever = points - end[:3, 3]
            self._add_points(equations, lever[used], which, distance, elapsed[used])
            step = equations.solve()
            start, end = _moved(start, step[:6]), _moved(end, step[6:])
            # To first order, as the equations have it: a step turns by a fraction of a degree.
            twist = step[:6] + elapsed[:, None] * (step[6:] - step[:6])
            points += _cross(twist[:, :3], lever) + twist[:, 3:]
        return orthonormal(start), orthonormal(end)

    def _prior(
        self, start: Array, end: Array, T_last: Array, steady: Array, T_odom: Array
    ) -> _NormalEquations:
        """What is known of both poses before the points are looked at."""
        config = self._config
        equations = _NormalEquations(np.zeros((12, 12)), np.zeros(12))
        one, none = np.eye(6), np.zeros((6, 6))
        start_off, end_off = _apart(start, T_last), _apart(end, steady)
        equations.add(np.hstack([none, one]), _apart(end, T_odom), config.odometry_sigma)
        equations.add(np.hstack([one, none]), start_off, config.last_sigma)
        equations.add(np.hstack([-one, one]), end_off - start_off, config.motion_sigma)
        return equations

    def _add_points(
        self,
        equations: _NormalEquations,
        lever: Array,
        which: IntArray,
        distance: Array,
        elapsed: Array,
    ) -> None:
        """Distances of points from their planes; each moves with both poses, by its time. lever:
        (M, 3) from the base to the points."""
        config = self._config
        count = np.bincount(which, minlength=len(self._planes))
        normal = self._stack.normals[which]
        row = np.hstack([_cross(lever, normal), normal])
        weight = 1.0 / (config.point_sigma**2 + count[which] * config.plane_sigma**2)
        jacobian = np.hstack([(1.0 - elapsed[:, None]) * row, elapsed[:, None] * row])
        weighted = jacobian * weight[:, None]
        equations.information += weighted.T @ jacobian
        equations.right -= distance @ weighted

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
    use = np.arange(0, len(scan), max(1, len(scan) // count) | 1)  # even: would leave out beams
    points = scan.points[use]
    use = use[np.einsum("ni,ni->n", points, points) < 20.0**2]
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


@dataclass
class _NormalEquations:
    """information (12, 12) x step = right (12,), the step of start and end."""

    information: Array
    right: Array

    def add(self, jacobian: Array, residual: Array, sigma: Sigmas) -> None:
        """A residual (6,) with derivative (6, 12) and standard deviations."""
        weighted = jacobian / np.square(sigma)[:, None]
        self.information += weighted.T @ jacobian
        self.right -= weighted.T @ residual

    def solve(self) -> Array:
        """The step (12,)."""
        return np.asarray(np.linalg.solve(self.information, self.right), dtype=np.float64)


def _cross(a: Array, b: Array) -> Array:
    """Row by row (N, 3); numpy's own takes ten times as long."""
    (ax, ay, az), (bx, by, bz) = a.T, b.T
    return np.stack([ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx], axis=1)


def _moved(T: Array, step: Array) -> Array:
    """A pose turned about its own place, in the tracker's axes, and shifted."""
    return pose(so3_exp(step[:3]) @ T[:3, :3], T[:3, 3] + step[3:])


def _apart(T: Array, other: Array) -> Array:
    """(6,) the step that takes ``other`` to T, for turns of a few degrees."""
    turn = T[:3, :3] @ other[:3, :3].T
    vee = 0.5 * np.array(
        [turn[2, 1] - turn[1, 2], turn[0, 2] - turn[2, 0], turn[1, 0] - turn[0, 1]]
    )
    return np.append(vee, T[:3, 3] - other[:3, 3])


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
