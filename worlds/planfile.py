"""Our plan file: a building as JSON that people can read and write.

    {"format": "roomloop-plan-1", "name": ..., "notes": ..., "conditions": "as-built",
     "storeys": [{"name": ..., "z_floor": 0.0, "z_ceiling": 2.7,
       "rooms": [{"id": ..., "name": ..., "kind": "room", "outline": [[x, y], ...]}],
       "walls": [{"from": [x, y], "to": [x, y], "thickness": 0.15} | {"outline": [[x, y], ...]}],
       "doors": [{"at": [x, y], "width": 0.9, "height": 2.0} | {"outline": [[x, y], ...]}]}],
     "ramps": [{"storey": 0, "foot": [[x, y], [x, y]], "head": [[x, y], [x, y]]}],
     "routes": [{"name": "west", "storey": 0, "rooms": ["1", "2"]}]}

Metres. Centre lines that meet end to end get a proper corner. A door lies on a wall and cuts
through its whole body; ``kind`` is door, window or opening, ``sill`` and ``head`` are heights above
the floor, ``glass`` (true or false) closes it with a pane.
Rooms, walls and doors given by an outline may have ``holes``. ``conditions`` names the preset under
which the building is built where a run asks for none. A ramp leads from ``storey`` up to the next
one. ``"building": "SC1F1"`` in the place of ``storeys`` takes the building of that plan file in the
same folder: two scenes can share one.
"""

from __future__ import annotations

from pathlib import Path

from worlds.fields import Field, read_json
from worlds.plan import MAX_STOREYS, NamedRoute, Plan, Ramp, Storey
from worlds.planlinks import links_text, read_ramps, read_routes
from worlds.planstorey import quoted, read_storey, storey_text

FORMAT = "roomloop-plan-1"
MAX_VERTICES = 200_000
"""Most corners that a plan can have: a building of 1,000 rooms has about 20,000."""
LONGEST_NAME = 200
"""Letters of the name of a plan's file."""


def read_plan(path: Path) -> Plan:
    """The plan in a file. Raises InputError that names file, field and what was expected."""
    return plan_of(checked_json(path), path)


def checked_json(path: Path) -> Field:
    """The root of a JSON file that is no larger than a building's. Raises InputError."""
    root = read_json(path)
    _check_size(root)
    return root


def plan_of(root: Field, path: Path) -> Plan:
    """The plan in a parsed file of our own format."""
    content = "building" if root.has("building") else "storeys"
    top = root.members(("format", content), ("name", "notes", "conditions", "ramps", "routes"))
    top["format"].choice((FORMAT,))
    storeys, ramps, routes = _shared(top, path) if content == "building" else _own(top)
    if "routes" in top:
        routes = read_routes(top["routes"], storeys)
    return Plan(
        name=top["name"].text() if "name" in top else path.stem,
        storeys=storeys,
        notes=top["notes"].text() if "notes" in top else "",
        conditions=top["conditions"].text() if "conditions" in top else "as-built",
        routes=routes,
        ramps=ramps,
    )


def plan_sources(path: Path) -> tuple[Path, ...]:
    """The files that make up the plan in a file: itself, and that of the building it names."""
    root = read_json(path)
    if not root.has("building"):
        return (path,)
    return path, _building_path(root.member("building"), path)


_Building = tuple[tuple[Storey, ...], tuple[Ramp, ...], tuple[NamedRoute, ...]]


def _own(top: dict[str, Field]) -> _Building:
    items = top["storeys"].items(MAX_STOREYS)
    if not items:
        top["storeys"].wrong("at least one storey")
    storeys = tuple(read_storey(field, i) for i, field in enumerate(items))
    ramps = read_ramps(top["ramps"], storeys) if "ramps" in top else ()
    return storeys, ramps, ()


def _shared(top: dict[str, Field], path: Path) -> _Building:
    """The building of another plan file in the same folder, which must have one of its own."""
    if "ramps" in top:
        top["ramps"].fail("expected the ramps in the plan file of the building")
    other = _building_path(top["building"], path)
    root = checked_json(other)
    if root.has("building"):
        top["building"].wrong("a plan file with storeys of its own")
    plan = plan_of(root, other)
    return plan.storeys, plan.ramps, plan.routes


def _building_path(field: Field, path: Path) -> Path:
    name = field.text()
    other = path.parent / f"{name}.json"
    if Path(name).name != name or len(name) > LONGEST_NAME or not other.is_file():
        field.wrong("the name of a plan file in the same folder, without .json")
    return other


def _check_size(root: Field) -> None:
    """Refuses a plan with more corners than any building has, before geometry is made of it."""
    corners, pending = 0, [root.value]
    while pending:
        value = pending.pop()
        if isinstance(value, dict):
            pending.extend(value.values())
        elif isinstance(value, list):
            corners += bool(value) and not isinstance(value[0], (list, dict))
            pending.extend(value)
    if corners > MAX_VERTICES:
        root.fail(f"{corners} corners, expected a plan of at most {MAX_VERTICES}")


# --- writing -------------------------------------------------------------------------------------


def plan_text(plan: Plan) -> str:
    """The text of the plan's file; ``read_plan`` gives back the same geometry. Walls become
    outlines."""
    storeys = ",\n".join(storey_text(storey) for storey in plan.storeys)
    head = ",\n".join(
        f'"{key}": {quoted(value)}'
        for key, value in (
            ("format", FORMAT),
            ("name", plan.name),
            ("notes", plan.notes),
            ("conditions", plan.conditions),
        )
    )
    return f'{{{head},\n"storeys": [\n{storeys}\n]{links_text(plan)}}}\n'
