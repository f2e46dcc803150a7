"""The training set: random buildings, half seen, as the plane mapper would have mapped them.

A building of ``worlds.generator``, bare or with all that may stand in it, gives exact surfaces, and
a walk through it what was seen of each. The mapper joined what lies on one plane, shifted and
turned each a little (by as much as it was measured to do in simulated runs, ``plane_noise.csv``),
and now and then made two planes of one. What comes out are ``MapPlane`` objects, cut into pieces by
the code that also runs in the loop, so that training and inference see the same thing. Labels are
those of the points, as in the scoring: what is on furniture belongs to no room.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path
from typing import Protocol

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from semantics.preprocess import Pieces, Preprocessor
from semantics.sight import SightConfig, Surfaces, seen, walk
from slam.core import Array, IntArray, MapPlane
from worlds.conditions import conditions_named
from worlds.generator import GeneratorConfig, random_plan
from worlds.plan import Plan
from worlds.truth import Truth
from worlds.world import true_mesh

NOISE = Path(__file__).parent / "plane_noise.csv"
"""Length of a mapped plane [m], how far it was turned [rad] and shifted [m] off the true one."""
CONDITIONS = (
    ("as-built", 0.4),
    ("furniture", 0.2),
    ("furniture+open-doors", 0.1),
    ("office", 0.1),
    ("clutter", 0.05),
    ("real-site", 0.15),
)
"""What a building is drawn under, and how often."""


def buildings(shear: float) -> GeneratorConfig:
    """Random buildings with more of what is hard than there is in most: L- and T-shapes, slanted
    and round corners, corridors that open into one another, piers and pillars; shear: share of
    those whose walls do not meet at right angles."""
    return GeneratorConfig(
        kinds=(*GeneratorConfig().kinds, "wings", "wings", "blocks"),
        room_width=(1.2, 8.0),
        room_depth=(1.2, 9.0),
        max_rooms=24,
        carve=0.25,
        join=0.4,
        chamfer=0.08,
        curve=0.4,
        shear=shear,
        taper=0.3,
        cross=0.5,
        opening=0.5,
        piers=0.15,
        pillars=0.15,
    )


@dataclass(frozen=True)
class DatasetConfig:
    """layouts: buildings; views: samples of each, after different walks; conditions: presets, by
    their shares. Chances and sizes of what mapping does: drop: of a surface never mapped; noise:
    deviation of the logarithm by which a map is noisier than the measured ones; twin: of a second
    plane for a part of a surface, noisier by twin_noise; flat [m], parallel [rad]: within what two
    surfaces are taken for one, drawn for each view; join [m]: gap over which they are; thin [m]:
    along and up, of the sample of points kept.
    """

    layouts: int = 3000
    views: int = 3
    conditions: tuple[tuple[str, float], ...] = CONDITIONS
    drop: float = 0.03
    noise: float = 0.7
    twin: float = 0.1
    twin_noise: float = 2.0
    flat: tuple[float, float] = (0.0, 0.06)
    parallel: float = np.radians(1.5)
    join: float = 1.0
    thin: tuple[float, float] = (0.05, 0.15)
    sight: SightConfig = field(default_factory=SightConfig)
    generator: GeneratorConfig = field(default_factory=lambda: buildings(shear=0.15))

    def draw(self, seed: np.random.SeedSequence) -> list[Sample]:
        """Every view of one building."""
        rng = np.random.default_rng(seed)
        return self.views_of(random_plan(rng, self.generator), seed, rng)

    def views_of(
        self, plan: Plan, seed: np.random.SeedSequence, rng: np.random.Generator
    ) -> list[Sample]:
        """Every view of the lowest storey of a plan, built from the seed."""
        shares = np.array([share for _, share in self.conditions])
        name, _ = self.conditions[int(rng.choice(len(shares), p=shares / shares.sum()))]
        truth, mesh = true_mesh(plan, seed, conditions_named(name), storey=0)
        surfaces = Surfaces(truth, mesh, self.sight)
        return [view_of(truth, surfaces, self, rng) for _ in range(self.views)]


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


def view_of(
    truth: Truth, surfaces: Surfaces, config: DatasetConfig, rng: np.random.Generator
) -> Sample:
    """What one walk through a building has made of it."""
    stops = walk(truth, rng, config.sight)
    patch, place = seen(surfaces, stops, rng, config.sight)
    kept = rng.random(len(surfaces.face)) > config.drop
    patch, place = patch[kept[patch]], place[kept[patch]]
    planes, labels = _mapped(surfaces, *_thinned(surfaces, patch, place, config), config, rng)
    pieces = Preprocessor()(planes)
    face = _faces_of(pieces, planes, labels)
    room_of = np.array([f.room for f in truth.faces] + [-1])
    walls = np.array([wall.faces for wall in truth.walls], dtype=np.int64).reshape(-1, 2)
    return Sample(pieces, face, room_of[face], walls)


# --- what is mapped ------------------------------------------------------------------------------


def _thinned(
    surfaces: Surfaces, patch: IntArray, place: Array, config: DatasetConfig
) -> tuple[IntArray, Array]:
    """The returns, of each cell of a patch one; sorted by patch."""
    along = np.einsum("hc,hc->h", place[:, :2], surfaces.axis[patch])
    key = patch
    for coordinate, size in zip((along, place[:, 2]), config.thin, strict=True):
        cell = np.floor((coordinate - coordinate.min(initial=0.0)) / size).astype(np.int64)
        key = key * (int(cell.max(initial=0)) + 1) + cell
    first = np.unique(key, return_index=True)[1]
    return patch[first], place[first]


def _mapped(
    surfaces: Surfaces,
    patch: IntArray,
    place: Array,
    config: DatasetConfig,
    rng: np.random.Generator,
) -> tuple[list[MapPlane], list[IntArray]]:
    """Mapped planes, and the true face of each of their points."""
    turn = rng.uniform(-np.pi, np.pi)
    heading = np.array([[np.cos(turn), -np.sin(turn)], [np.sin(turn), np.cos(turn)]])
    scale = float(np.exp(rng.normal(0.0, config.noise)))
    planes: list[MapPlane] = []
    labels: list[IntArray] = []
    group = _groups(surfaces, patch, place, float(rng.uniform(*config.flat)), config)
    for name in range(int(group.max(initial=-1)) + 1):
        mine = np.flatnonzero(group == name)
        normal = surfaces.normal[np.bincount(patch[mine]).argmax()]
        both = [(mine, scale)]
        if rng.random() < config.twin:
            both.append((_part(surfaces, patch, place, mine, rng), scale * config.twin_noise))
        for rows, noise in both:
            planes.append(_plane(len(planes), place[rows], normal, heading, noise, rng))
            labels.append(surfaces.face[patch[rows]])
    return planes, labels


def _part(
    surfaces: Surfaces, patch: IntArray, place: Array, mine: IntArray, rng: np.random.Generator
) -> IntArray:
    """Of the returns of one plane those on some stretch of it."""
    along = place[mine, :2] @ surfaces.axis[patch[mine[0]]]
    low, high = np.sort(rng.uniform(along.min(), along.max(), 2))
    some = mine[(along >= low) & (along <= high)]
    return some if len(some) else mine


def _groups(
    surfaces: Surfaces, patch: IntArray, place: Array, flat: float, config: DatasetConfig
) -> IntArray:
    """(H,) the plane that the mapper takes each return (by patch) to be on: patches that face the
    same way, lie on one plane within ``flat`` [m] and leave no gap wider than ``join`` between them
    are one."""
    names, first, number = np.unique(patch, return_index=True, return_inverse=True)
    if len(names) == 0:
        return np.zeros(0, dtype=np.int64)
    normal, axis = surfaces.normal[names], surfaces.axis[names]
    count = np.bincount(number)
    middle = np.add.reduceat(place, first) / count[:, None]
    along = np.einsum("hc,hc->h", place[:, :2], axis[number])
    low, high = np.minimum.reduceat(along, first), np.maximum.reduceat(along, first)
    height = np.einsum("ijc,ic->ij", middle[None] - middle[:, None], normal)  # of j above i
    at = middle[:, :2] @ axis.T  # (j, i) of j's middle along i
    half = 0.5 * (high - low)
    gap = np.abs(at.T - np.diag(at)[:, None]) - half[:, None] - half[None]
    one = (normal @ normal.T > np.cos(config.parallel)) & (gap < config.join)
    one &= np.maximum(np.abs(height), np.abs(height.T)) < flat
    return connected_components(coo_array(one), directed=False)[1].astype(np.int64)[number]


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
