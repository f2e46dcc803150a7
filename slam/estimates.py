"""What the graph has estimated so far, as arrays: poses of keyframes, and planes."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from slam.charts import Chart, Charts
from slam.core import Array, IntArray


class Estimates:
    """Poses (K, 4, 4) T_map_base by keyframe id, and planes by plane id: coordinates (P, 3) in
    their charts, normals (P, 3), offsets (P,) with n.x + d = 0, heights (P,) over where they were
    first seen [m], and which of them are alive (a merged plane is not)."""

    def __init__(self) -> None:
        self._charts: list[Chart] = []
        self._poses = np.zeros((64, 4, 4))
        self._origins = np.zeros((64, 3))
        self._frames = np.zeros((64, 3, 3))
        self._coordinates = np.zeros((64, 3))
        self._normals = np.zeros((64, 3))
        self._offsets = np.zeros(64)
        self._alive = np.zeros(64, dtype=bool)
        self.keyframe_count = 0

    @property
    def plane_count(self) -> int:
        """How many planes there have been, merged ones too."""
        return len(self._charts)

    @property
    def poses(self) -> Array:
        """(K, 4, 4)"""
        return self._poses[: self.keyframe_count]

    @property
    def coordinates(self) -> Array:
        """(P, 3)"""
        return self._coordinates[: self.plane_count]

    @property
    def normals(self) -> Array:
        """(P, 3)"""
        return self._normals[: self.plane_count]

    @property
    def offsets(self) -> Array:
        """(P,)"""
        return self._offsets[: self.plane_count]

    @property
    def heights(self) -> Array:
        """(P,)"""
        return self._coordinates[: self.plane_count, 2]

    @property
    def alive(self) -> NDArray[np.bool_]:
        """(P,)"""
        return self._alive[: self.plane_count]

    def chart(self, plane: int) -> Chart:
        """The chart of a plane; it never changes."""
        return self._charts[plane]

    def charts(self, planes: IntArray) -> Charts:
        """Those of planes (N,)."""
        return Charts(self._origins[planes], self._frames[planes])

    def add_keyframe(self, T_map_base: Array) -> None:
        """The next keyframe, where it is thought to be."""
        self._poses = room_for(self._poses, self.keyframe_count)
        self._poses[self.keyframe_count] = T_map_base
        self.keyframe_count += 1

    def add_plane(self, chart: Chart) -> int:
        """The next plane, which lies in its chart; its id."""
        plane = len(self._charts)
        self._charts.append(chart)
        self._origins = room_for(self._origins, plane)
        self._frames = room_for(self._frames, plane)
        self._coordinates = room_for(self._coordinates, plane)
        self._normals = room_for(self._normals, plane)
        self._offsets = room_for(self._offsets, plane)
        self._alive = room_for(self._alive, plane)
        self._origins[plane], self._frames[plane] = chart.origin, chart.frame
        self._alive[plane] = True
        self.set_planes(np.array([plane]), np.zeros((1, 3)))
        return plane

    def set_planes(self, planes: IntArray, x: Array) -> None:
        """Coordinates (N, 3) of planes (N,), each in its chart."""
        self._coordinates[planes] = x
        self._normals[planes], self._offsets[planes], *_ = self.charts(planes).planes(x)

    def plane(self, plane: int) -> tuple[Array, float]:
        """Normal (3,) and d."""
        return self._normals[plane].copy(), float(self._offsets[plane])


def room_for(array: NDArray, place: int) -> NDArray:
    """The array, or one of at least twice the length that starts like it."""
    if place < len(array):
        return array
    more = max(len(array), place + 1 - len(array))
    return np.concatenate([array, np.zeros((more, *array.shape[1:]), dtype=array.dtype)])
