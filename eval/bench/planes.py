"""Plane extraction beside what a user would take else: what is found, how exactly, how fast.

Single sweeps from rooms all over a building, deskewed by the true motion, so that nothing but the
extraction is measured. Beside ours: Open3D's planar patches, and RANSAC for one plane after the
other.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from eval.bench.sensor import HEIGHT, motions
from eval.score.surfaces import Surfaces
from sim.caster import RayCaster
from sim.lidar import Lidar
from sim.sensor import Sensor
from slam.core import Array, IntArray, inverse, pose, transform_plane, transform_points
from slam.extraction import ExtractionConfig, extract_planes
from worlds.truth import Truth
from worlds.world import World

MIXED_BELOW = 0.9
"""A plane is mixed when less of its returns lie on one surface."""
SEEN_RETURNS, SEEN_LENGTH = 150, 0.6
"""A face is to be found with so many returns over so many metres; half of these is enough."""


@dataclass(frozen=True)
class Look:
    """A sweep. points: (N, 3) base frame at its end; ring: (N,); origin: (3,) the sensor; surface,
    face: (N,) true labels of the returns."""

    points: Array
    ring: NDArray[np.int16]
    origin: Array
    surface: IntArray
    face: NDArray[np.int32]
    T_world_base: Array


@dataclass(frozen=True)
class Patch:
    """A plane n.x + d = 0 in the base frame, n towards the sensor, and which returns it is of."""

    normal: Array
    d: float
    places: IntArray


@dataclass(frozen=True)
class PlaneBench:
    """One method. planes: a sweep; found: share of the faces that were to be found; mixed: share of
    the planes; tilt [deg], offset [m]: of walls that are not mixed, median and 95th percentile; ms:
    median a sweep, of the processor."""

    method: str
    planes: float
    found: float
    mixed: float
    tilt: tuple[float, float]
    offset: tuple[float, float]
    ms: float


def looks_at(world: World, sensor: Sensor, count: int, seed: int) -> list[Look]:
    """Sweeps of a base that moves through the middle of rooms."""
    rng = np.random.default_rng(seed)
    T_base_lidar = pose(np.eye(3), np.array([0.0, 0.0, HEIGHT]))
    lidar = Lidar(sensor, RayCaster(world.mesh), rng, T_base_lidar)
    surfaces, looks = Surfaces(world.truth), []
    for index, motion in enumerate(motions(world, sensor, count, rng)):
        scan, truth = lidar.sweep(index, sensor.period, motion)
        world_points = truth.points_world.astype(np.float64)
        surface = surfaces.codes(truth.face, world_points)
        # What is no surface, such as a jamb, is one by its body.
        surface = np.where(truth.face < 0, surface - 10 * truth.geom.astype(np.int64), surface)
        points = transform_points(inverse(truth.T_world_base), world_points)
        origin = T_base_lidar[:3, 3]
        looks.append(Look(points, scan.ring, origin, surface, truth.face, truth.T_world_base))
    return looks


# --- the methods ----------------------------------------------------------------------------------


def ours(look: Look) -> list[Patch]:
    """``slam.extraction``."""
    planes = extract_planes(look.points, look.ring, look.origin, ExtractionConfig())
    return [Patch(plane.normal, plane.d, plane.point_index) for plane in planes]


def planar_patches(look: Look) -> list[Patch]:
    """Open3D's robust detection of planar patches (Araujo and Oliveira 2020), with its defaults on
    normals of 30 neighbours."""
    import open3d as o3d

    cloud = o3d.geometry.PointCloud(o3d.utility.Vector3dVector(look.points))
    cloud.estimate_normals(o3d.geometry.KDTreeSearchParamKNN(30))
    found = []
    for box in cloud.detect_planar_patches(search_param=o3d.geometry.KDTreeSearchParamKNN(30)):
        thick = o3d.geometry.OrientedBoundingBox(
            box.center, box.R, box.extent + np.array([0.0, 0.0, 0.06])
        )
        places = np.asarray(thick.get_point_indices_within_bounding_box(cloud.points))
        if len(places):
            found.append(_patch(np.asarray(box.R)[:, 2], np.asarray(box.center), places, look))
    return found


def sequential_ransac(look: Look, distance: float = 0.04, planes: int = 20) -> list[Patch]:
    """The plane with the most returns within ``distance`` [m], taken off, and again."""
    import open3d as o3d

    o3d.utility.random.seed(0)
    left = np.arange(len(look.points))
    found = []
    for _ in range(planes):
        cloud = o3d.geometry.PointCloud(o3d.utility.Vector3dVector(look.points[left]))
        (a, b, c, _), inliers = cloud.segment_plane(distance, 3, 300)
        if len(inliers) < SEEN_RETURNS:
            break
        places = left[np.asarray(inliers)]
        found.append(_patch(np.array([a, b, c]), look.points[places].mean(axis=0), places, look))
        left = np.delete(left, inliers)
    return found


def _patch(normal: Array, through: Array, places: IntArray, look: Look) -> Patch:
    normal = normal / np.linalg.norm(normal)
    normal = normal if normal @ (look.origin - through) > 0.0 else -normal
    return Patch(normal, -float(normal @ through), places)


METHODS: dict[str, Callable[[Look], list[Patch]]] = {
    "ours": ours,
    "planar patches (Open3D)": planar_patches,
    "sequential RANSAC": sequential_ransac,
}


# --- the scores -----------------------------------------------------------------------------------


def bench_planes(looks: Sequence[Look], truth: Truth, method: str) -> PlaneBench:
    """One method on sweeps of one place."""
    seconds, tilts, offsets, shares = [], [], [], []
    planes, found, to_find = 0, 0, 0
    for look in looks:
        started = time.process_time()
        patches = METHODS[method](look)
        seconds.append(time.process_time() - started)
        planes += len(patches)
        whole: dict[int, float] = {}
        for patch in patches:
            values, counts = np.unique(look.surface[patch.places], return_counts=True)
            surface, share = int(values[counts.argmax()]), float(counts.max() / counts.sum())
            shares.append(share)
            if share < MIXED_BELOW or surface < 0:
                continue
            on = patch.places[look.surface[patch.places] == surface]
            faces, many = np.unique(look.face[on], return_counts=True)
            tilt, offset = _errors(patch, look, truth, int(faces[many.argmax()]))
            tilts.append(tilt)
            offsets.append(offset)
            for face in faces.tolist():
                length = _length(look, truth, face, on[look.face[on] == face])
                whole[face] = max(whole.get(face, 0.0), length)
        lengths = _to_be_found(look, truth)
        to_find += len(lengths)
        found += sum(whole.get(face, 0.0) >= 0.5 * length for face, length in lengths.items())
    return PlaneBench(
        method=method,
        planes=planes / len(looks),
        found=found / max(to_find, 1),
        mixed=float(np.mean(np.array(shares) < MIXED_BELOW)),
        tilt=_median_and_p95(tilts),
        offset=_median_and_p95(offsets),
        ms=1e3 * float(np.median(seconds)),
    )


def _errors(patch: Patch, look: Look, truth: Truth, face: int) -> tuple[float, float]:
    """Angle between the normals [deg], and distance of the middle from the true plane [m]."""
    true = truth.faces[face]
    normal, d = transform_plane(look.T_world_base, patch.normal, patch.d)
    middle = transform_points(look.T_world_base, look.points[patch.places].mean(axis=0)[None])[0]
    middle = middle - (normal @ middle + d) * normal
    tilt = np.degrees(np.arccos(np.clip(normal @ true.normal, -1.0, 1.0)))
    return float(tilt), abs(float(true.normal @ middle + true.d))


def _to_be_found(look: Look, truth: Truth) -> dict[int, float]:
    """Length that is seen [m] of each face that is to be found."""
    faces, counts = np.unique(look.face[look.face >= 0], return_counts=True)
    lengths = {
        int(face): _length(look, truth, int(face), np.flatnonzero(look.face == face))
        for face in faces[counts >= SEEN_RETURNS]
    }
    return {face: length for face, length in lengths.items() if length >= SEEN_LENGTH}


def _length(look: Look, truth: Truth, face: int, places: IntArray) -> float:
    """How much of a face returns (M,) are spread over, to 10 cm; doors do not count [m]."""
    start, end = truth.faces[face].segment
    along = (end - start) / np.linalg.norm(end - start)
    points = transform_points(look.T_world_base, look.points[places])
    return 0.1 * len(np.unique(np.floor(points[:, :2] @ along / 0.1)))


def _median_and_p95(values: Sequence[float]) -> tuple[float, float]:
    if not values:
        return float("nan"), float("nan")
    median, p95 = np.percentile(values, [50.0, 95.0])
    return float(median), float(p95)
