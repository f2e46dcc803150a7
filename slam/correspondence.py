"""Which of a scan's points lie on which of the planes seen lately."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from slam.core import HORIZONTAL, Array, IntArray, plane_axes
from slam.localplanes import LocalPlane


class PlaneStack:
    """Planes as arrays: normals (P, 3), offsets (P,), level axes (P, 3), extents (P, 2) along those
    and in height, and which of them are floors or ceilings (P,)."""

    def __init__(self, planes: Sequence[LocalPlane]):
        self.normals = np.array([plane.normal for plane in planes]).reshape(-1, 3)
        centroids = np.array([plane.centroid for plane in planes]).reshape(-1, 3)
        self.offsets = -np.einsum("pi,pi->p", self.normals, centroids)
        self.axes = np.array([plane_axes(plane.normal)[0] for plane in planes]).reshape(-1, 3)
        self.span = np.array([plane.span for plane in planes]).reshape(-1, 2)
        self.height = np.array([plane.height for plane in planes]).reshape(-1, 2)
        self.level = np.abs(self.normals[:, 2]) > HORIZONTAL

    def __len__(self) -> int:
        return len(self.normals)


class Candidates:
    """Which of a scan's points (3, N) may lie on which of the planes that face it: all that do
    within ``reach`` now, hence all that will within less once the points have moved a little.

    origin: (3,) of the lidar; margin: how far beyond its extent a plane is believed in [m]."""

    def __init__(
        self, stack: PlaneStack, points: Array, origin: Array, reach: float, margin: float
    ):
        self._margin = margin
        near = np.abs((stack.normals @ points).T + stack.offsets) < reach
        near &= stack.normals @ origin + stack.offsets > 0.1
        self._place, plane = np.nonzero(near)
        self._plane = plane
        self._normals, self._offsets = stack.normals.T.take(plane, axis=1), stack.offsets[plane]
        self._axes, self._level = stack.axes.T.take(plane, axis=1), stack.level[plane]
        self._span, self._height = stack.span[plane].T, stack.height[plane].T

    def correspond(
        self, points: Array, gate: float, level_gate: float
    ) -> tuple[IntArray, IntArray, Array]:
        """Places (M,) of the points that lie on one plane, which, and how far off it [m]: less than
        ``gate``, and than ``level_gate`` off floors and ceilings."""
        near = points.take(self._place, axis=1)
        distance = np.einsum("ic,ic->c", near, self._normals) + self._offsets
        along = np.einsum("ic,ic->c", near, self._axes)
        inside = _within(along, self._span, self._margin)
        inside &= _within(near[2], self._height, self._margin)
        inside |= self._level
        # The feet of walls that are not known yet must not pass for floor.
        gates = np.where(self._level, min(gate, level_gate), gate)
        use = np.flatnonzero(inside & (np.abs(distance) < gates))
        place = self._place[use]
        # A point in a corner could be on either wall.
        alone = np.bincount(place, minlength=points.shape[1])[place] == 1
        use = use[alone]
        return self._place[use], self._plane[use], distance[use]


def _within(values: Array, ends: Array, margin: float) -> NDArray[np.bool_]:
    """Which of the values (N,) lie between their ends (2, N), or less than a margin beyond."""
    return (values > ends[0] - margin) & (values < ends[1] + margin)
