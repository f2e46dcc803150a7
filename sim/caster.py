"""Rays against a world's mesh, each with an origin of its own.

Embree (through Open3D) and not ``mj_multiRay`` for what stands still: a sweep takes it 2-5 ms in
any building, where MuJoCo takes 7-20 ms, growing with the number of geoms, from one origin a call.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from slam.core import Array, thread_limit

if TYPE_CHECKING:
    from worlds.world import Mesh

Rays = NDArray[np.float32]
"""(N, 6) origins [m] and unit directions, world frame."""

THREADS = thread_limit(2)
"""Threads of one cast, said outright: the default takes every core of a shared machine."""


@dataclass(frozen=True)
class Hits:
    """What N rays hit. distance: (N,) [m], inf where nothing; cosine: (N,) of the incidence, in
    [0, 1]; triangle, face, geom: (N,) int32, meaningless where nothing was hit, triangle -1 on what
    moves; glass: (N,) bool, None where nothing in the world is a pane."""

    distance: NDArray[np.float32]
    cosine: NDArray[np.float32]
    triangle: NDArray[np.int32]
    face: NDArray[np.int32]
    geom: NDArray[np.int32]
    glass: NDArray[np.bool_] | None = None

    def copy(self) -> Hits:
        """The same in arrays of their own."""
        return Hits(
            self.distance.copy(),
            self.cosine.copy(),
            self.triangle.copy(),
            self.face.copy(),
            self.geom.copy(),
            None if self.glass is None else self.glass.copy(),
        )


class RayCaster:
    """Casts rays on the triangles of ``mesh``.

    geom_ids: (G,) what to report for each of ``mesh.geom_names`` (MuJoCo's ids in the model that
    moves); their places in that tuple when left out.
    """

    def __init__(
        self, mesh: Mesh, geom_ids: NDArray[np.int32] | None = None, threads: int = THREADS
    ) -> None:
        import open3d as o3d

        self._tensor = o3d.core.Tensor.from_numpy
        self._threads = threads
        self._scene = o3d.t.geometry.RaycastingScene(nthreads=threads)
        self._scene.add_triangles(
            self._tensor(np.ascontiguousarray(mesh.vertices, dtype=np.float32)),
            self._tensor(np.ascontiguousarray(mesh.triangles, dtype=np.uint32)),
        )
        self._planes = _planes(mesh)
        self._normals = np.ascontiguousarray(self._planes[:, :3].T, dtype=np.float32)
        self._face = np.asarray(mesh.face, dtype=np.int32)
        names = np.asarray(mesh.geom_name, dtype=np.int64)
        ids = np.arange(len(mesh.geom_names)) if geom_ids is None else geom_ids
        self._geom = np.asarray(ids, dtype=np.int32)[names]
        self._glass = mesh.glass if mesh.glass.any() else None

    def cast(self, rays: Rays, fractions: NDArray[np.float32] | None = None) -> Hits:
        """First hits of rays (N, 6): origins and unit directions, world frame.

        When in the sweep they are shot makes no difference: nothing here moves.
        """
        coarse, triangle = self.embree(rays)
        missed = ~np.isfinite(coarse)
        triangle[missed] = 0
        distance, cosine = self._refine(rays, triangle, coarse)
        distance[missed] = np.inf
        face, geom = self._face.take(triangle), self._geom.take(triangle)
        glass = None if self._glass is None else self._glass.take(triangle) & ~missed
        return Hits(distance, cosine, triangle, face, geom, glass)

    def embree(self, rays: Rays) -> tuple[NDArray[np.float32], NDArray[np.int32]]:
        """Embree's own word on rays (N, 6): distances (N,), inf where nothing, and triangles."""
        answer = self._scene.cast_rays(self._tensor(rays), nthreads=self._threads)
        return answer["t_hit"].numpy(), answer["primitive_ids"].numpy().view(np.int32)

    def _refine(
        self, rays: Rays, triangle: NDArray[np.int32], coarse: NDArray[np.float32]
    ) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
        """Distances from the planes of the triangles that Embree names: its own, reckoned in single
        precision far from the origin, are up to a millimetre off. Here all that is left to single
        precision is reckoned from the first ray's origin."""
        if not len(rays):
            return coarse, np.ones(0, dtype=np.float32)
        start = rays[0, :3].astype(np.float64)
        heights = (self._planes[:, :3] @ start + self._planes[:, 3]).astype(np.float32)
        along, height = np.zeros_like(coarse), heights.take(triangle)
        for axis, normals in enumerate(self._normals):
            normal = normals.take(triangle)
            along += normal * rays[:, 3 + axis]
            height += normal * (rays[:, axis] - rays[0, axis])
        cosine = np.abs(along)
        edge_on = cosine < 1e-4
        along[edge_on] = 1.0
        return np.where(edge_on, coarse, -height / along), cosine


def _planes(mesh: Mesh) -> Array:
    """(T, 4) unit normals and d of the triangles."""
    a, b, c = (np.asarray(mesh.vertices, dtype=np.float64)[mesh.triangles[:, i]] for i in range(3))
    normals = np.cross(b - a, c - a)
    normals /= np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-12)
    return np.column_stack([normals, -np.einsum("ij,ij->i", normals, a)])
