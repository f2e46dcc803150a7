"""What a robot that walks through a building has seen of its faces: rays in plan view.

Part of the training set: the visibility is exact, so glimpses through doors, shadows of corners and
long faces seen at a slant come out as they do in the loop, at a thousandth of its cost.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from shapely.geometry import Point, Polygon

from slam.core import Array, IntArray
from worlds.truth import Truth


@dataclass(frozen=True)
class SightConfig:
    """stops: (least, most) places in a room where the robot looks around; clear: from its walls
    [m]; rays: in a turn; range [m]; spacing: of returns along a face [m] up to which the plane
    extraction still finds a run, with step [rad] between the sensor's own returns; bin: along a
    face [m]; least: shortest stretch [m] that makes a plane."""

    stops: tuple[int, int] = (1, 3)
    clear: float = 0.35
    rays: int = 600
    range: float = 25.0
    spacing: float = 0.12
    step: float = 0.0035
    bin: float = 0.1
    least: float = 0.4


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


@dataclass(frozen=True)
class _Scene:
    """Everything that stops a ray: start, run: (S, 2); face: (S,), -1 for none; of faces: (F, 2)
    first end, direction and normal."""

    start: Array
    run: Array
    face: IntArray
    origin: Array
    direction: Array
    normal: Array


def seen(truth: Truth, stops: Array, extra: Array, config: SightConfig) -> dict[int, Array]:
    """Face -> (K, 2) stretches along its segment [m] that were seen from the stops.

    extra: (B, 2, 2) segments that stand in the way and belong to no face.
    """
    scene = _scene(truth, extra)
    hits = [_look(scene, stop, config) for stop in stops]
    faces = np.concatenate([face for face, _ in hits])
    along = np.concatenate([place for _, place in hits])
    found = {}
    for face in np.unique(faces).tolist():
        stretches = _occupied(along[faces == face], config)
        if len(stretches):
            found[face] = stretches
    return found


def _scene(truth: Truth, extra: Array) -> _Scene:
    face = [f.id for f in truth.faces for _ in f.parts]
    parts = np.concatenate([*(f.parts for f in truth.faces), extra])
    segment = np.array([f.segment for f in truth.faces])
    direction = segment[:, 1] - segment[:, 0]
    return _Scene(
        start=parts[:, 0],
        run=parts[:, 1] - parts[:, 0],
        face=np.append(np.array(face, dtype=np.int64), np.full(len(extra), -1)),
        origin=segment[:, 0],
        direction=direction / np.maximum(np.linalg.norm(direction, axis=1), 1e-9)[:, None],
        normal=np.array([f.normal[:2] for f in truth.faces]),
    )


def _look(scene: _Scene, stop: Array, config: SightConfig) -> tuple[IntArray, Array]:
    """What one turn of the sensor hits: faces (H,), and places along them [m]."""
    angle = np.arange(config.rays) * (2.0 * np.pi / config.rays)
    x, y = np.cos(angle)[:, None], np.sin(angle)[:, None]
    start, run = scene.start - stop, scene.run
    across = x * run[:, 1] - y * run[:, 0]  # (rays, S)
    across[across == 0.0] = 1e-12
    at = (y * start[:, 0] - x * start[:, 1]) / across
    away = (start[:, 0] * run[:, 1] - start[:, 1] * run[:, 0]) / across
    away[(at < 0.0) | (at > 1.0) | (away <= 0.0)] = np.inf
    nearest = away.argmin(axis=1)
    distance = away[np.arange(config.rays), nearest]
    hit = np.flatnonzero((distance < config.range) & (scene.face[nearest] >= 0))
    face = scene.face[nearest[hit]]
    ray = np.column_stack([x[hit, 0], y[hit, 0]])
    slant = -np.einsum("hc,hc->h", ray, scene.normal[face])
    good = distance[hit] * config.step < config.spacing * slant
    face, place = face[good], stop + (distance[hit, None] * ray)[good]
    return face, np.einsum("hc,hc->h", place - scene.origin[face], scene.direction[face])


def _occupied(along: Array, config: SightConfig) -> Array:
    """(K, 2) stretches where there are returns close to each other."""
    along = np.sort(along)
    breaks = np.flatnonzero(np.diff(along) > 3.0 * config.bin)
    low = along[np.append(0, breaks + 1)]
    high = along[np.append(breaks, len(along) - 1)]
    stretches = np.column_stack([low, high])
    return stretches[high - low > config.least]
