"""Tracking: every scan's pose against the planes seen lately.

An odometry that matches points jitters from scan to scan by centimetres where 16 beams see little.
The walls and the floor of the last keyframes do not, so each pose is refined until the scan's
points lie on them. What the planes leave open (the way along a corridor) stays as the odometry has
it. The planes are kept in the tracker's own frame and forgotten after a while: this is no map.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from slam.core import (
    Array,
    IntArray,
    PlaneObservation,
    Scan,
    inverse,
    orthonormal,
    pose,
    so3_exp,
    so3_log,
    transform_points,
    yaw_of,
)
from slam.correspondence import Candidates, PlaneStack
from slam.localplanes import LocalPlaneConfig, LocalPlanes
from slam.odometry import Stamped, deskew
from slam.plumb import Up

Sigmas = tuple[float, float, float, float, float, float]


@dataclass(frozen=True)
class TrackingConfig:
    """points: how many returns of a scan are used; gates [m]: largest distance to a plane, one per
    iteration, and level_gate for floors and ceilings; margin [m]: how far beyond its extent a plane
    is believed in; point_sigma [m]: of a return, plane_sigma [m]: of a plane, however many returns
    lie on it; *_sigma: how far (turns about x, y, z [rad], shifts along x, y, z [m]) the
    pose at the sweep's end may lie from the odometry's, that at its start from the last sweep's
    end, and the motion between them from that of the last sweep. memory: scans within which a pose
    that has turned away from the odometry's by doubt [rad] is given up for it if that explains
    clearly more of the scan, by this factor. askew: a pose that much off plumb
    [rad], by the walls of a keyframe, is turned, and within so many keyframes (wary) after that one
    that is the second much off.
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
    memory: int = 8
    doubt: float = np.radians(2.5)
    clearly: float = 1.1
    askew: tuple[float, float] = (np.radians(2.0), np.radians(0.5))
    wary: int = 15
    planes: LocalPlaneConfig = field(default_factory=LocalPlaneConfig)


class PlaneTracker:
    """Refines the odometry's poses, scan by scan. The tracker's frame is ``odom`` at the start."""

    def __init__(self, config: TrackingConfig = TrackingConfig()):
        self._config = config
        self._planes = LocalPlanes(config.planes)
        self._stack = PlaneStack(())
        self._weights = _Weights(config)
        self._prior = self._weights.information()
        self._T_track_odom = np.eye(4)
        self._ends: list[Stamped] = []
        self._motion = np.eye(4)
        self._up = Up()
        self._wary = 0
        self._learned_at = np.zeros(3)
        self._lately: list[tuple[Array, Array]] = []  # T_track_base, T_odom_base of the last scans

    def track(self, scan: Scan, T_odom_base: Array) -> Array:
        """T_track_base (4, 4) at the sweep's end."""
        T = self._T_track_odom @ T_odom_base
        if self._ends:
            stamp, T_last = self._ends[-1]
            steady = T_last @ self._motion
            start, T = self._refine(scan, stamp, T_last, steady, _kept_level(T_last, T))
            start, T = self._believed(scan, stamp, start, T, T_odom_base)
            self._motion = inverse(start) @ T
            self._ends = [(stamp, start), (scan.stamp, T)]
        else:
            self._ends = [(scan.stamp, T)]
        self._T_track_odom = orthonormal(T @ inverse(T_odom_base))
        self._lately = [*self._lately[1 - self._config.memory :], (T, T_odom_base)]
        return T

    def deskew(self, scan: Scan) -> Array:
        """Points (N, 3) of the scan tracked last, base frame at the sweep's end."""
        return deskew(scan, self._ends)

    @property
    def latest(self) -> Array:
        """T_track_base (4, 4) at the end of the scan tracked last."""
        return self._ends[-1][1]

    def learn(self, planes: tuple[PlaneObservation, ...], plumb: Array | None = None) -> None:
        """Takes in what a keyframe, the scan tracked last, observed. plumb: see ``KeyframeScan``;
        it may turn the ``latest``."""
        if plumb is not None:
            self._set_upright(plumb)
        self._planes.learn(planes, self.latest)
        self._stack = PlaneStack(tuple(self._planes))
        self._learned_at = self.latest[:3, 3]

    def _set_upright(self, plumb: Array) -> None:
        """Turns the pose where it is clearly askew by what the walls say.

        A base that comes onto a ramp takes the floor with it: the ramp under it looks as the floor
        did, and the poses stay level. The way since the last keyframe is turned by half.
        """
        up = self._up.compared(self.latest, plumb)
        if up is None:
            return
        turn = np.cross(self.latest[:3, :3] @ plumb, up)  # by its sine: of a few degrees
        self._wary -= 1
        if float(np.linalg.norm(turn)) < self._config.askew[0 if self._wary < 0 else 1]:
            return
        self._wary = self._config.wary
        half, whole = so3_exp(0.5 * turn), so3_exp(turn)
        place = self._learned_at + half @ (self.latest[:3, 3] - self._learned_at)
        corrected = pose(whole, place - whole @ self.latest[:3, 3])
        self._ends = [(stamp, corrected @ end) for stamp, end in self._ends]
        self._T_track_odom = orthonormal(corrected @ self._T_track_odom)
        self._lately = [(self.latest, self._lately[-1][1])]

    def _believed(
        self, scan: Scan, stamp: float, start: Array, end: Array, T_odom_base: Array
    ) -> tuple[Array, Array]:
        """A sweep's refined start and end, or those refined from where the odometry says.

        The planes of one room, taken to go on into the next, and a floor that becomes a ramp lead
        the pose away, a degree with each scan. Where it has left the odometry's way, the scan's
        points decide; odometries that match points go astray as well.
        """
        T_track_then, T_odom_then = self._lately[0]
        T_track_odom = T_track_then @ inverse(T_odom_then)
        said, said_last = T_track_odom @ T_odom_base, T_track_odom @ self._lately[-1][1]
        turned = so3_log(said[:3, :3].T @ end[:3, :3])
        if float(np.linalg.norm(turned)) < self._config.doubt or not len(self._stack):
            return start, end
        other = self._refine(scan, stamp, said_last, said, said)
        mine, theirs = (self._explained(scan, stamp, *ends) for ends in ((start, end), other))
        if theirs < self._config.clearly * mine:
            return start, end
        self._lately = [(T_track_odom @ odom, odom) for _, odom in self._lately]
        return other

    def _explained(self, scan: Scan, stamp: float, start: Array, end: Array) -> int:
        """How many points of a scan lie on walls, the base having moved from start to end; the
        floor under the base fits whatever its tilt."""
        config = self._config
        sample = _sample(scan, config.points)
        points = transform_points(end, deskew(sample, [(stamp, start), (scan.stamp, end)])).T
        origin = transform_points(end, scan.T_base_lidar[:3, 3])
        gate = config.gates[-1]
        candidates = Candidates(self._stack, points, origin, gate, config.margin)
        _, which, _ = candidates.correspond(points, gate, config.level_gate)
        return int((~self._stack.level[which]).sum())

    def _refine(
        self, scan: Scan, stamp: float, T_last: Array, steady: Array, T_odom: Array
    ) -> tuple[Array, Array]:
        """T_track_base at the sweep's start and at its end, from where each is expected; steady:
        the end if the base goes on as before.

        Both are free: a start that is held where the last sweep ended makes every error return with
        the other sign in the next sweep. A loose one is worse: beams that are differently off make
        a corridor look wider or narrower, and a motion across it within the sweep would explain
        that. Gauss-Newton; correspondences are renewed at each step.
        """
        config = self._config
        if not len(self._stack):
            return T_last, T_odom
        start, end = T_last, steady
        sample = _sample(scan, config.points)
        elapsed = 1.0 + sample.times / (scan.stamp - stamp)
        ends = [(stamp, start), (scan.stamp, end)]
        points = np.ascontiguousarray(transform_points(end, deskew(sample, ends)).T)
        origin = transform_points(end, scan.T_base_lidar[:3, 3])
        candidates = Candidates(self._stack, points, origin, config.gates[0], config.margin)
        for gate in config.gates:
            used, which, distance = candidates.correspond(points, gate, config.level_gate)
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


def _sample(scan: Scan, count: int) -> Scan:
    """About so many returns within 20 m, of beams and azimuths evenly."""
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
