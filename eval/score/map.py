"""The map's points: which ones are written, and how far they are from the true surfaces."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from eval.score.trajectory import rms
from eval.score.votes import Labels
from slam.core import Array, IntArray, MapPlane, transform_points
from worlds.truth import CEILING, FLOOR

if TYPE_CHECKING:
    from open3d.t.geometry import RaycastingScene

VOXEL = 0.05
"""Edge of the voxels of map.ply [m]."""


@dataclass(frozen=True)
class MapCloud:
    """What map.ply holds: points (M, 3) map frame, plane_id (M,), point_ids (M,)."""

    points: Array
    plane_id: IntArray
    point_ids: IntArray


@dataclass(frozen=True)
class MapScore:
    """mma: map points to the nearest true surface; mma_face: to the one that each was cast on (a
    face, floor or ceiling; returns from anything else are left out); mma_floor: to the nearest
    true surface, the same returns at true poses. RMSE [m], None without points (or alignment).
    """

    mma: float | None
    mma_face: float | None
    mma_floor: float | None


class SurfaceDistance:
    """Distance to the surfaces of a world as built: to any, or to those that carry one label.

    vertices: (V, 3) world; triangles: (T, 3) int; face: (T,) labels of the triangles.
    """

    def __init__(
        self, vertices: Array, triangles: NDArray[np.integer], face: NDArray[np.integer]
    ) -> None:
        # The scenes compute in float32: keep their numbers small.
        self._middle = vertices.mean(axis=0)
        self._vertices = np.ascontiguousarray(vertices - self._middle, dtype=np.float32)
        self._triangles = np.ascontiguousarray(triangles, dtype=np.uint32)
        self._face = np.asarray(face)
        self._all = self._scene(self._triangles)

    def _scene(self, triangles: NDArray[np.uint32]) -> RaycastingScene:
        import open3d as o3d

        scene = o3d.t.geometry.RaycastingScene(nthreads=1)
        tensor = o3d.core.Tensor.from_numpy
        scene.add_triangles(tensor(self._vertices), tensor(triangles))
        return scene

    def _distances(self, scene: RaycastingScene, points: Array) -> Array:
        import open3d as o3d

        query = np.ascontiguousarray(points - self._middle, dtype=np.float32)
        found = scene.compute_distance(o3d.core.Tensor.from_numpy(query), nthreads=1)
        return found.numpy().astype(np.float64)

    def __call__(self, points: Array) -> Array:
        """(N,) distances [m] of points (N, 3), world frame, to the nearest surface."""
        return self._distances(self._all, points)

    def to_label(self, points: Array, label: int) -> Array:
        """(N,) distances [m] of points (N, 3), world frame, to the triangles of one label."""
        own = np.ascontiguousarray(self._triangles[self._face == label])
        return self._distances(self._scene(own), points)


def map_cloud(planes: Sequence[MapPlane], voxel: float = VOXEL) -> MapCloud:
    """The returns of all mapped planes, thinned to one per voxel and plane.

    The one with the lowest id stays as it was measured: an average would hide the sensor's noise.
    Ordered by plane and id.
    """
    points = np.concatenate([np.empty((0, 3)), *(plane.points for plane in planes)])
    plane_id = np.repeat([plane.id for plane in planes], [len(p.points) for p in planes])
    ids = np.concatenate([np.empty(0, dtype=np.int64), *(plane.point_ids for plane in planes)])
    order = np.lexsort([ids, plane_id])
    cells = np.column_stack([plane_id, np.floor(points / voxel)]).astype(np.int64)[order]
    _, first = np.unique(cells, axis=0, return_index=True)
    kept = order[np.sort(first)]
    return MapCloud(points[kept], plane_id[kept].astype(np.int64), ids[kept])


def face_distances(points_world: Array, labels: Labels, surface: SurfaceDistance) -> Array:
    """(K,) distances of points to what they were cast on; those on no surface are left out."""
    known = np.unique(labels[(labels >= 0) | (labels == FLOOR) | (labels == CEILING)])
    found = [surface.to_label(points_world[labels == label], int(label)) for label in known]
    return np.concatenate([np.empty(0), *found])


def score_map(
    cloud: MapCloud,
    labels: Labels,
    true_points: Array,
    surface: SurfaceDistance,
    T_world_map: Array | None,
) -> MapScore:
    """MMA of a map. labels (M,), true_points (M, 3) world: the truth of the cloud's points."""
    floor = rms(surface(true_points)) if len(true_points) else None
    if T_world_map is None or len(cloud.points) == 0:
        return MapScore(None, None, floor)
    points = transform_points(T_world_map, cloud.points)
    return MapScore(
        mma=rms(surface(points)),
        mma_face=rms(face_distances(points, labels, surface)),
        mma_floor=floor,
    )
