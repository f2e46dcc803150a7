"""The truth of a building as built: faces, walls, rooms, doors and floors, measured."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import shapely
from shapely import STRtree
from shapely.geometry import MultiPolygon

from slam.core import Array, IntArray
from worlds.asbuilt import AsBuilt, build_walls
from worlds.conditions import Conditions
from worlds.faces import Stretches, coplanar, sides_in_line, storey_faces
from worlds.layout import Layout
from worlds.sidemap import NOTHING, SideMap
from worlds.truth import Door, Face, Floor, Room, Truth, Wall

THICKEST = 0.6
"""Faces of one wall are at most this far apart [m]."""
THINNEST = 0.01
"""... and at least this far [m]."""
ANTIPARALLEL = -np.cos(np.radians(1.5))
"""Cosine of the angle between the normals of a wall's two faces, at most."""
SAME_SURFACE = 0.02
"""Faces whose ends are at most this far off each other's plane are one surface [m]."""
MIN_COMMON = 0.3
"""A wall's two faces run beside each other for at least this long [m]."""


@dataclass(frozen=True)
class BuiltStorey:
    """A storey with what happened to it. index: its place in the plan."""

    index: int
    layout: Layout
    built: AsBuilt


def as_built(
    index: int, layout: Layout, conditions: Conditions, rng: np.random.Generator
) -> BuiltStorey:
    """A storey built under some conditions."""
    walls = layout.outline, (layout.cut, layout.open_cut), sides_in_line(layout)
    return BuiltStorey(index, layout, build_walls(*walls, layout.height, conditions, rng))


def survey(storeys: Sequence[BuiltStorey]) -> tuple[Truth, tuple[SideMap, ...]]:
    """The truth, and per storey which face or label each stretch of its outline carries."""
    faces: list[Face] = []
    rooms: list[Room] = []
    doors: list[Door] = []
    pairs: list[tuple[int, int, float]] = []
    labels = []
    for storey in storeys:
        found, label = storey_faces(storey.layout, storey.built, len(faces), len(rooms))
        first_room = len(rooms)
        pairs += _wall_pairs(storey, found)
        rooms += _rooms(storey, found, first_room)
        doors += _doors(storey, first_room)
        faces += found
        labels.append(label)
    walls = tuple(Wall(k, (i, j), thick) for k, (i, j, thick) in enumerate(pairs))
    truth = Truth(_with_surfaces(faces), walls, tuple(rooms), tuple(doors), _floors(storeys))
    return truth, tuple(labels)


def _with_surfaces(faces: Sequence[Face]) -> tuple[Face, ...]:
    """The faces, those on one plane and facing one way with one surface number."""
    if not faces:
        return ()
    z = [[sum(face.z_range) / 2.0] * 2 for face in faces]
    ends = np.concatenate([[face.segment for face in faces], np.array(z)[..., None]], axis=2)
    group = coplanar(Stretches(np.array([face.normal for face in faces]), ends), SAME_SURFACE)
    return tuple(replace(face, surface=int(g)) for face, g in zip(faces, group, strict=True))


def _floors(storeys: Sequence[BuiltStorey]) -> tuple[Floor, ...]:
    plans = [(storey.index, storey.layout.storey) for storey in storeys]
    return tuple(Floor(index, plan.z_floor, plan.z_ceiling) for index, plan in plans)


def _rooms(storey: BuiltStorey, faces: Sequence[Face], first: int) -> list[Room]:
    built, height = storey.built, storey.layout.height
    own: dict[int, list[int]] = {}
    for face in faces:
        own.setdefault(face.room, []).append(face.id)
    found = []
    for i, room in enumerate(storey.layout.rooms, start=first):
        polygon = built.place_polygon(room.polygon, height / 2.0)
        found.append(Room(i, room.name, room.kind, storey.index, polygon, tuple(own.get(i, ()))))
    return found


def _doors(storey: BuiltStorey, first_room: int) -> list[Door]:
    doors = storey.layout.doors
    if not doors:
        return []
    drawn = np.array([door.middle for door in doors])
    centres = storey.built.at_height(drawn, storey.layout.height / 2.0)
    return [
        Door(
            centre=centre,
            rooms=(_room_id(door.rooms[0], first_room), _room_id(door.rooms[1], first_room)),
            width=door.width,
            height=door.height,
        )
        for door, centre in zip(doors, centres, strict=True)
    ]


def _room_id(room: int, first: int) -> int | None:
    return None if room == NOTHING else first + room


# --- walls ---------------------------------------------------------------------------------------


def _wall_pairs(storey: BuiltStorey, faces: Sequence[Face]) -> list[tuple[int, int, float]]:
    """(face, face, thickness) of all walls."""
    if not faces:
        return []
    layout, built = storey.layout, storey.built
    middle = layout.height / 2.0
    solid = MultiPolygon([built.place_polygon(p, middle) for p in layout.open_cut.geoms])
    owner = np.repeat(np.arange(len(faces)), [len(face.parts) for face in faces])
    parts = np.concatenate([face.parts for face in faces])
    level = np.array([face.normal[:2] / np.hypot(*face.normal[:2]) for face in faces])[owner]
    lines = shapely.linestrings(parts)
    i, j = STRtree(lines).query(lines, predicate="dwithin", distance=1.1 * THICKEST)
    facing = np.einsum("ij,ij->i", level[i], level[j])
    kept = (i < j) & (facing < ANTIPARALLEL)
    i, j = i[kept], j[kept]
    common, depth = _beside(parts, level, i, j, solid)
    return _summed(faces, owner[i], owner[j], common, depth)


def _beside(
    parts: Array, level: Array, i: IntArray, j: IntArray, solid: MultiPolygon
) -> tuple[Array, Array]:
    """(P,) length along which parts i and j bound one wall body, and its thickness [m].

    There must be nothing but wall between them at three places.
    """
    start, along = parts[i, 0], np.column_stack([-level[i, 1], level[i, 0]])
    reach = np.einsum("pkj,pj->pk", parts[j] - start[:, None], along)
    own = np.linalg.norm(parts[i, 1] - start, axis=1)
    low, high = np.maximum(reach.min(axis=1), 0.0), np.minimum(reach.max(axis=1), own)
    thickness = _depth(start, along, (low + high) / 2.0, parts[j, 0], level[i], level[j])
    fits = (thickness > THINNEST) & (thickness <= THICKEST) & (high > low)
    shapely.prepare(solid)
    for share in (0.1, 0.5, 0.9):
        place = low + share * (high - low)
        depth = _depth(start, along, place, parts[j, 0], level[i], level[j])
        foot = start + place[:, None] * along
        probe = [foot - (k * depth)[:, None] * level[i] for k in (0.05, 0.95)]
        fits &= shapely.covers(solid, shapely.linestrings(np.stack(probe, axis=1)))
    return np.where(fits, high - low, 0.0), thickness


def _depth(
    start: Array, along: Array, place: Array, other: Array, normal: Array, opposite: Array
) -> Array:
    """(P,) from some place along each face straight in, to the plane of the other face [m].

    Walls taper: what is measured in their middle holds there alone.
    """
    foot = start + place[:, None] * along
    return np.einsum("pj,pj->p", other - foot, opposite) / -np.einsum("pj,pj->p", normal, opposite)


def _summed(
    faces: Sequence[Face], first: IntArray, second: IntArray, common: Array, depth: Array
) -> list[tuple[int, int, float]]:
    """Pairs of faces with enough common extent over all their parts."""
    low, high = np.minimum(first, second), np.maximum(first, second)
    keys, row = np.unique(np.column_stack([low, high]), axis=0, return_inverse=True)
    extent = np.bincount(row, common, len(keys))
    thickness = np.bincount(row, common * depth, len(keys))
    return [
        (faces[i].id, faces[j].id, float(thick / length))
        for (i, j), length, thick in zip(keys, extent, thickness, strict=True)
        if length >= MIN_COMMON and i != j
    ]
