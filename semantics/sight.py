"""What a robot that walks through a building has seen of its surfaces, and what is mapped of that.

Part of the training set: the rays are those of the sensor, so glimpses through doors, shadows of
corners and furniture, long faces seen at a slant, and how high up a surface was seen, come out as
they do in the loop, at a hundredth of its cost.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from shapely.geometry import Point, Polygon

from slam.core import Array, IntArray
from worlds.truth import Truth
from worlds.world import Mesh


@dataclass(frozen=True)
class SightConfig:
    """stops: (least, most) places in a room where the robot looks around; clear: from its walls
    [m]; height: of the sensor above the floor [m]; beams, and the elevation of the highest [rad];
    rays: of a beam in a turn, and true_rays: of the sensor's own; radius: of the robot [m]; range
    [m]; spacing: of the sensor's returns along a surface [m] up to which the plane extraction still
    finds a run; gap: a jump that ends a run, min_run: the shortest, min_length and min_points: of
    the smallest plane, about as in the plane extraction [m]; skirting: above the floor, what is
    taken for it [m]; level: sine of the slope above which a
    surface is a floor or lies on its back.
    """

    stops: tuple[int, int] = (1, 4)
    clear: float = 0.35
    height: float = 0.5
    beams: int = 16
    elevation: float = np.radians(15.0)
    rays: int = 720
    true_rays: int = 1800
    radius: float = 0.2
    range: float = 25.0
    spacing: float = 0.12
    gap: float = 0.35
    min_run: float = 0.2
    min_length: float = 0.35
    min_points: int = 90
    skirting: float = 0.06
    level: float = 0.3


def walk(truth: Truth, rng: np.random.Generator, config: SightConfig) -> Array:
    """(S, 2) places where the robot has looked around: some way through the rooms, by the doors."""
    beside: dict[int, list[tuple[int, Array]]] = {room.id: [] for room in truth.rooms}
    for door in truth.doors:
        a, b = door.rooms
        if a is not None and b is not None and a != b:
            beside[a].append((b, door.centre[:2]))
            beside[b].append((a, door.centre[:2]))
    room = int(rng.integers(len(truth.rooms)))
    visited, stops = {room}, list(_stops(truth, room, rng, config))
    for _ in range(int(rng.integers(1 + len(truth.rooms)))):
        ways = [(there, at) for here in sorted(visited) for there, at in beside[here]]
        ways = [(there, at) for there, at in ways if there not in visited]
        if not ways:
            break
        room, doorway = ways[int(rng.integers(len(ways)))]
        visited.add(room)
        stops += [doorway, *_stops(truth, room, rng, config)]
    return np.array(stops[: max(1, len(stops) - int(rng.integers(3)))])


def _stops(truth: Truth, room: int, rng: np.random.Generator, config: SightConfig) -> list[Array]:
    """Places in a room, clear of its walls where it has any such."""
    polygon = truth.rooms[room].polygon
    inner = polygon.buffer(-config.clear)
    inner = polygon if inner.is_empty else inner
    low_x, low_y, high_x, high_y = inner.bounds
    found: list[Array] = []
    for _ in range(int(rng.integers(*config.stops, endpoint=True))):
        for _ in range(20):
            place = rng.uniform([low_x, low_y], [high_x, high_y])
            if inner.covers(Point(place)):
                found.append(place)
                break
    return found or [_inside(polygon)]


def _inside(polygon: Polygon) -> Array:
    return np.array(polygon.representative_point().coords[0])


class Surfaces:
    """The upright surfaces of a building: P patches, each a face, or one side of one solid that is
    no face. face: (P,) -1 for none; normal: (P, 3) outward; axis: (P, 2) level, along it."""

    def __init__(self, truth: Truth, mesh: Mesh, config: SightConfig = SightConfig()):
        opaque = ~mesh.glass
        triangles = mesh.triangles[opaque]
        normal = _normals(mesh.vertices, triangles)
        label = mesh.face[opaque].astype(np.int64)
        sides = np.round(normal * 20.0).astype(np.int64)
        upright = np.abs(normal[:, 2]) < config.level
        key = np.column_stack([label, mesh.geom_name[opaque], sides])
        key[label >= 0, 1:] = 0
        kinds, patch = np.unique(key[upright], axis=0, return_inverse=True)
        self.face = np.where(kinds[:, 0] >= 0, kinds[:, 0], -1)
        self.normal = np.zeros((len(kinds), 3))
        self.normal[patch.ravel()] = normal[upright]
        level = self.normal[:, :2] / np.linalg.norm(self.normal[:, :2], axis=1, keepdims=True)
        self.axis = np.column_stack([-level[:, 1], level[:, 0]])
        self._patch = np.full(len(triangles), -1, dtype=np.int64)
        self._patch[upright] = patch.ravel()
        self._scene = _scene(mesh.vertices, triangles)
        self._floors = np.array([floor.z_floor for floor in truth.floors])

    def hits(self, stop: Array, start: float, config: SightConfig) -> tuple[IntArray, Array]:
        """What one turn of the sensor at a stop (2,) hits of patches: which (H,), and where (H, 3);
        only at a slant at which the extraction still finds a run, and nothing from within
        something. start: azimuth of the first ray [rad]."""
        import open3d as o3d

        origin = np.append(stop, self._floors[0] + config.height)
        rays = _rays(start, config)
        sixfold = np.column_stack([np.broadcast_to(origin, rays.shape), rays]).astype(np.float32)
        cast = self._scene.cast_rays(o3d.core.Tensor.from_numpy(sixfold))
        distance = cast["t_hit"].numpy().astype(np.float64)
        triangle = cast["primitive_ids"].numpy().astype(np.int64)
        near = distance < config.range
        if distance.min() < config.radius:
            near[:] = False
        hit = np.flatnonzero(near)
        hit = hit[self._patch[triangle[hit]] >= 0]
        patch = self._patch[triangle[hit]]
        slant = -np.einsum("hc,hc->h", rays[hit], self.normal[patch])
        above = distance[hit] * rays[hit, 2] + config.height > config.skirting
        good = above & (distance[hit] * (2.0 * np.pi / config.true_rays) < config.spacing * slant)
        hit = hit[good]
        return patch[good], origin + distance[hit, None] * rays[hit]


def _normals(vertices: Array, triangles: np.ndarray) -> Array:
    """(T, 3) unit, outward."""
    a, b, c = (vertices[triangles[:, k]] for k in range(3))
    normal = np.cross(b - a, c - a)
    return np.asarray(normal / np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), 1e-12))


def _scene(vertices: Array, triangles: np.ndarray) -> Any:
    import open3d as o3d

    scene = o3d.t.geometry.RaycastingScene(nthreads=1)
    tensor = o3d.core.Tensor.from_numpy
    scene.add_triangles(tensor(vertices.astype(np.float32)), tensor(triangles.astype(np.uint32)))
    return scene


def _rays(start: float, config: SightConfig) -> Array:
    """(beams * rays, 3) unit."""
    azimuth = start + np.arange(config.rays) * (2.0 * np.pi / config.rays)
    up = np.linspace(-config.elevation, config.elevation, config.beams)[:, None]
    x, y = np.cos(up) * np.cos(azimuth), np.cos(up) * np.sin(azimuth)
    return np.column_stack([x.ravel(), y.ravel(), np.broadcast_to(np.sin(up), x.shape).ravel()])


def seen(
    surfaces: Surfaces, stops: Array, rng: np.random.Generator, config: SightConfig
) -> tuple[IntArray, Array]:
    """Returns on what was mapped from the stops (S, 2): patch (H,) and place (H, 3), world frame.

    Mapped is, from one stop, a patch with as many returns, in runs as long, as the plane extraction
    asks for.
    """
    looks = [surfaces.hits(stop, rng.uniform(0.0, 2.0 * np.pi), config) for stop in stops]
    kept = [_of_planes(surfaces, patch, place, config) for patch, place in looks]
    patch = np.concatenate([look[0][rows] for look, rows in zip(looks, kept, strict=True)])
    place = np.concatenate([look[1][rows] for look, rows in zip(looks, kept, strict=True)])
    return patch, place


def _of_planes(surfaces: Surfaces, patch: IntArray, place: Array, config: SightConfig) -> IntArray:
    """Which returns of one turn are on what was mapped."""
    along = np.einsum("hc,hc->h", place[:, :2], surfaces.axis[patch])
    order = np.lexsort((along, patch))
    return order[_in_planes(patch[order], along[order], config)]


def _in_planes(owner: IntArray, along: Array, config: SightConfig) -> NDArray[np.bool_]:
    """(H,) which returns, sorted by owner and along it [m], are in runs that make planes."""
    if len(owner) == 0:
        return np.zeros(0, dtype=bool)
    breaks = (np.diff(owner) > 0) | (np.diff(along) > config.gap)
    first = np.append(0, np.flatnonzero(breaks) + 1)
    last = np.append(first[1:], len(owner)) - 1
    run = np.cumsum(np.append(False, breaks))
    size = along[last] - along[first]
    long = size > config.min_run
    everyone, place = np.unique(owner[first], return_inverse=True)
    length = np.bincount(place, weights=np.where(long, size, 0.0), minlength=len(everyone))
    count = np.bincount(place, weights=np.where(long, last - first + 1, 0.0))
    enough = count * (config.true_rays / config.rays) >= config.min_points
    plane = (length > config.min_length) & enough
    return np.asarray((long & plane[place])[run])
