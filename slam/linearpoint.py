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
    are linearised, and the vectors (K, 6) of keyframes there.

    What the solver knows of a keyframe is a vector, turn [rad] and shift [m] in the keyframe's own
    axes: what it has more than the one at the linear point takes the pose there to where it is.
    """

    def __init__(self, estimates: Estimates, turned: float, moved: float):
        """turned [rad], moved [m]: change from which a keyframe or plane is linearised anew."""
        self._estimates = estimates
        self._watch = Watch(estimates, turned, moved)
        self._vectors = np.zeros((64, 6))
        self._now = np.zeros((64, 6))
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

    @property
    def vectors(self) -> Array:
        """(K, 6)"""
        return self._vectors[: len(self.poses)]

    def take(self, keyframes: IntArray, vectors: Array, planes: IntArray, x: Array) -> None:
        """What the solver says of keyframes (N,), (N, 6), and of planes (M,), (M, 3), becomes their
        estimates."""
        T, step = self.poses[keyframes], vectors - self._vectors[keyframes]
        poses = T.copy()
        poses[:, :3, :3] = T[:, :3, :3] @ so3_exp(step[:, :3])
        poses[:, :3, 3] += (T[:, :3, :3] @ step[:, 3:, None])[:, :, 0]
        self._now[keyframes] = vectors
        self._estimates.poses[keyframes] = poses
        self._estimates.set_planes(planes, x)
        self._keyframes.append(keyframes)
        self._planes.append(planes)

    def follow(self) -> tuple[IntArray, IntArray]:
        """Goes to the estimates of what is new, and of what has moved. Returns the latter:
        keyframes, planes."""
        self._watch.welcome()
        self._vectors = room_for(self._vectors, len(self.poses))
        self._now = room_for(self._now, len(self.poses))
        none = np.empty(0, dtype=np.int64)
        keyframes, planes = self._watch.moved(
            np.unique(np.concatenate([none, *self._keyframes])),
            np.unique(np.concatenate([none, *self._planes])),
        )
        self._keyframes, self._planes = [], []
        self._vectors[keyframes] = self._now[keyframes]
        return keyframes, planes
