"""One storey of a plan file: its rooms, walls and doors, read and written."""

from __future__ import annotations

import json
from collections.abc import Sequence

import numpy as np
import shapely
from shapely import STRtree
from shapely.geometry import MultiPolygon, Polygon
from shapely.geometry.polygon import orient

from worlds.drafting import CentreLine, as_multipolygon, door_footprint, draw_bodies
from worlds.fields import Field
from worlds.plan import (
    CEILING_WHERE_UNKNOWN,
    MAX_DOORS,
    MAX_NEIGHBOURS,
    MAX_ROOMS,
    Opening,
    RoomOutline,
    Storey,
)
from worlds.tangle import tangled

OPENING_KINDS = ("door", "window", "opening")
DOOR_HEIGHT = 2.0
"""Height of a door whose plan gives none [m]."""
MIN_HEIGHT = 0.5
"""Least height of a storey [m]."""
MAX_OVERLAP = 0.02
"""What two rooms may share outside of walls before they count as overlapping [m2]."""


def read_storey(field: Field, index: int) -> Storey:
    """A storey of a building, named by its index where it has no name. Raises InputError."""
    parts = field.members(("rooms", "walls"), ("name", "z_floor", "z_ceiling", "doors"))
    z_floor = parts["z_floor"].number() if "z_floor" in parts else 0.0
    z_ceiling = z_floor + CEILING_WHERE_UNKNOWN
    if "z_ceiling" in parts and parts["z_ceiling"].value is not None:
        z_ceiling = parts["z_ceiling"].number()
        if z_ceiling < z_floor + MIN_HEIGHT:
            parts["z_ceiling"].wrong(f"a height at least {MIN_HEIGHT} m above z_floor {z_floor:g}")
    bodies = _walls(parts["walls"])
    if tangled(np.array(bodies)):
        parts["walls"].fail("expected walls, found ones that cross without end")
    walls = as_multipolygon(shapely.union_all(bodies))
    rooms = [_room(item, i) for i, item in enumerate(parts["rooms"].items(MAX_ROOMS))]
    _check_rooms(parts["rooms"], rooms, walls)
    doors = parts["doors"].items(MAX_DOORS) if "doors" in parts else []
    tree = STRtree(bodies)
    return Storey(
        name=parts["name"].text() if "name" in parts else str(index),
        z_floor=z_floor,
        z_ceiling=z_ceiling,
        rooms=tuple(rooms),
        walls=walls,
        openings=tuple(_door(door, tree, z_ceiling - z_floor) for door in doors),
    )


# --- rooms ---------------------------------------------------------------------------------------


def _room(field: Field, index: int) -> RoomOutline:
    parts = field.members(("outline",), ("id", "name", "kind", "holes"))
    identity = parts["id"].text() if "id" in parts else str(index)
    return RoomOutline(
        id=identity,
        name=parts["name"].text() if "name" in parts else identity,
        kind=parts["kind"].text().lower() if "kind" in parts else "room",
        outline=_polygon(parts),
    )


def _check_rooms(field: Field, rooms: Sequence[RoomOutline], walls: MultiPolygon) -> None:
    """Rooms have names of their own, free space between the walls, and do not overlap."""
    seen: dict[str, int] = {}
    for i, room in enumerate(rooms):
        if room.id in seen:
            field.items()[i].fail(f'id "{room.id}" is also that of rooms[{seen[room.id]}]')
        seen[room.id] = i
    free = shapely.difference([room.outline for room in rooms], walls)
    for i in np.flatnonzero(shapely.area(free) < MAX_OVERLAP).tolist():
        field.items()[i].fail(f'room "{rooms[i].name}" has no free space outside the walls')
    tree, touching = STRtree(free), 0
    for i, room in enumerate(free):
        near = tree.query(room, predicate="intersects")
        near = near[near > i]
        touching += len(near)
        if touching > MAX_NEIGHBOURS:
            field.fail("expected rooms side by side, found ones that touch without end")
        for j in near[shapely.area(shapely.intersection(free[near], room)) > MAX_OVERLAP]:
            names = f'"{rooms[i].name}" (rooms[{i}]) and "{rooms[j].name}"'
            field.items()[j].fail(f"rooms {names} overlap, expected rooms side by side")


# --- walls and doors -----------------------------------------------------------------------------


def _walls(field: Field) -> list[Polygon]:
    lines, outlines = [], []
    for item in field.items():
        if item.has("outline"):
            outlines.append(_polygon(item.members(("outline",), ("holes",))))
        else:
            lines.append(_centre_line(item))
    if not lines and not outlines:
        field.wrong("at least one wall")
    return draw_bodies(lines, outlines)


def _centre_line(field: Field) -> CentreLine:
    parts = field.members(("from", "to", "thickness"), ())
    start, end = np.array(parts["from"].point()), np.array(parts["to"].point())
    thickness = parts["thickness"].positive()
    if np.linalg.norm(end - start) < 1e-3:
        parts["to"].wrong("another point than in from: the wall has no length")
    return CentreLine(start, end, thickness)


def _door(field: Field, bodies: STRtree, height: float) -> Opening:
    shape = ("outline",) if field.has("outline") else ("at", "width")
    parts = field.members(shape, ("kind", "height", "sill", "head", "holes", "glass"))
    kind = parts["kind"].choice(OPENING_KINDS) if "kind" in parts else "door"
    z_min, z_max = _heights(field, parts, height)
    footprint = _polygon(parts) if "outline" in parts else _across(parts, bodies)
    touched = bodies.geometries[bodies.query(footprint, predicate="intersects")]
    if not shapely.area(shapely.intersection(touched, footprint)).sum() > 1e-6:
        parts[shape[0]].wrong("a door on a wall: no wall is there")
    glass = parts["glass"].truth() if "glass" in parts else False
    return Opening(kind, footprint, z_min, z_max, glass)


def _across(parts: dict[str, Field], bodies: STRtree) -> Polygon:
    width = parts["width"].positive()
    footprint = door_footprint(np.array(parts["at"].point()), width, bodies)
    if footprint is None:
        parts["at"].wrong(f"the middle of a door that lies on one wall over its {width:g} m")
    return footprint


def _heights(field: Field, parts: dict[str, Field], ceiling: float) -> tuple[float, float]:
    """(sill, head) of a door above the floor, from any two of sill, head and height."""
    sill = parts["sill"].number() if "sill" in parts else 0.0
    if "head" in parts and "height" in parts:
        field.fail("expected head or height, found both")
    if "head" in parts:
        head = parts["head"].positive()
    else:
        head = sill + (parts["height"].positive() if "height" in parts else DOOR_HEIGHT)
        head = head if "height" in parts else min(head, ceiling)
    if not 0.0 <= sill < head <= ceiling + 1e-9:
        field.fail(
            f"expected 0 <= sill < head <= {ceiling:g} m (the ceiling), "
            f"found sill {sill:g} and head {head:g}"
        )
    return sill, head


# --- polygons ------------------------------------------------------------------------------------


def _polygon(parts: dict[str, Field]) -> Polygon:
    """The polygon of ``outline`` and ``holes``: not self-crossing, and with an area."""
    holes = parts["holes"].items() if "holes" in parts else []
    polygon = Polygon(_ring(parts["outline"]), [_ring(hole) for hole in holes])
    if not polygon.is_valid:
        reason = shapely.is_valid_reason(polygon)
        parts["outline"].fail(f"expected an outline that does not cross itself: {reason}")
    return polygon


def _ring(field: Field) -> list[tuple[float, float]]:
    points = [item.point() for item in field.items()]
    ring = points[:-1] if len(points) > 1 and points[0] == points[-1] else points
    if len(set(ring)) < 3:
        field.wrong("at least three different points")
    if Polygon(ring).area < 1e-6:
        field.wrong("an outline with an area")
    return ring


# --- writing -------------------------------------------------------------------------------------


def storey_text(storey: Storey) -> str:
    """A storey as it stands in a plan file; walls become outlines."""
    rooms = [
        f'{{"id": {quoted(r.id)}, "name": {quoted(r.name)}, "kind": {quoted(r.kind)}, '
        f"{_outline(r.outline)}}}"
        for r in storey.rooms
    ]
    doors = [
        f'{{"kind": {quoted(o.kind)}, "sill": {o.z_min!r}, "head": {o.z_max!r}, '
        f'"glass": {json.dumps(o.glass)}, {_outline(o.footprint)}}}'
        for o in storey.openings
    ]
    walls = [f"{{{_outline(wall)}}}" for wall in storey.walls.geoms]
    return (
        f'{{"name": {quoted(storey.name)}, "z_floor": {storey.z_floor!r}, '
        f'"z_ceiling": {storey.z_ceiling!r},\n'
        f'"rooms": {_block(rooms)},\n"walls": {_block(walls)},\n"doors": {_block(doors)}}}'
    )


def _outline(polygon: Polygon) -> str:
    polygon = orient(polygon)
    holes = [_points(hole.coords) for hole in polygon.interiors]
    text = f'"outline": {_points(polygon.exterior.coords)}'
    return text + (f', "holes": [{", ".join(holes)}]' if holes else "")


def _points(coords: Sequence[tuple[float, ...]]) -> str:
    return json.dumps([[float(x), float(y)] for x, y, *_ in list(coords)[:-1]])


def _block(lines: Sequence[str]) -> str:
    return "[\n  " + ",\n  ".join(lines) + "]" if lines else "[]"


def quoted(value: str) -> str:
    """A text as it stands in a plan file, every letter readable."""
    return json.dumps(value, ensure_ascii=False)
