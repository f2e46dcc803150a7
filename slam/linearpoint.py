"""Where the graph's factors are linearised, and what has moved since."""

from __future__ import annotations

import numpy as np

from slam.core import Array, IntArray, so3_exp
from slam.estimates import Estimates, room_for


class Watch:
    """Which keyframes and planes have moved since that was last said.

    poses (K, 4, 4), coordinates (P, 3): as they were when it was, or when they were new.
    """

    def __init__(self, estimates: Estimates, turned: float, moved: float):
        """turned [rad], moved [m]: how far."""
        self._estimates = estimates
        self._turned = turned
        self._limits = np.array([turned, turned, moved])
        self._poses = np.zeros((64, 4, 4))
        self._coordinates = np.zeros((64, 3))
        self._keyframes = self._planes = 0

    @property
    def poses(self) -> Array:
        """(K, 4, 4)"""
        return self._poses[: self._keyframes]

    @property
    def coordinates(self) -> Array:
        """(P, 3)"""
        return self._coordinates[: self._planes]

    def welcome(self) -> None:
        """Takes those that are new."""
        poses, x = self._estimates.poses, self._estimates.coordinates
        first, self._keyframes = self._keyframes, len(poses)
        self._poses = room_for(self._poses, len(poses))
        self._poses[first : len(poses)] = poses[first:]
        first, self._planes = self._planes, len(x)
        self._coordinates = room_for(self._coordinates, len(x))
        self._coordinates[first : len(x)] = x[first:]

    def moved(self, keyframes: IntArray, planes: IntArray) -> tuple[IntArray, IntArray]:
        """Those of these that have, which is said once."""
        T, x = self._estimates.poses[keyframes], self._estimates.coordinates[planes]
        was = self._poses[keyframes]
        turn = np.linalg.norm(T[:, :3, :3] - was[:, :3, :3], axis=(1, 2)) / np.sqrt(2.0)
        shift = np.linalg.norm(T[:, :3, 3] - was[:, :3, 3], axis=1)
        keyframes = keyframes[(turn > self._turned) | (shift > self._limits[2])]
        changed = (np.abs(x - self._coordinates[planes]) > self._limits).any(axis=1)
        planes = planes[changed & self._estimates.alive[planes]]
        self._poses[keyframes] = self._estimates.poses[keyframes]
        self._coordinates[planes] = self._estimates.coordinates[planes]
        return keyframes, planes


class LinearPoint:
    """Poses (K, 4, 4) of keyframes and coordinates (P, 3) of planes at which all factors about them
    are linearised. What the solver knows of a keyframe is the step from there: turn [rad], then
    shift [m], in the keyframe's own axes."""

    def __init__(self, estimates: Estimates, turned: float, moved: float):
        """turned [rad], moved [m]: change from which a keyframe or plane is linearised anew."""
        self._estimates = estimates
        self._watch = Watch(estimates, turned, moved)
        self._keyframes: list[IntArray] = []
        self._planes: list[IntArray] = []

    @property
    def poses(self) -> Array:
        """(K, 4, 4)"""
        return self._watch.poses

    @property
    def coordinates(self) -> Array:
        """(P, 3)"""
        return self._watch.coordinates

    def take(self, keyframes: IntArray, steps: Array, planes: IntArray, x: Array) -> None:
        """What the solver says of keyframes (N,), (N, 6), and of planes (M,), (M, 3), becomes their
        estimates."""
        T = self.poses[keyframes]
        poses = T.copy()
        poses[:, :3, :3] = T[:, :3, :3] @ so3_exp(steps[:, :3])
        poses[:, :3, 3] += (T[:, :3, :3] @ steps[:, 3:, None])[:, :, 0]
        self._estimates.poses[keyframes] = poses
        self._estimates.set_planes(planes, x)
        self._keyframes.append(keyframes)
        self._planes.append(planes)

    def follow(self) -> tuple[IntArray, IntArray]:
        """Goes to the estimates of what is new, and of what has moved. Returns the latter:
        keyframes, planes; the solver's step of such a keyframe is from here on."""
        self._watch.welcome()
        none = np.empty(0, dtype=np.int64)
        moved = self._watch.moved(
            np.unique(np.concatenate([none, *self._keyframes])),
            np.unique(np.concatenate([none, *self._planes])),
        )
        self._keyframes, self._planes = [], []
        return moved
