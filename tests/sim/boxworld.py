"""Small worlds of boxes whose every face is known in closed form."""

from __future__ import annotations

from dataclasses import dataclass

import mujoco
import numpy as np
from numpy.typing import NDArray
from shapely.geometry import MultiPolygon, Polygon, box
from shapely.ops import unary_union

from slam.core import Array
from worlds.truth import CEILING, FLOOR, Door, Face, Floor, Room, Truth

HEIGHT = 2.7


@dataclass(frozen=True)
class BoxMesh:
    vertices: Array
    triangles: NDArray[np.int32]
    face: NDArray[np.int32]
    geom_name: NDArray[np.int32]
    geom_names: tuple[str, ...]
    glass: NDArray[np.bool_]


@dataclass(frozen=True)
class BoxWorld:
    plan: None
    truth: Truth
    spec: mujoco.MjSpec
    mesh: BoxMesh
    footprints: tuple[MultiPolygon, ...]
    ramps: tuple[()] = ()
    people: tuple[()] = ()


@dataclass(frozen=True)
class Box:
    """A body by its centre, half sizes and yaw; label: of all its sides, None: a face each."""

    name: str
    centre: tuple[float, float, float]
    half: tuple[float, float, float]
    yaw: float = 0.0
    label: int | None = None
    glass: bool = False

    @property
    def rotation(self) -> Array:
        c, s = np.cos(self.yaw), np.sin(self.yaw)
        return np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])

    @property
    def footprint(self) -> Polygon:
        signs = np.array([[-1, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]])
        corners = (signs * self.half) @ self.rotation.T + self.centre
        return Polygon(corners[:, :2])


def wall(name: str, x0: float, y0: float, x1: float, y1: float, **options: float) -> Box:
    """A box from its ground rectangle; z0, z1 and yaw as options."""
    z0, z1 = options.get("z0", 0.0), options.get("z1", HEIGHT)
    centre = (0.5 * (x0 + x1), 0.5 * (y0 + y1), 0.5 * (z0 + z1))
    half = (0.5 * (x1 - x0), 0.5 * (y1 - y0), 0.5 * (z1 - z0))
    return Box(name, centre, half, options.get("yaw", 0.0))


def build_box_world(boxes: list[Box], rooms: tuple[Room, ...], doors: tuple[Door, ...]) -> BoxWorld:
    """A world of walls, and a floor and a ceiling over all of it."""
    low_x, low_y, high_x, high_y = unary_union([b.footprint for b in boxes]).bounds
    middle = (0.5 * (low_x + high_x), 0.5 * (low_y + high_y))
    half = (0.5 * (high_x - low_x), 0.5 * (high_y - low_y), 0.05)
    slabs = [
        Box("floor", (*middle, -0.05), half, label=FLOOR),
        Box("ceiling", (*middle, HEIGHT + 0.05), half, label=CEILING),
    ]
    mesh, faces = _mesh_and_faces([*boxes, *slabs])
    standing = unary_union([b.footprint for b in boxes if b.centre[2] - b.half[2] < 0.05])
    footprint = standing if isinstance(standing, MultiPolygon) else MultiPolygon([standing])
    truth = Truth(faces, (), rooms, doors, (Floor(0, 0.0, HEIGHT),))
    return BoxWorld(None, truth, _spec([*boxes, *slabs]), mesh, (footprint,))


def _spec(boxes: list[Box]) -> mujoco.MjSpec:
    spec = mujoco.MjSpec()
    for b in boxes:
        spec.worldbody.add_geom(
            name=b.name,
            type=mujoco.mjtGeom.mjGEOM_BOX,
            pos=b.centre,
            size=b.half,
            quat=[np.cos(b.yaw / 2), 0.0, 0.0, np.sin(b.yaw / 2)],
        )
    return spec


def _mesh_and_faces(boxes: list[Box]) -> tuple[BoxMesh, tuple[Face, ...]]:
    vertices, triangles, labels, names, faces = [], [], [], [], []
    for number, b in enumerate(boxes):
        for axis in range(3):
            for sign in (-1.0, 1.0):
                normal, corners = _side(b, axis, sign)
                label = len(faces) if b.label is None else b.label
                first = len(vertices)
                vertices.extend(corners)
                triangles += [(first, first + 1, first + 2), (first, first + 2, first + 3)]
                labels += [label, label]
                names += [number, number]
                if b.label is None:
                    faces.append(_face(label, normal, corners))
    mesh = BoxMesh(
        np.array(vertices),
        np.array(triangles, dtype=np.int32),
        np.array(labels, dtype=np.int32),
        np.array(names, dtype=np.int32),
        tuple(b.name for b in boxes),
        np.repeat([b.glass for b in boxes], 12),
    )
    return mesh, tuple(faces)


def _side(b: Box, axis: int, sign: float) -> tuple[Array, Array]:
    """Outward normal (3,) and corners (4, 3) of one side, in the world."""
    others = [i for i in range(3) if i != axis]
    corners = np.zeros((4, 3))
    corners[:, axis] = sign * b.half[axis]
    for corner, (u, v) in zip(corners, ((-1, -1), (1, -1), (1, 1), (-1, 1)), strict=True):
        corner[others] = u * b.half[others[0]], v * b.half[others[1]]
    return sign * b.rotation[:, axis], corners @ b.rotation.T + b.centre


def _face(label: int, normal: Array, corners: Array) -> Face:
    segment = corners[:2, :2]
    low, high = float(corners[:, 2].min()), float(corners[:, 2].max())
    d = float(-normal @ corners[0])
    return Face(label, 0, normal, d, segment, segment[None], (low, high), label)


def _room(number: int, name: str, kind: str, outline: Polygon) -> Room:
    return Room(number, name, kind, 0, outline, ())


def _doorway(x: float, y: float, rooms: tuple[int, int], width: float) -> Door:
    return Door(np.array([x, y]), rooms, width, 2.0)


def flat(door: float = 0.9, turn: float = 0.0) -> BoxWorld:
    """Two rooms over a corridor, joined by doors, and a cellar that no door leads to.

    turn [rad]: yaw of the wall between the two rooms, about its middle.
    """
    half = 0.5 * door
    rooms = (
        _room(0, "Corridor", "corridor", box(0.0, 0.0, 8.2, 1.5)),
        _room(1, "Left", "room", box(0.0, 1.7, 4.0, 5.7)),
        _room(2, "Right", "room", box(4.2, 1.7, 8.2, 5.7)),
        _room(3, "Cellar", "room", box(8.4, 0.0, 10.4, 5.7)),
    )
    doors = (_doorway(1.2, 1.6, (0, 1), door), _doorway(7.0, 1.6, (0, 2), door))
    boxes = [
        wall("south", -0.2, -0.2, 10.6, 0.0),
        wall("north", -0.2, 5.7, 10.6, 5.9),
        wall("west", -0.2, 0.0, 0.0, 5.7),
        wall("east", 10.4, 0.0, 10.6, 5.7),
        wall("cellar_wall", 8.2, 0.0, 8.4, 5.7),
        wall("between", 4.0, 1.75, 4.2, 5.65, yaw=turn),
        wall("inner_a", 0.0, 1.5, 1.2 - half, 1.7),
        wall("inner_b", 1.2 + half, 1.5, 7.0 - half, 1.7),
        wall("inner_c", 7.0 + half, 1.5, 8.2, 1.7),
        wall("lintel_a", 1.2 - half, 1.5, 1.2 + half, 1.7, z0=2.0),
        wall("lintel_b", 7.0 - half, 1.5, 7.0 + half, 1.7, z0=2.0),
    ]
    return build_box_world(boxes, rooms, doors)


def single_room(width: float = 6.0, depth: float = 4.0) -> BoxWorld:
    """One closed room from (0, 0) to (width, depth)."""
    boxes = [
        wall("south", -0.2, -0.2, width + 0.2, 0.0),
        wall("north", -0.2, depth, width + 0.2, depth + 0.2),
        wall("west", -0.2, 0.0, 0.0, depth),
        wall("east", width, 0.0, width + 0.2, depth),
    ]
    return build_box_world(boxes, (_room(0, "Only", "room", box(0, 0, width, depth)),), ())
