"""Loop closure: has the base been here before, and where exactly, by registering two scans.

Planes that are seen again close most loops by themselves, as long as the drift is smaller than what
tells two walls apart. This is for the rest, and says so with a factor of its own.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from slam.core import (
    HORIZONTAL,
    Array,
    KeyframeScan,
    PlaneObservation,
    inverse,
    so3_log,
    transform_plane,
    transform_points,
)


@dataclass(frozen=True)
class LoopConfig:
    """radius [m], drift [m/m]: how far away, by the estimate, an earlier keyframe may be, and how
    much farther for each metre driven since; apart [m]: driven since at least; every [m]: between
    two attempts; correspondence [m], leaf [m]: of the registration; shift [m], turn [rad]: largest
    change of what the estimate says; overlap: share of the points on walls whose plane must be seen
    from both places, within angle [rad] and distance [m]; rotation [rad], translation [m]: standard
    deviations of a closure.
    """

    radius: float = 1.2
    drift: float = 0.003
    apart: float = 12.0
    every: float = 2.0
    correspondence: float = 0.4
    leaf: float = 0.12
    shift: float = 0.8
    turn: float = np.radians(8.0)
    overlap: float = 0.6
    angle: float = np.radians(3.0)
    distance: float = 0.08
    rotation: float = np.radians(0.3)
    translation: float = 0.025


@dataclass(frozen=True)
class Loop:
    """Two keyframes of one place, and where the later one is in the frame of the earlier."""

    earlier: int
    later: int
    T_earlier_later: Array


class LoopCloser:
    """Looks for loops keyframe by keyframe; keeps what it found in ``loops``."""

    def __init__(self, config: LoopConfig = LoopConfig()):
        self._config = config
        self._ways: list[float] = []
        self._attempt_at = -np.inf
        self.loops: list[Loop] = []

    def find(self, poses: Array, scans: Sequence[KeyframeScan], way: float) -> Loop | None:
        """A loop that the last keyframe closes, or None.

        poses: (K, 4, 4) T_map_base as estimated now, the last one new; scans: of the
        keyframes; way: driven so far [m].
        """
        self._ways.append(way)
        candidate = self._candidate(poses, way)
        if candidate is None or way - self._attempt_at < self._config.every:
            return None
        self._attempt_at = way
        later = len(poses) - 1
        guess = inverse(poses[candidate]) @ poses[later]
        T = self._register(scans[candidate], scans[later], guess)
        if T is None:
            return None
        loop = Loop(candidate, later, T)
        self.loops.append(loop)
        return loop

    def _candidate(self, poses: Array, way: float) -> int | None:
        """The nearest keyframe that was left long ago."""
        config = self._config
        since = way - np.array(self._ways)
        distance = np.linalg.norm(poses[:, :3, 3] - poses[-1, :3, 3], axis=1)
        near = distance < config.radius + config.drift * since
        places = np.flatnonzero(near & (since > config.apart))
        return int(places[np.argmin(distance[places])]) if len(places) else None

    def _register(self, earlier: KeyframeScan, later: KeyframeScan, guess: Array) -> Array | None:
        """T_earlier_later (4, 4) where the scans agree beyond doubt, else None."""
        if min(len(earlier.points), len(later.points)) < 200:
            return None
        import small_gicp

        config = self._config
        result = small_gicp.align(
            np.asarray(earlier.points, dtype=np.float64),
            np.asarray(later.points, dtype=np.float64),
            init_T_target_source=guess,
            downsampling_resolution=config.leaf,
            max_correspondence_distance=config.correspondence,
        )
        T = np.array(result.T_target_source)
        change = inverse(guess) @ T
        moved = float(np.linalg.norm(change[:3, 3])), float(np.linalg.norm(so3_log(change[:3, :3])))
        if not result.converged or moved[0] > config.shift or moved[1] > config.turn:
            return None
        return T if self._agree(earlier.planes, later.planes, T) else None

    def _agree(
        self,
        earlier: Sequence[PlaneObservation],
        later: Sequence[PlaneObservation],
        T_earlier_later: Array,
    ) -> bool:
        """Are most of the walls seen from here those seen from there, in two directions?"""
        total = matched = 0
        directions: list[Array] = []
        for observation in later:
            normal, _ = transform_plane(T_earlier_later, observation.normal, observation.d)
            if abs(normal[2]) > HORIZONTAL:
                continue
            total += len(observation.points)
            centroid = transform_points(T_earlier_later, observation.centroid)
            if any(self._same(other, normal, centroid) for other in earlier):
                matched += len(observation.points)
                directions.append(normal)
        across = max(
            (abs(a[0] * b[1] - a[1] * b[0]) for a in directions for b in directions), default=0
        )
        return matched > self._config.overlap * total and across > 0.5

    def _same(self, plane: PlaneObservation, normal: Array, centroid: Array) -> bool:
        config = self._config
        near = abs(plane.normal @ centroid + plane.d) < config.distance
        return bool(near and plane.normal @ normal > np.cos(config.angle))
