"""The front end: odometry on every scan, planes on keyframes. It knows nothing of the map."""

from __future__ import annotations

import time
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from slam.core import (
    Array,
    Frame,
    InputError,
    IntArray,
    KeyframeScan,
    Odometry,
    Scan,
    inverse,
    so3_log,
)
from slam.extraction import ExtractionConfig, extract
from slam.odometry import MotionLimits, Stamped, check_finite, check_motion
from slam.tracking import PlaneTracker, TrackingConfig


@dataclass(frozen=True)
class FrontEndConfig:
    """When a scan becomes a keyframe, and what is kept of it.

    distance [m] and angle [rad] since the last keyframe; every: of each beam one in so many returns
    is kept beside the planes (the detectors that read free space need no more); limits: of the
    tracked motion.
    """

    distance: float = 0.4
    angle: float = 0.35
    every: int = 4
    extraction: ExtractionConfig = field(default_factory=ExtractionConfig)
    tracking: TrackingConfig = field(default_factory=TrackingConfig)
    limits: MotionLimits = field(default_factory=MotionLimits)


class FrontEnd:
    """Turns scans into frames. ``seconds`` holds what each stage of the last scan took."""

    def __init__(self, odometry: Odometry, config: FrontEndConfig = FrontEndConfig()):
        self._odometry = odometry
        self._config = config
        self._tracker = PlaneTracker(config.tracking)
        self._last: Stamped | None = None
        self._last_keyframe: Array | None = None
        self.seconds: dict[str, float] = {}

    def process(self, scan: Scan) -> Frame:
        """Raises RunError when the odometry has no finite pose or the tracked motion is none that a
        base can make, InputError for a malformed scan."""
        _check(scan)
        started = time.perf_counter()
        T_odom_base = self._odometry.register(scan)
        check_finite((scan.stamp, T_odom_base))
        T_track_base = self._tracker.track(scan, T_odom_base)
        # Only the tracked motion is judged: a jump of the odometry that planes catch ends nothing.
        check_motion(self._last, (scan.stamp, T_track_base), self._config.limits)
        self._last = (scan.stamp, T_track_base)
        self.seconds = {"odometry": time.perf_counter() - started}
        keyframe = None
        if self._is_keyframe(T_track_base):
            started = time.perf_counter()
            keyframe = self._keyframe(scan)
            T_track_base = self._tracker.latest
            self._last = (scan.stamp, T_track_base)
            self._last_keyframe = T_track_base
            self.seconds["planes"] = time.perf_counter() - started
        return Frame(scan.index, scan.stamp, T_odom_base, T_track_base, keyframe)

    def _is_keyframe(self, T_track_base: Array) -> bool:
        if self._last_keyframe is None:
            return True
        step = inverse(self._last_keyframe) @ T_track_base
        moved = float(np.linalg.norm(step[:3, 3])) >= self._config.distance
        return moved or float(np.linalg.norm(so3_log(step[:3, :3]))) >= self._config.angle

    def _keyframe(self, scan: Scan) -> KeyframeScan:
        points = self._tracker.deskew(scan)
        origin = scan.T_base_lidar[:3, 3]
        planes, plumb = extract(points, scan.ring, origin, self._config.extraction)
        self._tracker.learn(planes, plumb)
        # Single precision is exact to a micrometre, and what is stored replays to the bit.
        planes = tuple(replace(p, points=p.points.astype(np.float32)) for p in planes)
        kept = points[thinned(scan.ring, self._config.every)]
        return KeyframeScan(planes, kept.astype(np.float32), origin, plumb)


def thinned(ring: NDArray[np.integer], every: int) -> IntArray:
    """Places of one in ``every`` returns of each beam, in the order of the sweep. ring: (N,).

    Beams take turns. A stride over all returns would not do: they come column by column, so that
    a stride of 4 keeps 4 beams of 16 until a return is missing, and then 4 others.
    """
    order = np.argsort(ring, kind="stable")
    beams, first, count = np.unique(ring[order], return_index=True, return_counts=True)
    turn = np.arange(len(ring)) - np.repeat(first, count) + np.repeat(beams, count)
    return np.sort(order[turn % every == 0])


def _check(scan: Scan) -> None:
    lengths = {len(scan.points), len(scan.times), len(scan.ring), len(scan.intensity)}
    if len(lengths) != 1:
        raise InputError(f"scan {scan.index}: points, times, ring and intensity differ in length")
    if not len(scan):
        raise InputError(f"scan {scan.index}: not a single return")
