"""The truth of a world as JSON: for tools that score without us, and for people.

    {"format": "roomloop-truth-1", "scene": ..., "seed": 0, "conditions": "as-built",
     "floors": [{"storey": 0, "z_floor": 0.0, "z_ceiling": 2.7}],
     "rooms": [{"id": 0, "name": ..., "kind": "room", "storey": 0, "outline": [[x, y], ...],
                "holes": [[[x, y], ...]], "faces": [0, 1, 2]}],
     "faces": [{"id": 0, "room": 0, "surface": 0, "normal": [x, y, z], "d": 0.0,
                "segment": [[x, y], [x, y]], "parts": [[[x, y], [x, y]]], "z_range": [0.0, 2.7]}],
     "walls": [{"id": 0, "faces": [0, 5], "thickness": 0.1}],
     "doors": [{"centre": [x, y], "rooms": [0, null], "width": 0.9, "height": 2.0}],
     "adjacency": [[0, 1]],
     "labels": {"none": -1, "floor": -2, ...}}

Metres, world frame, z up; heights are absolute. Faces, walls and rooms stand at their ids. A face's
plane is normal . x + d = 0 with the normal into the room; its segment and parts are plan views at
mid height, left end first when seen from the room. ``surface`` is shared by coplanar faces that
look the same way. A room of null is outside. ``adjacency`` follows from the doors: the pairs of
rooms that one joins. ``labels`` are those of LiDAR returns that are on no face.
"""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from shapely.geometry import Polygon

from slam.core import Array, InputError
from worlds.fields import Field, read_json
from worlds.truth import LABELS, Door, Face, Floor, Room, Truth, Wall

FORMAT = "roomloop-truth-1"


@dataclass(frozen=True)
class TruthFile:
    """A truth, and what it is the truth of."""

    truth: Truth
    scene: str
    seed: int
    conditions: str


def write_truth(file: TruthFile, path: Path) -> None:
    """Writes the truth, whole or not at all. Raises InputError where that is impossible."""
    truth = file.truth
    head = [
        f'"{name}": {json.dumps(value)}'
        for name, value in (
            ("format", FORMAT),
            ("scene", file.scene),
            ("seed", file.seed),
            ("conditions", file.conditions),
        )
    ]
    blocks = [
        _block("floors", [_floor(floor) for floor in truth.floors]),
        _block("rooms", [_room(room) for room in truth.rooms]),
        _block("faces", [_face(face) for face in truth.faces]),
        _block("walls", [vars(wall) for wall in truth.walls]),
        _block("doors", [_door(door) for door in truth.doors]),
        f'"adjacency": {json.dumps(adjacency(truth))}',
        f'"labels": {json.dumps(LABELS)}',
    ]
    partial = path.with_name(path.name + ".part")
    try:
        partial.write_text("{" + ",\n".join([*head, *blocks]) + "}\n", encoding="utf-8")
        partial.replace(path)
    except OSError as error:
        raise InputError(f"{path}: cannot be written: {error.strerror or error}") from error


def adjacency(truth: Truth) -> list[tuple[int, int]]:
    """The pairs of rooms that a door joins, each once, in order."""
    pairs = [(a, b) for a, b in (door.rooms for door in truth.doors)]
    return sorted({(min(a, b), max(a, b)) for a, b in pairs if a is not None and b is not None})


def _block(name: str, items: list[dict]) -> str:
    lines = ",\n  ".join(json.dumps(item) for item in items)
    return f'"{name}": [\n  {lines}]' if items else f'"{name}": []'


def _floor(floor: Floor) -> dict[str, object]:
    return dict(vars(floor))


def _room(room: Room) -> dict[str, object]:
    return {
        "id": room.id,
        "name": room.name,
        "kind": room.kind,
        "storey": room.storey,
        "outline": _ring(room.polygon.exterior.coords),
        "holes": [_ring(ring.coords) for ring in room.polygon.interiors],
        "faces": list(room.faces),
    }


def _ring(coords: object) -> list[list[float]]:
    points: list[list[float]] = np.asarray(coords, dtype=np.float64)[:-1, :2].tolist()
    return points


def _face(face: Face) -> dict[str, object]:
    return {
        "id": face.id,
        "room": face.room,
        "surface": face.surface,
        "normal": face.normal.tolist(),
        "d": face.d,
        "segment": face.segment.tolist(),
        "parts": face.parts.tolist(),
        "z_range": list(face.z_range),
    }


def _door(door: Door) -> dict[str, object]:
    return {
        "centre": np.asarray(door.centre, dtype=np.float64).tolist(),
        "rooms": list(door.rooms),
        "width": door.width,
        "height": door.height,
    }


# --- reading -------------------------------------------------------------------------------------


def read_truth(path: Path) -> TruthFile:
    """What ``write_truth`` wrote. Raises InputError that names file, field and what is wrong."""
    root = read_json(path)
    blocks = ("floors", "rooms", "faces", "walls", "doors")
    required = ("format", "scene", "seed", "conditions", *blocks)
    top = root.members(required, ("adjacency", "labels"))
    top["format"].choice((FORMAT,))
    truth = Truth(
        faces=tuple(_read_face(item, i) for i, item in enumerate(top["faces"].items())),
        walls=tuple(_read_wall(item, i) for i, item in enumerate(top["walls"].items())),
        rooms=tuple(_read_room(item, i) for i, item in enumerate(top["rooms"].items())),
        doors=tuple(_read_door(item) for item in top["doors"].items()),
        floors=tuple(_read_floor(item) for item in top["floors"].items()),
    )
    _check_references(truth, top)
    return TruthFile(truth, top["scene"].text(), top["seed"].whole(), top["conditions"].text())


def _check_references(truth: Truth, top: dict[str, Field]) -> None:
    """Every number that stands for a room or a face is one of the file's."""
    rooms, faces = range(len(truth.rooms)), range(len(truth.faces))
    checks = [
        *(("faces", i, face.room in rooms) for i, face in enumerate(truth.faces)),
        *(("walls", i, all(f in faces for f in wall.faces)) for i, wall in enumerate(truth.walls)),
        *(("rooms", i, all(f in faces for f in room.faces)) for i, room in enumerate(truth.rooms)),
        *(
            ("doors", i, all(room is None or room in rooms for room in door.rooms))
            for i, door in enumerate(truth.doors)
        ),
    ]
    for block, i, good in checks:
        if not good:
            top[block].items()[i].fail("names a room or a face that is not in the file")


def _read_floor(field: Field) -> Floor:
    parts = field.members(("storey", "z_floor", "z_ceiling"), ())
    return Floor(parts["storey"].whole(), parts["z_floor"].number(), parts["z_ceiling"].number())


def _read_room(field: Field, index: int) -> Room:
    parts = field.members(("id", "name", "kind", "storey", "outline", "holes", "faces"), ())
    _check_id(parts["id"], index)
    holes = [_points(hole, 3) for hole in parts["holes"].items()]
    return Room(
        id=index,
        name=parts["name"].text(),
        kind=parts["kind"].text(),
        storey=parts["storey"].whole(),
        polygon=Polygon(_points(parts["outline"], 3), holes),
        faces=tuple(item.whole() for item in parts["faces"].items()),
    )


def _read_face(field: Field, index: int) -> Face:
    names = ("id", "room", "surface", "normal", "d", "segment", "parts", "z_range")
    parts = field.members(names, ())
    _check_id(parts["id"], index)
    low, high = _numbers(parts["z_range"], 2).tolist()
    return Face(
        id=index,
        room=parts["room"].whole(),
        normal=_numbers(parts["normal"], 3),
        d=parts["d"].number(),
        segment=_segment(parts["segment"]),
        parts=np.array([_segment(item) for item in parts["parts"].items()]).reshape(-1, 2, 2),
        z_range=(low, high),
        surface=parts["surface"].whole(),
    )


def _read_wall(field: Field, index: int) -> Wall:
    parts = field.members(("id", "faces", "thickness"), ())
    _check_id(parts["id"], index)
    faces = [item.whole() for item in parts["faces"].items()]
    if len(faces) != 2:
        parts["faces"].wrong("two faces")
    return Wall(index, (faces[0], faces[1]), parts["thickness"].positive())


def _read_door(field: Field) -> Door:
    parts = field.members(("centre", "rooms", "width", "height"), ())
    rooms = [None if item.value is None else item.whole() for item in parts["rooms"].items()]
    if len(rooms) != 2:
        parts["rooms"].wrong("two rooms, null for outside")
    centre = np.array(parts["centre"].point())
    width, height = parts["width"].positive(), parts["height"].positive()
    return Door(centre, (rooms[0], rooms[1]), width, height)


def _check_id(field: Field, index: int) -> None:
    if field.whole() != index:
        field.wrong(f"{index}, its place in the list")


def _points(field: Field, least: int) -> Array:
    points = [item.point() for item in field.items()]
    if len(points) < least:
        field.wrong(f"at least {least} points")
    return np.array(points)


def _segment(field: Field) -> Array:
    points = _points(field, 2)
    if len(points) > 2:
        field.wrong("two points")
    return points


def _numbers(field: Field, count: int) -> Array:
    items = field.items()
    if len(items) != count:
        field.wrong(f"{count} numbers")
    return np.array([item.number() for item in items])
