"""The words every package shares: errors, rigid motions, planes, scans, and what is mapped.

A leaf: it imports numpy and ``slam/geometry.py`` only, which it hands on, so every package may
import it. Metres, radians, seconds, z up, right-handed. ``T_a_b`` is a (4, 4) float64 matrix
that maps coordinates in frame b to frame a.
Frames: ``world`` (the simulator's truth), ``map`` (estimates), ``odom``, ``base``, ``lidar``.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Protocol, runtime_checkable

import numpy as np
from numpy.typing import NDArray

from slam.geometry import (
    HORIZONTAL,
    Array,
    Floats,
    interpolate,
    inverse,
    orthonormal,
    plane_axes,
    pose,
    quaternion_log,
    quaternion_xyzw,
    rotate,
    rotation_from_quaternion_xyzw,
    skew,
    so3_exp,
    so3_log,
    transform_plane,
    transform_points,
    yaw_of,
)

__all__ = [
    "HORIZONTAL",
    "POINT_ID_STRIDE",
    "Array",
    "Detector",
    "DetectorFactory",
    "Floats",
    "Frame",
    "InputError",
    "IntArray",
    "Keyframe",
    "KeyframeScan",
    "Linking",
    "Links",
    "MapPlane",
    "MapView",
    "Odometry",
    "PlaneObservation",
    "PlanePiece",
    "Proposals",
    "RoomProposal",
    "RoomloopError",
    "RunError",
    "Scan",
    "WallProposal",
    "WheelOdometry",
    "cores",
    "interpolate",
    "inverse",
    "orthonormal",
    "plane_axes",
    "point_ids",
    "pose",
    "quaternion_log",
    "quaternion_xyzw",
    "rotate",
    "rotation_from_quaternion_xyzw",
    "skew",
    "so3_exp",
    "so3_log",
    "thread_limit",
    "transform_plane",
    "transform_points",
    "yaw_of",
]

IntArray = NDArray[np.int64]


class RoomloopError(Exception):
    """Anything that roomloop reports to its user in one line. ``exit_status`` is the command's."""

    exit_status = 3


class InputError(RoomloopError):
    """A file, a value or an option that cannot be used: names it and says what was expected."""

    exit_status = 2


class RunError(RoomloopError):
    """A run that could not go on: a collision, a lost track, a failed optimisation."""

    exit_status = 3


def cores() -> int:
    """Cores that this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def thread_limit(most: int) -> int:
    """Threads for a stage that gains from up to ``most``: fewer where OMP_NUM_THREADS says so, as
    many runs at once do; libraries that know nothing of OpenMP are told through this."""
    said = os.environ.get("OMP_NUM_THREADS", "")
    return max(1, min(most, int(said)) if said.isdigit() else most)


# --- what a sensor gives -------------------------------------------------------------------------


@dataclass(frozen=True)
class WheelOdometry:
    """What a base makes of its wheels' turning; it drifts, and is no truth.

    stamp [s]; T_odom_base: (4, 4) dead reckoning since the start, level; twist: (6,) linear
    [m/s] and angular [rad/s] velocity in the base frame.
    """

    stamp: float
    T_odom_base: Array
    twist: Array


@dataclass(frozen=True)
class Scan:
    """One sweep as a sensor delivers it: raw, not deskewed, without any truth.

    points: (N, 3) float64, lidar frame at each point's own instant [m]; times: (N,) float64,
    seconds before the sweep's end (<= 0); ring: (N,) int, beam counted from the lowest;
    intensity: (N,) float64 in [0, 1]; stamp: the sweep's END [s]; wheels: the base's wheel odometry
    at that instant, None where there is none.
    """

    index: int
    stamp: float
    points: Array
    times: Array
    ring: NDArray[np.int16]
    intensity: Array
    T_base_lidar: Array = field(default_factory=lambda: np.eye(4))
    wheels: WheelOdometry | None = None

    def __len__(self) -> int:
        return len(self.points)


# --- what the front end makes of it --------------------------------------------------------------


@dataclass(frozen=True)
class PlaneObservation:
    """A plane seen from one keyframe, base frame at the sweep's end, normal towards the sensor.

    covariance: (3, 3) of how the true plane (n, d) lies to this one: n along both ``plane_axes``
    [rad], and n.centroid + d [m]; points: (M, 3) base frame, a thinned sample of the returns it was
    fitted to; point_index: (M,) their places in the scan.
    """

    normal: Array
    d: float
    centroid: Array
    covariance: Array
    points: Floats
    point_index: IntArray

    @cached_property
    def rows(self) -> Array:
        """(3, 3) both ``plane_axes`` and the centroid: what a plane's normal is compared along."""
        return np.stack([*plane_axes(self.normal), self.centroid])


@dataclass(frozen=True)
class KeyframeScan:
    """What is kept of a keyframe's sweep: its plane observations and its deskewed returns.

    points: (M, 3) float32, base frame at the sweep's end, thinned; origin: (3,) the lidar in that
    frame (the baselines need free space); plumb: (3,) unit, in that frame, up along walls that are
    plumb, None where too few were seen.
    """

    planes: tuple[PlaneObservation, ...]
    points: Floats
    origin: Array
    plumb: Array | None = None


@dataclass(frozen=True)
class Frame:
    """The front end's word on one scan; ``keyframe`` is None for most.

    A keyframe of the front end is a candidate: the back end keeps it as a ``Keyframe`` of the map,
    or finds that it stands beside one that has seen as much, and only locates it there.
    T_odom_base: by the odometry alone; T_track_base: refined against the planes seen lately.
    """

    index: int
    stamp: float
    T_odom_base: Array
    T_track_base: Array
    keyframe: KeyframeScan | None


@dataclass(frozen=True)
class Keyframe:
    """A keyframe that the back end has kept, with its pose as estimated now, and the storey that
    the base was on. ``id`` counts these alone."""

    id: int
    scan_index: int
    stamp: float
    T_map_base: Array
    scan: KeyframeScan
    storey: int = 0


# --- the map -------------------------------------------------------------------------------------

POINT_ID_STRIDE = 1 << 20


def point_ids(scan_index: int, point_index: IntArray) -> IntArray:
    """Names of returns that survive every transformation: scan and place in the scan, in one."""
    return scan_index * POINT_ID_STRIDE + np.asarray(point_index, dtype=np.int64)


@dataclass(frozen=True)
class MapPlane:
    """A mapped plane in the map frame, as estimated now; n.x + d = 0, n to where it was seen from.

    points: (M, 3) map frame, thinned; point_ids: (M,) where they came from (``point_ids``);
    keyframes: (K,) ids of the keyframes that saw it; storey: the one that these were on;
    revision: grows with every change, so that whoever reads planes can keep what it derived from an
    unchanged one.
    """

    id: int
    normal: Array
    d: float
    points: Array
    point_ids: IntArray
    keyframes: IntArray
    revision: int = 0
    storey: int = 0

    @property
    def horizontal(self) -> bool:
        """True for floors and ceilings."""
        return bool(abs(self.normal[2]) > HORIZONTAL)

    @cached_property
    def axis(self) -> Array:
        """(2,) unit, map frame: the level direction in which an upright plane runs. It means
        nothing of a horizontal one."""
        return plane_axes(self.normal)[0][:2]

    @cached_property
    def segment(self) -> Array:
        """(2, 2) the ends of an upright plane in plan view, map frame [m], from its points (1st to
        99th percentile). It means nothing of a horizontal one."""
        along = self.points[:, :2] @ self.axis
        low, high = np.percentile(along, [1.0, 99.0])
        steepness = max(float(np.hypot(*self.normal[:2])), 1e-9)
        middle_z = float(np.median(self.points[:, 2]))
        offset = -(self.d + self.normal[2] * middle_z) / steepness
        return offset * self.normal[:2] / steepness + np.outer([low, high], self.axis)

    @cached_property
    def z_range(self) -> tuple[float, float]:
        """Lowest and highest point [m], map frame."""
        return float(self.points[:, 2].min()), float(self.points[:, 2].max())


@dataclass(frozen=True)
class MapView:
    """What a detector may see: the map as estimated now, nothing of the simulator."""

    stamp: float
    planes: Sequence[MapPlane]
    keyframes: Sequence[Keyframe]


# --- rooms and walls -----------------------------------------------------------------------------


@dataclass(frozen=True)
class PlanePiece:
    """A part of a mapped plane: the stretch of it between two ends in plan view.

    segment: (2, 2) map frame [m]. The piece owns the plane's points that project into it.
    """

    plane_id: int
    segment: Array

    @property
    def length(self) -> float:
        """Length of the piece [m]."""
        return float(np.linalg.norm(self.segment[1] - self.segment[0]))

    def mask(self, points: Array) -> NDArray[np.bool_]:
        """Which of the plane's points (N, 3) lie between the two ends."""
        run = self.segment[1] - self.segment[0]
        length2 = float(run @ run)
        along = (points[:, :2] - self.segment[0]) @ run
        return (along >= -1e-9) & (along <= length2 + 1e-9)


@dataclass(frozen=True)
class RoomProposal:
    """A room as a detector sees it. ``id`` stays the same while it is the same room.

    pieces: what bounds it (may be empty for detectors without planes); polygon: (K, 2) or None;
    centre: (2,) inside the room; map frame; storey: which one, as its planes and keyframes say.
    """

    id: int
    pieces: tuple[PlanePiece, ...]
    polygon: Array | None
    centre: Array
    confidence: float
    storey: int = 0


@dataclass(frozen=True)
class WallProposal:
    """Two pieces that look away from each other across one wall body."""

    id: int
    pieces: tuple[PlanePiece, PlanePiece]
    confidence: float


@dataclass(frozen=True)
class Proposals:
    """Everything that a detector holds true now; what it no longer names is retracted."""

    rooms: tuple[RoomProposal, ...] = ()
    walls: tuple[WallProposal, ...] = ()


class Detector(Protocol):
    """Finds rooms and walls in the map. A new instance per run; it may keep state."""

    def update(self, view: MapView) -> Proposals:
        """All rooms and walls in the view; asked after each keyframe that the map keeps, and once
        more of the final map, which has no new one."""
        ...


@dataclass(frozen=True)
class Links:
    """What a detector thinks of pairs before it makes rooms of them. pieces: all that it looked at;
    pairs: (E, 2) places of two pieces that it would put into one room."""

    pieces: tuple[PlanePiece, ...]
    pairs: IntArray


@runtime_checkable
class Linking(Protocol):
    """A detector that tells of its links: a fault can be laid to them, or to what follows."""

    def links(self) -> Links:
        """As of the last update."""
        ...


class Odometry(Protocol):
    """Turns scans into poses. A new instance per run."""

    def register(self, scan: Scan) -> Array:
        """T_odom_base (4, 4) at the scan's end, which may jump: the front end judges the motion,
        once it is refined against planes. Raises RunError when there is no pose to report."""
        ...


DetectorFactory = Callable[[], Detector]
