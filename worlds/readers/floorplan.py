"""The floor-plan JSON of traced plans and converted building models, as a Plan.

    {"units"?: "metre", "storeys": [{"name", "z_floor", "z_ceiling": number | null,
      "rooms": [{"id" | "guid", "name", "number"?, "type"?, "polygons": [{"outer", "holes"}]}],
      "walls": [{"solid": [{"outer", "holes"}], "z_min"?, "z_max"?}],
      "openings": [{"kind", "z_min", "z_max", "polygon": [[x, y], ...]}],
      "columns"?: [{"polygon" | "polygons" | "solid", "z_min"?, "z_max"?}]}]}

Metres, heights absolute. Columns become walls (a free-standing one is a pillar); furniture is left
out, and other fields are passed over: such files carry more than a world needs.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import shapely
from shapely.geometry import Polygon
from shapely.geometry.base import BaseGeometry

from worlds.drafting import as_multipolygon
from worlds.fields import Field
from worlds.plan import (
    CEILING_WHERE_UNKNOWN,
    MAX_ROOMS,
    MAX_STOREYS,
    Opening,
    Plan,
    RoomOutline,
    Storey,
)
from worlds.readers.bodies import Body, build_up
from worlds.readers.roomset import kind_of, sound_rooms
from worlds.readers.trees import member, members, number, text
from worlds.readers.units import METRE, scale_to_metres
from worlds.tangle import tangled

DOOR_HEIGHT = 2.0
"""Height of an opening whose file gives none [m]."""
MIN_HEIGHT = 1.0
"""Least height of a storey [m]."""
MAX_MENDED = 2000
"""Outlines with more corners are not mended where they cross themselves."""
LEAST_PART = 1.0
"""Parts of a room beside its largest one that are smaller than this are left out [m2]."""
KINDS = ("door", "window", "opening")
TYPES = {"C": "corridor", "E": "stairs"}
"""Codes that traced plans give to rooms whose name does not tell."""


def is_floorplan(root: Field) -> bool:
    """Does the file look like a floor plan of this kind?"""
    value = root.value
    return isinstance(value, dict) and "format" not in value and "storeys" in value


def floorplan(root: Field, path: Path) -> Plan:
    """The plan in a parsed file. Storeys without rooms or without walls are left out. Raises
    InputError that names file, field and what was expected."""
    if text(root, "units").lower() not in ("", *METRE):
        member(root, "units").wrong("metre")
    fields = member(root, "storeys").items(MAX_STOREYS)
    drawn = [field for field in fields if members(field, "rooms") and members(field, "walls")]
    if not drawn:
        member(root, "storeys").fail("expected at least one storey with rooms and walls")
    storeys = tuple(_storey(field, fields, path) for field in drawn)
    sizes = np.array([s.walls.bounds for s in storeys if not s.walls.is_empty]).reshape(-1, 4)
    if len(sizes):
        extent = sizes[:, 2:].max(axis=0) - sizes[:, :2].min(axis=0)
        scale_to_metres(path, extent, 1.0, None, "units")
    return Plan(path.stem, storeys, _notes(fields, drawn))


def _notes(fields: Sequence[Field], drawn: Sequence[Field]) -> str:
    left_out = [f'"{text(f, "name") or f.path}"' for f in fields if f not in drawn]
    furniture = sum(len(members(field, "furniture")) for field in fields)
    notes = ["Read from a floor-plan JSON."]
    if left_out:
        notes.append(f"Without rooms or walls, left out: storey {', '.join(left_out)}.")
    if furniture:
        notes.append(f"Left out: {furniture} pieces of furniture.")
    return " ".join(notes)


# --- one storey ----------------------------------------------------------------------------------


def _storey(field: Field, storeys: Sequence[Field], path: Path) -> Storey:
    """A storey, with the walls and openings of the other ``storeys`` that reach into it."""
    z_floor = number(field, "z_floor", 0.0)
    z_ceiling = number(field, "z_ceiling", z_floor + CEILING_WHERE_UNKNOWN)
    height = z_ceiling - z_floor
    if height < MIN_HEIGHT:
        member(field, "z_ceiling").wrong(f"a ceiling at least {MIN_HEIGHT:g} m above the floor")
    bodies = _bodies(field, storeys, z_floor, height)
    if tangled(np.array([body.footprint for body in bodies], dtype=object)):
        member(field, "walls").fail("expected walls, found outlines that cross without end")
    walls = build_up(bodies, _holes(field, storeys, z_floor), height)
    drawn = member(field, "rooms").items(MAX_ROOMS)
    rooms = [room for i, item in enumerate(drawn) for room in _room(item, i)]
    return Storey(
        name=text(field, "name") or field.path,
        z_floor=z_floor,
        z_ceiling=z_ceiling,
        rooms=sound_rooms(rooms, walls.solid, walls.full, f"{path}: {field.path}"),
        walls=walls.solid,
        openings=walls.openings,
    )


def _bodies(field: Field, storeys: Sequence[Field], z_floor: float, height: float) -> list[Body]:
    """Walls and columns. Without heights of their own they reach from floor to ceiling."""
    found = []
    for item in _own_and_reaching(field, storeys, ("walls", "columns")):
        low = number(item, "z_min", z_floor) - z_floor
        high = number(item, "z_max", z_floor + height) - z_floor
        found += [Body(shape, low, high) for shape in _shapes(item)]
    return found


def _own_and_reaching(field: Field, storeys: Sequence[Field], keys: tuple[str, ...]) -> list[Field]:
    """Elements of a storey, and of the others those that tell their heights."""
    return [
        item
        for storey in storeys
        for key in keys
        for item in members(storey, key)
        if storey is field or _tells_heights(item)
    ]


def _tells_heights(field: Field) -> bool:
    value = field.value
    return isinstance(value, dict) and None not in (value.get("z_min"), value.get("z_max"))


def _shapes(field: Field) -> list[BaseGeometry]:
    """The outline of a wall or column: polygons, or one ring of points."""
    value = field.value
    if isinstance(value, dict) and "polygon" in value:
        ring = member(field, "polygon")
        return [_valid(ring, Polygon(_ring(ring)))]
    key = "polygons" if isinstance(value, dict) and "polygons" in value else "solid"
    return [_polygon(item) for item in member(field, key).items()]


def _holes(field: Field, storeys: Sequence[Field], z_floor: float) -> list[Opening]:
    """The openings of all storeys, once each; those above or below this one do not matter."""
    found = [_hole(item, z_floor) for item in _own_and_reaching(field, storeys, ("openings",))]
    return list({(hole.footprint.wkb, hole.z_min): hole for hole in found}.values())


def _hole(field: Field, z_floor: float) -> Opening:
    kind = text(field, "kind").lower() or "door"
    outline = member(field, "polygon")
    shape = shapely.convex_hull(_valid(outline, Polygon(_ring(outline))))
    low = number(field, "z_min", z_floor) - z_floor
    high = number(field, "z_max", z_floor + max(low, 0.0) + DOOR_HEIGHT) - z_floor
    if high <= low:
        field.fail(f"expected z_max above z_min, found {high + z_floor:g} and {low + z_floor:g}")
    return Opening(kind if kind in KINDS else "opening", shape, low, high, glass=kind == "window")


# --- rooms and polygons --------------------------------------------------------------------------


def _room(field: Field, place: int) -> list[RoomOutline]:
    """The parts of a room as drawn; most have one."""
    identity = text(field, "id") or text(field, "guid") or str(place)
    name = " ".join(filter(None, (text(field, "name"), text(field, "number")))) or f"room {place}"
    kind = kind_of(name)
    if kind == "room":
        kind = TYPES.get(text(field, "type"), kind)
    shapes = [_polygon(item) for item in member(field, "polygons").items()]
    if not shapes:
        member(field, "polygons").wrong("at least one polygon")
    parts = as_multipolygon(shapely.union_all(shapes)).geoms
    largest = max(part.area for part in parts)
    kept = [part for part in parts if part.area > min(LEAST_PART, 0.99 * largest)]
    return [RoomOutline(identity, name, kind, part) for part in kept]


def _polygon(field: Field) -> BaseGeometry:
    outer = member(field, "outer")
    holes = [_ring(hole) for hole in members(field, "holes")]
    return _valid(outer, Polygon(_ring(outer), holes))


def _valid(field: Field, polygon: Polygon) -> BaseGeometry:
    """The polygon; a self-crossing by a slip of the pen is mended."""
    if polygon.is_valid and polygon.area > 0.0:
        return polygon
    reason = shapely.is_valid_reason(polygon) if polygon.area else "it has no area"
    if len(polygon.exterior.coords) > MAX_MENDED:
        field.fail(f"expected an outline that does not cross itself: {reason}")
    mended = as_multipolygon(shapely.make_valid(polygon))
    whole = Polygon(polygon.exterior).convex_hull.area
    largest = max((part.area for part in mended.geoms), default=0.0)
    if largest < 1e-4 or mended.area - largest > 0.01 * whole:
        field.fail(f"expected an outline that does not cross itself: {reason}")
    return mended


def _ring(field: Field) -> list[tuple[float, float]]:
    points = [item.point() for item in field.items()]
    if len(set(points)) < 3:
        field.wrong("at least three different points")
    return points
