"""Tracking: every scan's pose against the planes seen lately.

An odometry that matches points jitters from scan to scan by centimetres where 16 beams see little.
The walls and the floor of the last keyframes do not, so each pose is refined until the scan's
points lie on them. What the planes leave open (the way along a corridor) stays as the odometry has
it. The planes are kept in the tracker's own frame and forgotten after a while: this is no map.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

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
        self.offsets = -np.einsum("pi,pi->p", self.normals, centroids)
        self.axes = np.array([plane_axes(plane.normal)[0] for plane in planes]).reshape(-1, 3)
        self.span = np.array([plane.span for plane in planes]).reshape(-1, 2)
        self.height = np.array([plane.height for plane in planes]).reshape(-1, 2)
        self.level = np.abs(self.normals[:, 2]) > 0.7

    def __len__(self) -> int:
        return len(self.normals)


class _Candidates:
    """Which of a scan's points (3, N) may lie on which of the planes that face it: all that do
    within ``reach`` now, hence all that will within less once the points have moved a little."""

    def __init__(self, stack: _Stack, points: Array, origin: Array, reach: float):
        near = np.abs((stack.normals @ points).T + stack.offsets) < reach
        near &= stack.normals @ origin + stack.offsets > 0.1
        self._place, plane = np.nonzero(near)
        self._plane = plane
        self._normals, self._offsets = stack.normals.T.take(plane, axis=1), stack.offsets[plane]
        self._axes, self._level = stack.axes.T.take(plane, axis=1), stack.level[plane]
        self._span, self._height = stack.span[plane].T, stack.height[plane].T

    def correspond(
        self, points: Array, gate: float, config: TrackingConfig
    ) -> tuple[IntArray, IntArray, Array]:
        """Places of the points that lie on one plane, which, and how far off it [m]."""
        near = points.take(self._place, axis=1)
        distance = np.einsum("ic,ic->c", near, self._normals) + self._offsets
        along = np.einsum("ic,ic->c", near, self._axes)
        inside = _within(along, self._span, config.margin)
        inside &= _within(near[2], self._height, config.margin)
        inside |= self._level
        # The feet of walls that are not known yet must not pass for floor.
        gates = np.where(self._level, min(gate, config.level_gate), gate)
        use = np.flatnonzero(inside & (np.abs(distance) < gates))
        place = self._place[use]
        # A point in a corner could be on either wall.
        alone = np.bincount(place, minlength=points.shape[1])[place] == 1
        use = use[alone]
        return self._place[use], self._plane[use], distance[use]


def _within(values: Array, ends: Array, margin: float) -> NDArray[np.bool_]:
    """Which of the values (N,) lie between their ends (2, N), or less than a margin beyond."""
    return (values > ends[0] - margin) & (values < ends[1] + margin)


class PlaneTracker:
    """Refines the odometry's poses, scan by scan. The tracker's frame is ``odom`` at the start."""

    def __init__(self, config: TrackingConfig = TrackingConfig()):
        self._config = config
        self._planes: list[_LocalPlane] = []
        self._stack = _Stack([])
        self._weights = _Weights(config)
        self._prior = self._weights.information()
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
            self._motion = inverse(start) @ T
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
        ends = [(stamp, start), (scan.stamp, end)]
        points = np.ascontiguousarray(transform_points(end, deskew(sample, ends)).T)
        origin = transform_points(end, scan.T_base_lidar[:3, 3])
        candidates = _Candidates(self._stack, points, origin, config.gates[0])
        for gate in config.gates:
            used, which, distance = candidates.correspond(points, gate, config)
            lever = points - end[:3, 3:]
            information, right = self._seen(lever[:, used], which, distance, elapsed[used])
            right -= self._expected(start, end, T_last, steady, T_odom)
            step = np.asarray(np.linalg.solve(self._prior + information, right), np.float64)
            start, end = _moved(start, end, step)
            # To first order, as the equations have it: a step turns by a fraction of a degree.
            twist = step[:6, None] + elapsed * (step[6:] - step[:6])[:, None]
            points += _cross(twist[:3], lever) + twist[3:]
        return orthonormal(start), orthonormal(end)

    def _expected(
        self, start: Array, end: Array, T_last: Array, steady: Array, T_odom: Array
    ) -> Array:
        """(12,) what pulls both poses away from what is known before the points are looked at."""
        start_off, end_off = _apart(start, T_last), _apart(end, steady)
        pull = self._weights.motion * (end_off - start_off)
        at_start = self._weights.last * start_off - pull
        return np.append(at_start, self._weights.odometry * _apart(end, T_odom) + pull)

    def _seen(
        self, lever: Array, which: IntArray, distance: Array, elapsed: Array
    ) -> tuple[Array, Array]:
        """Information (12, 12) and right side (12,) of the distances of points from their planes;
        each moves with both poses, by its time. lever: (3, M) from the base to the points."""
        config = self._config
        count = np.bincount(which, minlength=len(self._stack))
        weight = 1.0 / (config.point_sigma**2 + count[which] * config.plane_sigma**2)
        normal = self._stack.normals.T.take(which, axis=1)
        column = np.concatenate([_cross(lever, normal), normal])
        jacobian = np.concatenate([(1.0 - elapsed) * column, elapsed * column])
        weighted = weight * jacobian
        return weighted @ jacobian.T, -weighted @ distance

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


class _Weights:
    """Inverse variances (6,) of what is known before the points are looked at."""

    def __init__(self, config: TrackingConfig):
        self.odometry = 1.0 / np.square(config.odometry_sigma)
        self.last = 1.0 / np.square(config.last_sigma)
        self.motion = 1.0 / np.square(config.motion_sigma)

    def information(self) -> Array:
        """(12, 12) of the poses at the start and at the end."""
        motion = np.diag(self.motion)
        at_start, at_end = np.diag(self.last) + motion, np.diag(self.odometry) + motion
        return np.block([[at_start, -motion], [-motion, at_end]])


def _cross(a: Array, b: Array) -> Array:
    """Column by column (3, N); numpy's own takes ten times as long."""
    (ax, ay, az), (bx, by, bz) = a, b
    return np.stack([ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx])


def _moved(start: Array, end: Array, step: Array) -> tuple[Array, Array]:
    """Both poses turned about their own places, in the tracker's axes, and shifted."""
    first, second = so3_exp(step.reshape(2, 6)[:, :3])
    return (
        pose(first @ start[:3, :3], start[:3, 3] + step[3:6]),
        pose(second @ end[:3, :3], end[:3, 3] + step[9:]),
    )


def _apart(T: Array, other: Array) -> Array:
    """(6,) the step that takes ``other`` to T, for turns of a few degrees."""
    turn = T[:3, :3] @ other[:3, :3].T
    vee = 0.5 * np.array(
        [turn[2, 1] - turn[1, 2], turn[0, 2] - turn[2, 0], turn[1, 0] - turn[0, 1]]
    )
    return np.append(vee, T[:3, 3] - other[:3, 3])


def _grown(interval: Array, values: Array) -> Array:
    """The interval that also holds the bulk of the values (N,): from their first to their 99th
    percentile."""
    places = np.array([0.01, 0.99]) * (len(values) - 1)
    below = places.astype(np.int64)
    above = np.minimum(below + 1, len(values) - 1)
    ordered = np.partition(values, [*below, *above])  # np.percentile takes five times as long
    low, high = ordered[below] + (places - below) * (ordered[above] - ordered[below])
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
