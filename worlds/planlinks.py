"""What a plan file says of the building as a whole: ramps between storeys, and named routes."""

from __future__ import annotations

import json
from collections.abc import Sequence

import numpy as np
from shapely.geometry import Polygon

from slam.core import Array
from worlds.fields import Field
from worlds.plan import NamedRoute, Plan, Ramp, Storey

STEEPEST = 0.25
"""Rise over run of the steepest ramp; ramps for people rise by 0.06, those in car parks by 0.15."""


def read_ramps(field: Field, storeys: Sequence[Storey]) -> tuple[Ramp, ...]:
    """The ramps of a building with these storeys."""
    return tuple(_ramp(item, storeys) for item in field.items())


def _ramp(field: Field, storeys: Sequence[Storey]) -> Ramp:
    parts = field.members(("storey", "foot", "head"), ())
    storey = _place(parts["storey"], len(storeys) - 1, "a storey that has another above it")
    ramp = Ramp(storey, _edge(parts["foot"]), _edge(parts["head"]))
    if not _rectangular(ramp.outline):
        field.fail("expected foot and head as ends of a rectangle, the left end of each first")
    rise = storeys[storey + 1].z_floor - storeys[storey].z_floor
    if not 0.0 < rise <= STEEPEST * ramp.run:
        field.fail(
            f"expected a slope of at most {STEEPEST:g}, found {rise:g} m over {ramp.run:.2f} m"
        )
    return ramp


def _place(field: Field, count: int, expected: str) -> int:
    """A whole number from 0 to count - 1."""
    value = field.number()
    if value != int(value) or not 0 <= value < count:
        field.wrong(expected)
    return int(value)


def _edge(field: Field) -> Array:
    points = [item.point() for item in field.items()]
    if len(points) != 2:
        field.wrong("two points")
    return np.array(points)


def _rectangular(outline: Polygon) -> bool:
    """Whether it is, and goes round anticlockwise, as from left to right at its foot."""
    sound = outline.is_valid and outline.area > 1e-3 and outline.exterior.is_ccw
    return sound and outline.area > 0.999 * outline.minimum_rotated_rectangle.area


def read_routes(field: Field, storeys: Sequence[Storey]) -> tuple[NamedRoute, ...]:
    """The named routes through a building with these storeys."""
    routes: list[NamedRoute] = []
    for item in field.items():
        route = _route(item, storeys)
        if route.name.lower() in {other.name.lower() for other in routes}:
            item.fail(f'the name "{route.name}" stands twice')
        routes.append(route)
    return tuple(routes)


def _route(field: Field, storeys: Sequence[Storey]) -> NamedRoute:
    parts = field.members(("name", "rooms"), ("storey",))
    storey = 0
    if "storey" in parts:
        storey = _place(parts["storey"], len(storeys), f"a storey from 0 to {len(storeys) - 1}")
    known = {room.id for room in storeys[storey].rooms}
    rooms = parts["rooms"].items()
    if not rooms:
        parts["rooms"].wrong("at least one room's id")
    for room in rooms:
        if room.text() not in known:
            room.wrong(f"the id of a room on storey {storey}")
    return NamedRoute(parts["name"].text(), tuple(room.text() for room in rooms), storey)


# --- writing -------------------------------------------------------------------------------------


def links_text(plan: Plan) -> str:
    """The fields ``ramps`` and ``routes`` of a plan's file, where it has any."""
    ramps = [
        {"storey": ramp.storey, "foot": ramp.foot.tolist(), "head": ramp.head.tolist()}
        for ramp in plan.ramps
    ]
    routes = [
        {"name": route.name, "storey": route.storey, "rooms": list(route.rooms)}
        for route in plan.routes
    ]
    found = [("ramps", ramps), ("routes", routes)]
    return "".join(f',\n"{key}": {_lines(items)}' for key, items in found if items)


def _lines(items: Sequence[object]) -> str:
    return "[\n  " + ",\n  ".join(json.dumps(item, ensure_ascii=False) for item in items) + "]"
