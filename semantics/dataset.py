"""The training set: random buildings, half seen, as the plane mapper would have mapped them.

A building of ``worlds.generator`` gives exact faces. A robot that has been in some of its rooms has
seen their faces, and glimpses of others through doors; its mapper joined what lies on one plane,
shifted and turned each a little, and now and then made two planes of one or one of clutter. What
comes out are ``MapPlane`` objects, cut into pieces by the code that also runs in the loop, so that
training and inference see the same thing. Labels are those of the points, as in the scoring.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field

import numpy as np

from semantics.preprocess import Pieces, Preprocessor
from semantics.proximity import ProximityGraph, features_named, proximity_graph
from slam.core import Array, IntArray, MapPlane
from worlds.conditions import conditions_named
from worlds.generator import GeneratorConfig, random_plan
from worlds.truth import Face, Truth
from worlds.world import true_world


@dataclass(frozen=True)
class DatasetConfig:
    """layouts: buildings; views: samples of each, after different numbers of rooms. Chances and
    sigmas of what mapping does: drop: of a face never mapped; glimpse: of a face of a neighbouring
    room seen through a door; trim [m]: mean length lost at an end; turn [rad] and shift [m] of a
    mapped plane; twin: of a second plane for a face; clutter: mean number of short planes of no
    room in a room; join [m]: gap over which coplanar faces become one plane; spacing [m] of points.
    """

    layouts: int = 1200
    views: int = 2
    drop: float = 0.04
    glimpse: float = 0.45
    trim: float = 0.15
    turn: float = np.radians(0.4)
    shift: float = 0.015
    twin: float = 0.03
    clutter: float = 0.15
    join: float = 1.0
    spacing: float = 0.1
    generator: GeneratorConfig = field(default_factory=GeneratorConfig)


@dataclass(frozen=True)
class Sample:
    """One view: the pieces, their true faces (M,) or -1, rooms (M,) or -1, and labels of pairs.

    pairs: (P, 2) i < j as in the proximity graph; same_room, same_wall: (P,) bool.
    """

    pieces: Pieces
    graph: ProximityGraph
    face: IntArray
    room: IntArray
    same_room: np.ndarray
    same_wall: np.ndarray


def samples(config: DatasetConfig, seed: np.random.SeedSequence, features: str) -> Iterator[Sample]:
    """Every view of every building, in order; the same seed gives the same samples."""
    for child in seed.spawn(config.layouts):
        rng = np.random.default_rng(child)
        truth = true_world(random_plan(rng, config.generator), child, conditions_named("as-built"))
        for _ in range(config.views):
            sample = view_of(truth, config, rng, features)
            if sample is not None:
                yield sample


def view_of(
    truth: Truth, config: DatasetConfig, rng: np.random.Generator, features: str
) -> Sample | None:
    """One partial view of a building; None where it has no two pieces that are close."""
    seen = _seen(truth, config, rng)
    planes, labels = _mapped(truth, seen, config, rng)
    pieces = Preprocessor()(planes)
    graph = proximity_graph(pieces, features_named(features))
    if len(graph.source) == 0:
        return None
    face = _faces_of(pieces, planes, labels)
    room_of = np.array([f.room for f in truth.faces] + [-1])
    room = room_of[face]
    return Sample(
        pieces,
        graph,
        face,
        room,
        same_room_labels(graph.pairs, room),
        same_wall_labels(graph.pairs, face, truth),
    )


# --- what has been seen --------------------------------------------------------------------------


def _seen(truth: Truth, config: DatasetConfig, rng: np.random.Generator) -> dict[int, Array]:
    """Face -> (K, 2) stretches along its segment [m] that some scan has reached."""
    visited, beside = _visited(truth, rng)
    seen: dict[int, Array] = {}
    for room in truth.rooms:
        for face in room.faces:
            if room.id in visited:
                chance = 1.0 - config.drop
            else:
                chance = config.glimpse if room.id in beside else 0.0
            if rng.random() < chance:
                full = room.id in visited and rng.random() < 0.9
                stretches = _stretches(truth.faces[face], full, config, rng)
                if len(stretches):
                    seen[face] = stretches
    return seen


def _visited(truth: Truth, rng: np.random.Generator) -> tuple[set[int], set[int]]:
    """Rooms that the robot has been in, walking through doors, and the rooms beside them."""
    beside: dict[int, set[int]] = {room.id: set() for room in truth.rooms}
    for door in truth.doors:
        a, b = door.rooms
        if a is not None and b is not None:
            beside[a].add(b)
            beside[b].add(a)
    visited = {int(rng.integers(len(truth.rooms)))}
    for _ in range(int(rng.integers(len(truth.rooms)))):
        border = sorted(set().union(*(beside[room] for room in visited)) - visited)
        if not border:
            break
        visited.add(int(rng.choice(border)))
    return visited, set().union(*(beside[room] for room in visited)) - visited


def _stretches(face: Face, full: bool, config: DatasetConfig, rng: np.random.Generator) -> Array:
    """Parts of a face, along its segment [m], with ends lost; or a glimpse of some of it."""
    origin, run = face.segment[0], face.segment[1] - face.segment[0]
    length = float(np.linalg.norm(run))
    parts = np.sort((face.parts - origin) @ (run / length), axis=1)
    low, high = rng.exponential(config.trim, 2) * [1.0, -1.0] + [0.0, length]
    if not full:
        width = length * rng.uniform(0.15, 1.0)
        low = rng.uniform(0.0, length - width)
        high = low + width
    clipped = np.clip(parts, low, high)
    return clipped[clipped[:, 1] - clipped[:, 0] > 0.1]


# --- what is mapped ------------------------------------------------------------------------------


def _mapped(
    truth: Truth, seen: dict[int, Array], config: DatasetConfig, rng: np.random.Generator
) -> tuple[list[MapPlane], list[IntArray]]:
    """Mapped planes, and the true face of each of their points."""
    turn = rng.uniform(-np.pi, np.pi)
    heading = np.array([[np.cos(turn), -np.sin(turn)], [np.sin(turn), np.cos(turn)]])
    planes: list[MapPlane] = []
    labels: list[IntArray] = []
    for group in _groups(truth, seen, config.join):
        for _ in range(1 + (rng.random() < config.twin)):
            points, label = _points(truth, group, seen, config, rng)
            normal = truth.faces[group[0]].normal
            planes.append(_plane(len(planes), points, normal, heading, config, rng))
            labels.append(label)
    for points, normal in _clutter(truth, seen, config, rng):
        planes.append(_plane(len(planes), points, normal, heading, config, rng))
        labels.append(np.full(len(points), -1))
    return planes, labels


def _groups(truth: Truth, seen: dict[int, Array], join: float) -> list[list[int]]:
    """Faces that the mapper takes for one plane: one surface, and no gap wider than ``join``."""
    by_surface: dict[int, list[int]] = {}
    for face in seen:
        by_surface.setdefault(truth.faces[face].surface, []).append(face)
    groups = []
    for faces in by_surface.values():
        normal = truth.faces[faces[0]].normal
        axis = np.array([-normal[1], normal[0]])
        spans = sorted((*np.sort(truth.faces[f].segment @ axis).tolist(), f) for f in faces)
        group, top = [spans[0][2]], spans[0][1]
        for low, high, face in spans[1:]:
            if low - top > join:
                groups.append(group)
                group = []
            group.append(face)
            top = max(top, high)
        groups.append(group)
    return groups


def _points(
    truth: Truth,
    group: list[int],
    seen: dict[int, Array],
    config: DatasetConfig,
    rng: np.random.Generator,
) -> tuple[Array, IntArray]:
    """Points (N, 3) on the faces of a plane, and the face of each."""
    points, labels = [], []
    for face in group:
        shape = truth.faces[face]
        run = shape.segment[1] - shape.segment[0]
        direction = run / np.linalg.norm(run)
        for low, high in seen[face]:
            along = np.arange(low, high, config.spacing)
            place = shape.segment[0] + np.repeat(along, 4)[:, None] * direction
            height = rng.uniform(*shape.z_range, len(place))
            points.append(np.column_stack([place, height]))
            labels.append(np.full(len(place), face))
    return np.concatenate(points), np.concatenate(labels)


def _plane(
    name: int,
    points: Array,
    normal: Array,
    heading: Array,
    config: DatasetConfig,
    rng: np.random.Generator,
) -> MapPlane:
    """The plane as mapped: turned, shifted, in a map of any heading."""
    angle = rng.normal(0.0, config.turn)
    level = normal[:2] / np.linalg.norm(normal[:2])
    level = level + angle * np.array([-level[1], level[0]])
    level /= np.linalg.norm(level)
    middle = points[:, :2].mean(axis=0) + rng.normal(0.0, config.shift) * level
    off = (points[:, :2] - middle) @ level
    flat = points[:, :2] - off[:, None] * level
    mapped_normal = np.append(heading @ level, 0.0)
    mapped = np.column_stack([flat @ heading.T, points[:, 2]])
    return MapPlane(
        id=name,
        normal=mapped_normal,
        d=float(-mapped_normal[:2] @ (heading @ middle)),
        points=mapped,
        point_ids=np.arange(len(points)),
        keyframes=np.zeros(1, dtype=np.int64),
    )


def _clutter(
    truth: Truth, seen: dict[int, Array], config: DatasetConfig, rng: np.random.Generator
) -> Iterator[tuple[Array, Array]]:
    """Short upright planes that stand about in rooms: cupboards, boxes, open door leaves."""
    for room in sorted({truth.faces[face].room for face in seen}):
        low_x, low_y, high_x, high_y = truth.rooms[room].polygon.bounds
        for _ in range(rng.poisson(config.clutter)):
            angle = rng.uniform(-np.pi, np.pi)
            middle = rng.uniform([low_x, low_y], [high_x, high_y])
            length = rng.uniform(0.4, 1.6)
            along = np.repeat(np.arange(-0.5 * length, 0.5 * length, config.spacing), 4)
            direction = np.array([np.cos(angle), np.sin(angle)])
            place = middle + along[:, None] * direction
            points = np.column_stack([place, rng.uniform(0.1, 1.8, len(place))])
            yield points, np.array([-direction[1], direction[0], 0.0])


# --- labels --------------------------------------------------------------------------------------


def _faces_of(pieces: Pieces, planes: list[MapPlane], labels: list[IntArray]) -> IntArray:
    """(M,) the face that most points of each piece are on, -1 for none."""
    faces = np.full(len(pieces), -1, dtype=np.int64)
    for place in range(len(pieces)):
        plane = int(pieces.plane_id[place])
        mine = labels[plane][pieces.piece(place).mask(planes[plane].points)]
        values, counts = np.unique(mine, return_counts=True)
        if len(values):
            faces[place] = values[counts.argmax()]
    return faces


def same_room_labels(pairs: IntArray, room: IntArray) -> np.ndarray:
    """(P,) are both pieces of one room?"""
    i, j = pairs.T
    return (room[i] == room[j]) & (room[i] >= 0)


def same_wall_labels(pairs: IntArray, face: IntArray, truth: Truth) -> np.ndarray:
    """(P,) are the pieces' faces the two faces of a wall?"""
    count = len(truth.faces)
    walls = {a * count + b for wall in truth.walls for a, b in (wall.faces, wall.faces[::-1])}
    keys = face[pairs[:, 0]] * count + face[pairs[:, 1]]
    known = (face[pairs] >= 0).all(axis=1)
    return known & np.isin(keys, np.array(sorted(walls), dtype=np.int64))
