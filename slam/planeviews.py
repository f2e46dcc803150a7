"""Mapped planes as others are told of them: brought up to date only where something changed."""

from __future__ import annotations

from collections.abc import Iterable, Mapping

import numpy as np
from numpy.typing import NDArray

from slam.core import Array, IntArray, MapPlane
from slam.estimates import Estimates
from slam.support import Support


class PlaneViews:
    """plane_moved [rad, m]: change of a plane, and pose_moved [m] of a keyframe, that others are
    told of."""

    def __init__(self, estimates: Estimates, plane_moved: float, pose_moved: float):
        self._estimates = estimates
        self._plane_moved = plane_moved
        self._pose_moved = pose_moved
        self._views: dict[int, MapPlane] = {}
        self._told_poses = np.zeros((0, 4, 4))
        self._told_planes = np.zeros((0, 4))

    def __getitem__(self, plane: int) -> MapPlane:
        return self._views[plane]

    def all(self) -> list[MapPlane]:
        """All planes as they were told last."""
        return list(self._views.values())

    def pop(self, plane: int) -> MapPlane:
        """Forgets a plane; how it was told last."""
        return self._views.pop(plane)

    def moved_keyframes(self) -> NDArray[np.bool_]:
        """(K,) which poses differ from what was told; new ones do not count, their planes do."""
        poses = self._estimates.poses
        known = len(self._told_poses)
        moved = np.zeros(len(poses), dtype=bool)
        change = np.abs(poses[:known] - self._told_poses).max(axis=(1, 2), initial=0.0)
        moved[:known] = change > self._pose_moved
        self._told_poses = _told(self._told_poses, poses, moved)
        return moved

    def moved_planes(self) -> list[int]:
        """Ids of planes that differ from what was told."""
        estimates = self._estimates
        # Distances are compared where the plane is, not at the map's origin.
        now = np.hstack([estimates.normals, estimates.heights[:, None]])
        known = len(self._told_planes)
        moved = np.ones(len(now), dtype=bool)
        change = np.abs(now[:known] - self._told_planes).max(axis=1, initial=0.0)
        moved[:known] = change > self._plane_moved
        self._told_planes = _told(self._told_planes, now, moved)
        return np.flatnonzero(moved & estimates.alive).tolist()

    def tell(
        self, planes: Iterable[int], supports: Mapping[int, Support], moved: NDArray[np.bool_]
    ) -> None:
        """Brings some planes up to date. moved: (K,) keyframes."""
        poses, elsewhere = self._estimates.poses, np.flatnonzero(moved).tolist()
        for plane in planes:
            support, old = supports[plane], self._views.get(plane)
            points, ids = support.told.now(support.chunks, poses, elsewhere)
            revision = 1 + (old.revision if old is not None else 0)
            self._views[plane] = self._plane(plane, support, points, ids, revision)
            support.changed = False

    def dense(self, supports: Mapping[int, Support]) -> list[MapPlane]:
        """All planes with all points that were kept."""
        poses, planes = self._estimates.poses, []
        for plane, support in supports.items():
            points = np.concatenate([chunk.dense(poses) for chunk in support.chunks])
            ids = np.concatenate([chunk.ids for chunk in support.chunks])
            revision = self._views[plane].revision
            planes.append(self._plane(plane, support, points, ids, revision))
        return planes

    def _plane(
        self, plane: int, support: Support, points: Array, ids: IntArray, revision: int
    ) -> MapPlane:
        normal, d = self._estimates.plane(plane)
        keyframes = np.array(sorted(support.keyframes))
        return MapPlane(plane, normal, d, points, ids, keyframes, revision, support.storey)


def _told(before: Array, now: Array, moved: NDArray[np.bool_]) -> Array:
    """What is told from now on: the new of what moved and of what is new, the old of the rest."""
    told, kept = now.copy(), np.flatnonzero(~moved[: len(before)])
    told[kept] = before[kept]
    return told
