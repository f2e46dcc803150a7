"""The plane map: which observations are of one plane, and the points each plane was built from.

Geometry only: the graph holds the estimates, this holds what supports them.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from slam.core import (
    Array,
    Floats,
    IntArray,
    MapPlane,
    PlaneObservation,
    plane_axes,
    point_ids,
    transform_points,
)

Planes = dict[int, tuple[Array, float]]
"""Normal (3,) and d by plane id, map frame."""


@dataclass(frozen=True)
class AssociationConfig:
    """Gates in the map frame. angle [rad], distance [m] between an observation and a mapped plane;
    sigmas: the same as a multiple of the observation's own standard deviation, whichever is larger;
    reach [m]: largest hole between their extents along the wall, which is less than the width of a
    corridor; merge_*: two mapped planes closer than this are one; voxel [m]: of the points that are
    kept, and coarse_voxel of those that a detector is shown.
    """

    angle: float = np.radians(2.5)
    distance: float = 0.08
    sigmas: float = 3.0
    reach: float = 1.0
    merge_angle: float = np.radians(1.5)
    merge_distance: float = 0.04
    voxel: float = 0.05
    coarse_voxel: float = 0.1


@dataclass
class Observed:
    """One observation that supports a plane: its keyframe, and its place among that one's."""

    keyframe: int
    place: int
    observation: PlaneObservation


@dataclass
class _Support:
    """What a mapped plane was built from. points are in the frames of their keyframes."""

    observed: list[Observed] = field(default_factory=list)
    points: list[Floats] = field(default_factory=list)
    ids: list[IntArray] = field(default_factory=list)
    keyframes: list[IntArray] = field(default_factory=list)
    coarse: list[NDArray[np.bool_]] = field(default_factory=list)
    cells: set[int] = field(default_factory=set)
    coarse_cells: set[int] = field(default_factory=set)
    revision: int = 0


class PlaneMap:
    """Mapped planes by id, with what supports each."""

    def __init__(self, config: AssociationConfig = AssociationConfig()):
        self._config = config
        self._support: dict[int, _Support] = {}
        self._views: dict[int, MapPlane] = {}
        self._next = 0

    def __iter__(self) -> Iterator[int]:
        return iter(self._support)

    def __len__(self) -> int:
        return len(self._support)

    def new_plane(self) -> int:
        """Id of a plane that nothing supports yet."""
        self._support[self._next] = _Support()
        self._next += 1
        return self._next - 1

    def associate(
        self,
        T_map_base: Array,
        observation: PlaneObservation,
        planes: Planes,
    ) -> int | None:
        """The mapped plane that an observation is of, or None."""
        normal = T_map_base[:3, :3] @ observation.normal
        centroid = transform_points(T_map_base, observation.centroid)
        points = transform_points(T_map_base, observation.points)
        sigma = np.sqrt(np.diag(observation.covariance))
        angle = max(self._config.angle, self._config.sigmas * float(sigma[:2].max()))
        distance = max(self._config.distance, self._config.sigmas * float(sigma[2]))
        best, best_distance = None, distance
        for name, (n, d) in planes.items():
            if n @ normal < np.cos(min(angle, np.radians(15.0))):
                continue
            off = abs(float(n @ centroid + d))
            if off < best_distance and self._meets(name, n, points):
                best, best_distance = name, off
        return best

    def _meets(self, plane: int, normal: Array, points: Array) -> bool:
        """Do the points lie within reach of the plane's extent?"""
        if abs(normal[2]) > 0.7:
            return True
        along = points @ plane_axes(normal)[0]
        low, high = self._extent(plane, plane_axes(normal)[0])
        reach = self._config.reach
        if along.min() > high + reach or along.max() < low - reach:
            return False
        mine = self.view(plane).points @ plane_axes(normal)[0]
        gap = np.maximum(mine - along.max(), along.min() - mine)
        return bool(gap.min() < reach)

    def _extent(self, plane: int, axis: Array) -> tuple[float, float]:
        along = self.view(plane).points @ axis
        return float(along.min()), float(along.max())

    def support(
        self, plane: int, observed: Observed, scan_index: int, T_map_base: Array, normal: Array
    ) -> None:
        """Adds an observation to a plane; keeps its points where the plane had none."""
        support = self._support[plane]
        support.observed.append(observed)
        self._keep_points(
            support,
            observed.keyframe,
            observed.observation.points,
            point_ids(scan_index, observed.observation.point_index),
            T_map_base,
            normal,
        )

    def _keep_points(
        self,
        support: _Support,
        keyframe: int,
        points_base: Floats,
        ids: IntArray,
        T_map_base: Array,
        normal: Array,
    ) -> None:
        points = transform_points(T_map_base, points_base)
        new = _fresh(points, normal, self._config.voxel, support.cells)
        coarse = _fresh(points[new], normal, self._config.coarse_voxel, support.coarse_cells)
        support.points.append(points_base[new])
        support.ids.append(ids[new])
        support.keyframes.append(np.full(len(new), keyframe))
        support.coarse.append(np.isin(np.arange(len(new)), coarse))
        support.revision += 1

    def merge(self, kept: int, gone: int) -> list[Observed]:
        """Moves all support of ``gone`` to ``kept``; returns the observations that moved."""
        into, out = self._support[kept], self._support.pop(gone)
        self._views.pop(gone, None)
        into.observed += out.observed
        into.points += out.points
        into.ids += out.ids
        into.keyframes += out.keyframes
        into.coarse += out.coarse
        into.cells |= out.cells
        into.coarse_cells |= out.coarse_cells
        into.revision = max(into.revision, out.revision) + 1
        return out.observed

    def duplicates(self, planes: Planes) -> list[tuple[int, int]]:
        """Pairs (kept, gone) of planes that are one: same side, coplanar, extents that touch."""
        names = list(planes)
        if len(names) < 2:
            return []
        normals = np.array([planes[name][0] for name in names])
        level = np.abs(normals[:, 2]) > 0.7
        near = normals @ normals.T > np.cos(self._config.merge_angle)
        near &= level[:, None] == level[None, :]
        pairs, gone = [], set()
        for i, j in zip(*np.nonzero(np.triu(near, 1)), strict=True):
            a, b = names[i], names[j]
            if a in gone or b in gone or not self._coplanar(a, b, planes):
                continue
            pairs.append((a, b))
            gone.add(b)
        return pairs

    def _coplanar(self, a: int, b: int, planes: Planes) -> bool:
        n, d = planes[a]
        points = self.view(b).points
        off = points @ n + d
        if abs(float(np.median(off))) > self._config.merge_distance:
            return False
        back = self.view(a).points @ planes[b][0] + planes[b][1]
        if abs(float(np.median(back))) > self._config.merge_distance * 2.0:
            return False
        return self._meets(a, n, points)

    def observations(self, plane: int) -> list[Observed]:
        """Everything that supports a plane."""
        return self._support[plane].observed

    def refresh(self, poses: Array, planes: Planes, moved: NDArray[np.bool_]) -> None:
        """Brings the views up to date. poses: (K, 4, 4) T_map_base by keyframe id; moved: (K,)
        keyframes whose pose changed noticeably since the last call."""
        for name, (normal, d) in planes.items():
            support, view = self._support[name], self._views.get(name)
            keyframes = np.concatenate(support.keyframes)
            if view is not None and _unchanged(support, view, normal, d, moved[keyframes]):
                continue
            support.revision = max(support.revision, view.revision if view else 0) + 1
            shown = np.concatenate(support.coarse)
            self._views[name] = _map_plane(name, support, shown, poses, normal, d)

    def dense(self, poses: Array, planes: Planes) -> list[MapPlane]:
        """All planes with all points that were kept."""
        return [
            _map_plane(
                name, support, np.ones(sum(map(len, support.ids)), bool), poses, *planes[name]
            )
            for name, support in self._support.items()
        ]

    def view(self, plane: int) -> MapPlane:
        """The plane as it was at the last ``refresh``."""
        return self._views[plane]

    def views(self) -> list[MapPlane]:
        """All planes as they were at the last ``refresh``."""
        return list(self._views.values())


def _unchanged(
    support: _Support, view: MapPlane, normal: Array, d: float, moved: NDArray[np.bool_]
) -> bool:
    still = abs(view.d - d) < 1e-3 and float(view.normal @ normal) > 1.0 - 1e-7
    return still and view.revision >= support.revision and not moved.any()


def _fresh(points: Array, normal: Array, voxel: float, taken: set[int]) -> IntArray:
    """Places of one point for each cell of a grid on the plane that was not ``taken``; takes it."""
    first, second = plane_axes(normal)
    u = np.floor(points @ first / voxel).astype(np.int64)
    v = np.floor(points @ second / voxel).astype(np.int64)
    cells, places = np.unique(u * (1 << 24) + v, return_index=True)
    new = np.array([cell not in taken for cell in cells.tolist()], dtype=bool)
    taken.update(cells.tolist())
    return np.sort(places[new])


def _map_plane(
    name: int, support: _Support, shown: NDArray[np.bool_], poses: Array, normal: Array, d: float
) -> MapPlane:
    local = np.concatenate(support.points)[shown]
    T = poses[np.concatenate(support.keyframes)[shown]]
    return MapPlane(
        id=name,
        normal=normal,
        d=d,
        points=np.einsum("nij,nj->ni", T[:, :3, :3], local) + T[:, :3, 3],
        point_ids=np.concatenate(support.ids)[shown],
        keyframes=np.unique([observed.keyframe for observed in support.observed]),
        revision=support.revision,
    )
