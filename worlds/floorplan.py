"""The floor-plan JSON of traced plans and converted building models, as a Plan.

    {"storeys": [{"name", "z_floor", "z_ceiling": number | null,
      "rooms": [{"id" | "guid", "name", "type"?, "polygons": [{"outer", "holes"}]}],
      "walls": [{"solid": [{"outer", "holes"}], "z_min"?, "z_max"?}],
      "openings": [{"kind", "z_min", "z_max", "polygon": [[x, y], ...]}]}]}

Metres. Other fields are passed over: such files carry more than a world needs. Lines traced by hand
waver by millimetres; they are straightened by at most a centimetre.
"""

from __future__ import annotations

from pathlib import Path

import shapely
from shapely.geometry import MultiPolygon, Polygon

from worlds.drafting import as_multipolygon
from worlds.fields import Field
from worlds.plan import CEILING_WHERE_UNKNOWN, Opening, Plan, RoomOutline, Storey

STRAIGHTEN = 0.01
"""Corners that stand out less than this from the line beside them go [m]."""
SPECK = 1e-3
"""Pieces of wall or room smaller than this are slips of the pen [m2]."""
KINDS = {"C": "corridor", "R": "room", "E": "stairs"}
"""Types of rooms in the traced plans; a name that says corridor is believed as well."""
OVERHANG = 0.02
"""How far an opening is made to reach beyond the wall, so that the cut is clean [m]."""


def is_floorplan(root: Field) -> bool:
    """Does the file look like a floor plan of this kind?"""
    value = root.value
    return isinstance(value, dict) and "format" not in value and "storeys" in value


def floorplan(root: Field, path: Path) -> Plan:
    """The plan. Storeys without rooms and walls (roofs, foundations) are left out. Raises
    InputError that names file, field and what was expected."""
    storeys = []
    for field in _get(root, "storeys").items():
        if _list(field, "rooms") and _list(field, "walls"):
            storeys.append(_storey(field))
    if not storeys:
        _get(root, "storeys").fail("expected at least one storey with rooms and walls")
    return Plan(path.stem, tuple(storeys), "read from a floor-plan JSON")


def _storey(field: Field) -> Storey:
    z_floor = _get(field, "z_floor").number()
    z_ceiling = _number(field, "z_ceiling", z_floor + CEILING_WHERE_UNKNOWN)
    if z_ceiling - z_floor < 1.0:
        _get(field, "z_ceiling").wrong("a ceiling at least 1 m above the floor")
    walls = [body for wall in _list(field, "walls") for body in _solid(wall)]
    solid = _tidy(as_multipolygon(shapely.union_all(walls)))
    rooms = tuple(_room(room, place) for place, room in enumerate(_list(field, "rooms")))
    found = [_opening(item, z_floor, z_ceiling - z_floor) for item in _list(field, "openings")]
    openings = tuple(opening for opening in found if opening is not None)
    name = str(field.value.get("name", "")) if isinstance(field.value, dict) else ""
    return Storey(name, z_floor, z_ceiling, rooms, solid, openings)


def _room(field: Field, place: int) -> RoomOutline:
    value = field.value
    assert isinstance(value, dict)
    name = str(value.get("name") or f"room {place}")
    kind = KINDS.get(str(value.get("type")), "room")
    if "corridor" in name.lower() or "hallway" in name.lower():
        kind = "corridor"
    parts = [_polygon(item) for item in _get(field, "polygons").items()]
    if not parts:
        _get(field, "polygons").wrong("at least one polygon")
    outline = max(as_multipolygon(shapely.union_all(parts)).geoms, key=lambda p: p.area)
    room_id = str(value.get("id") or value.get("guid") or place)
    return RoomOutline(room_id, f"{name} {place}", kind, outline)


def _solid(field: Field) -> list[Polygon]:
    return [_polygon(item) for item in _get(field, "solid").items()]


def _opening(field: Field, z_floor: float, height: float) -> Opening | None:
    """None for one that lies above or below the storey: those of a neighbour are listed too."""
    kind = str(field.value.get("kind", "door")) if isinstance(field.value, dict) else "door"
    corners = [item.point() for item in _get(field, "polygon").items()]
    if len(corners) < 3:
        _get(field, "polygon").wrong("at least three points")
    footprint = Polygon(corners).minimum_rotated_rectangle
    grown = shapely.buffer(footprint, OVERHANG, join_style="mitre")
    low = max(0.0, _number(field, "z_min", z_floor) - z_floor)
    high = min(height, _number(field, "z_max", z_floor + 2.0) - z_floor)
    if high <= low:
        return None
    known = kind if kind in ("door", "window", "opening") else "opening"
    return Opening(known, grown, 0.0 if known == "door" else low, high)


def _polygon(field: Field) -> Polygon:
    outer = _ring(_get(field, "outer"))
    holes = [_ring(hole) for hole in _list(field, "holes")]
    whole = as_multipolygon(shapely.make_valid(Polygon(outer, holes)))
    if whole.area < SPECK:
        field.fail("expected a polygon with an area")
    return max(whole.geoms, key=lambda part: part.area)


def _ring(field: Field) -> list[tuple[float, float]]:
    points = [item.point() for item in field.items()]
    if len(set(points)) < 3:
        field.wrong("at least three different points")
    return points


def _tidy(solid: MultiPolygon) -> MultiPolygon:
    """Straightened, without specks, in one piece where it was."""
    straight = as_multipolygon(shapely.make_valid(solid.simplify(STRAIGHTEN)))
    kept = [
        Polygon(part.exterior, [hole for hole in part.interiors if Polygon(hole).area > SPECK])
        for part in straight.geoms
        if part.area > SPECK
    ]
    return MultiPolygon(kept)


def _get(field: Field, key: str) -> Field:
    """A member that must be there; others may stand beside it."""
    if not isinstance(field.value, dict):
        field.wrong("an object")
    if key not in field.value:
        field.fail(f'the field "{key}" is missing')
    return Field(field.file, f"{field.path}.{key}" if field.path else key, field.value[key])


def _list(field: Field, key: str) -> list[Field]:
    """The elements of a member that may be left out."""
    if not isinstance(field.value, dict):
        field.wrong("an object")
    return _get(field, key).items() if key in field.value else []


def _number(field: Field, key: str, otherwise: float) -> float:
    """A member that may be left out or null."""
    if not isinstance(field.value, dict) or field.value.get(key) is None:
        return otherwise
    return _get(field, key).number()
