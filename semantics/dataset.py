"""The training set: random buildings, half seen, as the plane mapper would have mapped them.

A building of ``worlds.generator`` gives exact faces, and a walk through it what was seen of each.
The mapper joined what lies on one plane, shifted and turned each a little (by as much as it was
measured to do in simulated runs, ``plane_noise.csv``), and now and then made two planes of one or
one of clutter. What comes out are ``MapPlane`` objects, cut into pieces by the code that also runs
in the loop, so that training and inference see the same thing. Labels are those of the points, as
in the scoring.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path
from typing import Protocol

import numpy as np
from shapely.geometry import MultiPoint

from semantics.preprocess import Pieces, Preprocessor
from semantics.sight import SightConfig, seen, walk
from slam.core import Array, IntArray, MapPlane
from worlds.conditions import conditions_named
from worlds.generator import GeneratorConfig, random_plan
from worlds.truth import Truth
from worlds.world import true_world

NOISE = Path(__file__).parent / "plane_noise.csv"
"""Length of a mapped plane [m], how far it was turned [rad] and shifted [m] off the true one."""


def buildings(shear: float) -> GeneratorConfig:
    """Random buildings with more of what is hard than there is in most: L- and T-shapes, slanted
    and round corners; shear: share of those whose walls do not meet at right angles."""
    return GeneratorConfig(carve=0.25, join=0.12, chamfer=0.08, curve=0.4, shear=shear)


@dataclass(frozen=True)
class DatasetConfig:
    """layouts: buildings; views: samples of each, after different walks. Chances and sizes of what
    mapping does: drop: of a face never mapped; noise: deviation of the logarithm by which a map is
    noisier than the measured ones; twin: of a second plane for a face; clutter: mean number of
    cupboards and the like in a room; join [m]: gap over which coplanar faces become one plane;
    spacing [m] of points.
    """

    layouts: int = 700
    views: int = 3
    drop: float = 0.03
    noise: float = 0.7
    twin: float = 0.02
    clutter: float = 0.2
    join: float = 1.0
    spacing: float = 0.1
    sight: SightConfig = field(default_factory=SightConfig)
    generator: GeneratorConfig = field(default_factory=lambda: buildings(shear=0.15))

    def draw(self, seed: np.random.SeedSequence) -> list[Sample]:
        """Every view of one building."""
        rng = np.random.default_rng(seed)
        truth = true_world(random_plan(rng, self.generator), seed, conditions_named("as-built"))
        return [view_of(truth, self, rng) for _ in range(self.views)]


@dataclass(frozen=True)
class Sample:
    """One view: the pieces, their true faces (M,) and rooms (M,), -1 for none; walls: (W, 2) the
    faces of each true wall."""

    pieces: Pieces
    face: IntArray
    room: IntArray
    walls: IntArray


class TrainingSet(Protocol):
    """Something that samples can be drawn from; the same seed gives the same samples."""

    @property
    def layouts(self) -> int:
        """How many buildings it has."""
        ...

    def draw(self, seed: np.random.SeedSequence) -> list[Sample]:
        """The samples of one building."""
        ...


def samples(training_set: TrainingSet, seed: np.random.SeedSequence) -> Iterator[Sample]:
    """Every sample of every building, in order."""
    for child in seed.spawn(training_set.layouts):
        yield from training_set.draw(child)


def view_of(truth: Truth, config: DatasetConfig, rng: np.random.Generator) -> Sample:
    """What one walk through a building has made of it."""
    clutter = list(_clutter(truth, config, rng))
    stops = walk(truth, rng, config.sight)
    in_the_way = np.array([ends for ends, _ in clutter]).reshape(-1, 2, 2)
    visible = seen(truth, stops, in_the_way, config.sight)
    visible = {face: parts for face, parts in visible.items() if rng.random() > config.drop}
    near = [item for item in clutter if _is_near(item[0], stops)]
    planes, labels = _mapped(truth, visible, near, config, rng)
    pieces = Preprocessor()(planes)
    face = _faces_of(pieces, planes, labels)
    room_of = np.array([f.room for f in truth.faces] + [-1])
    walls = np.array([wall.faces for wall in truth.walls], dtype=np.int64).reshape(-1, 2)
    return Sample(pieces, face, room_of[face], walls)


# --- what is mapped ------------------------------------------------------------------------------


def _mapped(
    truth: Truth,
    visible: dict[int, Array],
    clutter: Sequence[tuple[Array, Array]],
    config: DatasetConfig,
    rng: np.random.Generator,
) -> tuple[list[MapPlane], list[IntArray]]:
    """Mapped planes, and the true face of each of their points."""
    turn = rng.uniform(-np.pi, np.pi)
    heading = np.array([[np.cos(turn), -np.sin(turn)], [np.sin(turn), np.cos(turn)]])
    scale = float(np.exp(rng.normal(0.0, config.noise)))
    planes: list[MapPlane] = []
    labels: list[IntArray] = []
    for group in _groups(truth, visible, config.join):
        for _ in range(1 + (rng.random() < config.twin)):
            points, label = _points(truth, group, visible, config, rng)
            normal = truth.faces[group[0]].normal
            planes.append(_plane(len(planes), points, normal, heading, scale, rng))
            labels.append(label)
    for ends, normal in clutter:
        points = _on(ends, config.spacing, (0.1, 1.8), rng)
        planes.append(_plane(len(planes), points, normal, heading, scale, rng))
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
        for stretch in seen[face]:
            ends = shape.segment[0] + stretch[:, None] * direction
            points.append(_on(ends, config.spacing, shape.z_range, rng))
            labels.append(np.full(len(points[-1]), face))
    return np.concatenate(points), np.concatenate(labels)


def _on(
    ends: Array, spacing: float, heights: tuple[float, float], rng: np.random.Generator
) -> Array:
    """Points (N, 3) above a segment (2, 2)."""
    length = float(np.linalg.norm(ends[1] - ends[0]))
    along = np.repeat(np.arange(0.0, length, spacing) / length, 4)
    place = ends[0] + along[:, None] * (ends[1] - ends[0])
    return np.column_stack([place, rng.uniform(*heights, len(place))])


def _plane(
    name: int,
    points: Array,
    normal: Array,
    heading: Array,
    scale: float,
    rng: np.random.Generator,
) -> MapPlane:
    """The plane as mapped: turned, shifted, in a map of any heading."""
    level = normal[:2] / np.linalg.norm(normal[:2])
    middle = points[:, :2].mean(axis=0)
    reach = (points[:, :2] - middle) @ np.array([-level[1], level[0]])
    turn, shift = _noise(float(np.ptp(reach)), scale, rng)
    middle = middle + shift * level
    level = level + np.tan(turn) * np.array([-level[1], level[0]])
    level /= np.linalg.norm(level)
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


@cache
def _measured() -> Array:
    """(M, 3) rows of ``NOISE``, by length."""
    rows = np.loadtxt(NOISE, delimiter=",", skiprows=1)
    return np.asarray(rows[np.argsort(rows[:, 0], kind="stable")])


def _noise(length: float, scale: float, rng: np.random.Generator) -> tuple[float, float]:
    """Turn [rad] and shift [m] of a mapped plane that long: those of one about as long."""
    rows = _measured()
    place = int(np.searchsorted(rows[:, 0], length)) + int(rng.integers(-NEAR, NEAR + 1))
    _, turn, shift = rows[min(max(place, 0), len(rows) - 1)] * scale * rng.choice([-1.0, 1.0])
    return float(np.clip(turn, -0.5, 0.5)), float(shift)


NEAR = 12
"""Rows of the measured noise, up and down, that a plane's own is drawn from."""


def _clutter(
    truth: Truth, config: DatasetConfig, rng: np.random.Generator
) -> Iterator[tuple[Array, Array]]:
    """Short upright planes that stand about in rooms, (2, 2) ends and (3,) normal: door leaves,
    and two sides of cupboards and pillars."""
    for room in truth.rooms:
        low_x, low_y, high_x, high_y = room.polygon.bounds
        for _ in range(rng.poisson(config.clutter)):
            angle = rng.uniform(-np.pi, np.pi)
            if rng.random() < 0.7 and room.faces:
                normal = truth.faces[int(rng.choice(room.faces))].normal
                angle = np.arctan2(normal[1], normal[0])
            direction = np.array([np.cos(angle), np.sin(angle)])
            left = np.array([-direction[1], direction[0]])
            corner = rng.uniform([low_x, low_y], [high_x, high_y])
            width, depth = rng.uniform(0.4, 1.8), rng.uniform(0.4, 1.0)
            ends = np.array([corner, corner + width * direction, corner + depth * left])
            if not room.polygon.covers(MultiPoint(ends)):
                continue
            yield ends[[0, 1]], np.append(-left, 0.0)
            if rng.random() < 0.6:
                yield ends[[0, 2]], np.append(-direction, 0.0)


def _is_near(ends: Array, stops: Array, reach: float = 6.0) -> bool:
    """Is some stop within reach of a thing in a room?"""
    return bool(np.linalg.norm(stops - ends.mean(axis=0), axis=1).min() < reach)


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


NONE, SAME_ROOM, SAME_WALL = 0, 1, 2
"""Labels of pairs."""


def labels_of(sample: Sample, pairs: IntArray) -> IntArray:
    """(P,) what each pair (P, 2) of a sample's pieces is."""
    i, j = pairs.T
    label = np.full(len(pairs), NONE, dtype=np.int64)
    label[(sample.room[i] == sample.room[j]) & (sample.room[i] >= 0)] = SAME_ROOM
    count = int(max(sample.face.max(initial=0), sample.walls.max(initial=0))) + 1
    walls = np.concatenate([sample.walls, sample.walls[:, ::-1]])
    known = (sample.face[i] >= 0) & (sample.face[j] >= 0)
    keys = sample.face[i] * count + sample.face[j]
    label[known & np.isin(keys, walls[:, 0] * count + walls[:, 1])] = SAME_WALL
    return label
