"""A house drawn by hand, and runs through it whose every number can be worked out on paper.

     0            4  4.1          8.1
4.6  +-----------------------------+      faces of A (room 0): 0 south, 1 east, 2 north, 3 west
     |  C (corridor, room 2)       |      faces of B (room 1): 4 south, 5 east, 6 north, 7 west
3.1  +------------+--+-------------+      faces of C (room 2): 8 south, 9 east, 10 north, 11 west
3.0  +------------+  +-------------+
     |  A         |  |  B          |      walls: 0 = (1, 7), 1 = (2, 8), 2 = (6, 8)
0.0  +------------+  +-------------+      all walls 2.5 m high
"""

from __future__ import annotations

import sys
from collections.abc import Mapping, Sequence
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from shapely.geometry import box

from eval.labels import TruthKeeper
from sim.truth import ScanTruth
from slam.core import (
    Array,
    MapPlane,
    MapView,
    PlanePiece,
    Scan,
    inverse,
    point_ids,
    so3_exp,
    transform_plane,
    transform_points,
)
from worlds.truth import Face, Floor, Room, Truth, Wall

# Makes fakes.py importable under --import-mode=importlib.
sys.path.insert(0, str(Path(__file__).parent))

HEIGHT = 2.5
BOXES = ((0.0, 0.0, 4.0, 3.0), (4.1, 0.0, 8.1, 3.0), (0.0, 3.1, 8.1, 4.6))
NAMES = ("A", "B", "C")
WALLS = ((1, 7), (2, 8), (6, 8))
SOUTH, EAST, NORTH, WEST = range(4)


class House:
    """The truth, and hand-made parts of runs through it."""

    def __init__(self) -> None:
        faces = [face for room, outline in enumerate(BOXES) for face in _faces(room, outline)]
        planes = sorted({_plane_key(face) for face in faces})
        self.truth = Truth(
            faces=tuple(
                Face(**{**vars(face), "id": i, "surface": planes.index(_plane_key(face))})
                for i, face in enumerate(faces)
            ),
            walls=tuple(Wall(i, pair, 0.1) for i, pair in enumerate(WALLS)),
            rooms=tuple(
                Room(i, NAMES[i], "room", 0, box(*outline), tuple(range(4 * i, 4 * i + 4)))
                for i, outline in enumerate(BOXES)
            ),
            doors=(),
            floors=(Floor(0, 0.0, HEIGHT),),
        )

    def returns(self, face: int, low: float, high: float) -> Array:
        """(N, 3) two returns in every 5 cm of a stretch of a face, at each of four heights."""
        start, end = self.truth.faces[face].segment
        run = (end - start) / np.linalg.norm(end - start)
        along = np.arange(low + 0.0125, high, 0.025)
        ground = start + along[:, None] * run
        heights = np.array([0.1, 0.9, 1.6, 2.4])
        return np.column_stack([np.tile(ground, (4, 1)), np.repeat(heights, len(along))])

    def scan(
        self,
        index: int,
        stamp: float,
        position: Sequence[float],
        looks: Mapping[int, tuple[float, float]],
        extra: Sequence[tuple[int, Array]] = (),
    ) -> tuple[Scan, ScanTruth]:
        """A scan of stretches of faces {face: (low, high)} and of other returns (label, points)."""
        parts = [(face, self.returns(face, *stretch)) for face, stretch in looks.items()]
        parts += list(extra)
        world = np.concatenate([np.empty((0, 3)), *(points for _, points in parts)])
        labels = np.repeat([label for label, _ in parts], [len(points) for _, points in parts])
        T_world_base = np.eye(4)
        T_world_base[:3, 3] = position
        n = len(world)
        scan = Scan(
            index=index,
            stamp=stamp,
            points=transform_points(inverse(T_world_base), world),
            times=np.linspace(-0.1, 0.0, n),
            ring=np.zeros(n, dtype=np.int16),
            intensity=np.zeros(n),
        )
        return scan, ScanTruth(
            T_world_base, labels.astype(np.int32), labels.astype(np.int32), world.astype(np.float32)
        )

    def whole(self, *faces: int) -> dict[int, tuple[float, float]]:
        """All of each face."""
        return {face: (0.0, self.truth.faces[face].length) for face in faces}

    def keeper(self, *looks: Mapping[int, tuple[float, float]]) -> TruthKeeper:
        """A keeper that has seen one keyframe per look, from the middle of A."""
        keeper = TruthKeeper(self.truth)
        for index, look in enumerate(looks):
            pair = self.scan(index, 0.1 * index, (2.0, 1.5, 0.0), look)
            keeper.add(keeper.digest(*pair, keyframe=True))
        return keeper

    def plane(
        self,
        id: int,
        pair: tuple[Scan, ScanTruth],
        stretches: Mapping[int, tuple[float, float]],
        T_map_world: Array | None = None,
        shift: float = 0.0,
    ) -> MapPlane:
        """The plane of a scan's returns on stretches of faces, moved ``shift`` off its face."""
        scan, truth = pair
        T = np.eye(4) if T_map_world is None else T_map_world
        own = np.zeros(len(scan), dtype=bool)
        for face, (low, high) in stretches.items():
            start, end = self.truth.faces[face].segment
            run = (end - start) / np.linalg.norm(end - start)
            along = (truth.points_world[:, :2] - start) @ run
            own |= (truth.face == face) & (along >= low - 1e-6) & (along <= high + 1e-6)
        face = self.truth.faces[next(iter(stretches))]
        normal, d = transform_plane(T, face.normal, face.d - shift)
        points = truth.points_world[own].astype(np.float64) + shift * face.normal
        ids = point_ids(scan.index, np.flatnonzero(own))
        return MapPlane(id, normal, d, transform_points(T, points), ids, np.array([scan.index]))

    @staticmethod
    def piece(plane: MapPlane) -> PlanePiece:
        """All of a plane."""
        along = plane.points[:, :2] @ plane.axis
        foot = plane.points[along.argmin(), :2], plane.points[along.argmax(), :2]
        return PlanePiece(plane.id, np.array(foot))

    @staticmethod
    def view(*planes: MapPlane) -> MapView:
        """A map of planes."""
        return MapView(0.0, planes, ())

    def drive(self, points: Sequence[Sequence[float]], steps: int = 40) -> Array:
        """(N, 4, 4) true poses along a polyline, heading where it goes."""
        corners = np.array(points, dtype=np.float64)
        poses = []
        for start, end in pairwise(corners):
            yaw = np.arctan2(*(end - start)[1::-1])
            for fraction in np.linspace(0.0, 1.0, steps, endpoint=False):
                T = np.eye(4)
                T[:3, :3] = so3_exp(np.array([0.0, 0.0, yaw]))
                T[:2, 3] = start[:2] + fraction * (end - start)[:2]
                poses.append(T)
        return np.array(poses)


def _faces(room: int, outline: tuple[float, float, float, float]) -> list[Face]:
    x0, y0, x1, y1 = outline
    # Counter-clockwise outline walked backwards: left end first, seen from inside.
    segments = {
        SOUTH: ((x1, y0), (x0, y0)),
        EAST: ((x1, y1), (x1, y0)),
        NORTH: ((x0, y1), (x1, y1)),
        WEST: ((x0, y0), (x0, y1)),
    }
    normals = {SOUTH: (0.0, 1.0), EAST: (-1.0, 0.0), NORTH: (0.0, -1.0), WEST: (1.0, 0.0)}
    faces = []
    for side, segment in segments.items():
        ends = np.array(segment)
        normal = np.array([*normals[side], 0.0])
        d = -float(normal[:2] @ ends[0])
        faces.append(Face(0, room, normal, d, ends, ends[None], (0.0, HEIGHT), 0))
    return faces


def _plane_key(face: Face) -> tuple[float, ...]:
    return (*np.round(face.normal, 3).tolist(), round(face.d, 3))


@pytest.fixture(scope="session")
def house() -> House:
    return House()
