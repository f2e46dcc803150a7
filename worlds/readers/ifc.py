"""An IFC building (IFC2x3, IFC4) as a Plan: spaces become rooms, walls and columns walls.

Walls are taken by their height, not by the storey they are filed under: an outer wall often stands
for several. Windows have panes of glass. Furniture, railings and stairs are left out. A file
without spaces has no word on rooms: the areas that its walls enclose, doors shut, come as rooms of
the kind ``UNLABELLED``, which are not truth.
"""

from __future__ import annotations

import logging
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import shapely

from slam.core import Array, InputError
from worlds.drafting import as_multipolygon
from worlds.plan import Opening, Plan, RoomOutline, Storey
from worlds.readers.bodies import Body, Walls, build_up
from worlds.readers.freeareas import free_areas
from worlds.readers.ifcfile import SHAPELESS, Building, Element
from worlds.readers.ifcprocess import read_apart
from worlds.readers.options import DEFAULT, ReaderOptions
from worlds.readers.outlines import projected
from worlds.readers.roomset import kind_of, sound_rooms
from worlds.readers.units import scale_to_metres

MIN_HEIGHT = 1.0
"""Least height of a storey [m]."""
SAME_FLOOR = 1.0
"""Elements that say no storey share one if they begin nearer than this to each other [m]."""
SLAB = 0.2
"""Thickness of a floor where no space tells the ceiling's height [m]."""
LEAST = 0.05
"""Spaces smaller than this are left out [m2]."""

log = logging.getLogger(__name__)


@dataclass(frozen=True)
class _Level:
    """A storey to be built. Heights are absolute [m]; spaces: none where the file has none."""

    name: str
    z_floor: float
    z_ceiling: float
    spaces: tuple[Element, ...]

    def holds(self, element: Element) -> bool:
        low, high = element.z_range
        return low < self.z_ceiling and high > self.z_floor


def read_ifc(path: Path, options: ReaderOptions = DEFAULT) -> Plan:
    """The plan of an IFC file. Raises InputError that names file, entity and what was expected."""
    building = read_apart(path, options.unit)
    if not building.walls:
        raise InputError(f"{path}: IfcWall: expected shapes, found none that can be drawn")
    _check_size(path, building, options)
    if not building.spaces:
        log.warning("%s: no IfcSpace: no room truth, the rooms are what walls enclose", path)
    shapeless = dict(building.left_out).get(SHAPELESS, 0)
    if shapeless:
        log.warning("%s: %d %s: left out", path, shapeless, SHAPELESS)
    found = [_storey(path, level, building) for level in _levels(building)]
    kept = [storey for storey in found if storey.rooms and not storey.walls.is_empty]
    if not kept:
        raise InputError(f"{path}: expected a storey with rooms and walls, found none")
    left_out = [storey.name for storey in found if storey not in kept]
    return Plan(path.stem, tuple(kept), _notes(building, left_out))


def _check_size(path: Path, building: Building, options: ReaderOptions) -> None:
    points = np.concatenate([wall.vertices for wall in building.walls])
    extent = np.ptp(points, axis=0) / building.scale
    declared = building.scale if building.unit_declared else None
    scale_to_metres(path, extent, declared, options.unit, "IfcUnitAssignment")


def _notes(building: Building, left_out: Sequence[str]) -> str:
    notes = ["Read from IFC."]
    if not building.spaces:
        notes.append("No IfcSpace: no room truth; the rooms are what the walls enclose.")
    if left_out:
        notes.append(f"Left out, without rooms or walls: storey {', '.join(left_out)}.")
    if building.left_out:
        counts = ", ".join(f"{count} {kind}" for kind, count in building.left_out)
        notes.append(f"Left out: {counts}.")
    return " ".join(notes)


# --- storeys -------------------------------------------------------------------------------------


def _levels(building: Building) -> list[_Level]:
    """The storeys, upwards: from the floors and ceilings of their spaces, else from their walls."""
    elements = building.spaces or building.walls
    levels = [_level(name, own) for name, own in _by_storey(elements, building)]
    levels.sort(key=lambda level: level.z_floor)
    if building.spaces:
        return [level for level in levels if level.z_ceiling - level.z_floor >= MIN_HEIGHT]
    return list(_below_each_other(levels))


def _by_storey(
    elements: Sequence[Element], building: Building
) -> Iterator[tuple[str, list[Element]]]:
    """The elements of each storey; those that say none go by where they begin."""
    for guid, name in building.storeys:
        own = [element for element in elements if element.storey == guid]
        if own:
            yield name or guid, own
    known = {guid for guid, _ in building.storeys}
    lost = sorted((e for e in elements if e.storey not in known), key=lambda e: e.z_range[0])
    while lost:
        low = lost[0].z_range[0]
        own = [element for element in lost if element.z_range[0] < low + SAME_FLOOR]
        yield f"{low:.2f} m", own
        lost = lost[len(own) :]


def _level(name: str, elements: Sequence[Element]) -> _Level:
    """Floor and ceiling where most of the elements' area begins and ends."""
    areas = np.array([max(_shadow_area(element), 1e-6) for element in elements])
    low, high = np.array([element.z_range for element in elements]).T
    spaces = tuple(element for element in elements if element.kind == "space")
    return _Level(name, _weighted_median(low, areas), _weighted_median(high, areas), spaces)


def _below_each_other(levels: Sequence[_Level]) -> Iterator[_Level]:
    """Levels made of walls, none reaching into the next one's floor."""
    floors = [level.z_floor for level in levels]
    for k, level in enumerate(levels):
        above = [z - SLAB for z in floors[k + 1 :] if z > level.z_floor + MIN_HEIGHT + SLAB]
        ceiling = min(level.z_ceiling, *above) if above else level.z_ceiling
        if ceiling - level.z_floor >= MIN_HEIGHT:
            yield _Level(level.name, level.z_floor, ceiling, ())


def _shadow_area(element: Element) -> float:
    return float(np.prod(np.ptp(element.vertices[:, :2], axis=0)))


def _weighted_median(values: Array, weights: Array) -> float:
    order = np.argsort(values, kind="stable")
    share = np.cumsum(weights[order])
    return float(values[order][np.searchsorted(share, 0.5 * share[-1])])


def _storey(path: Path, level: _Level, building: Building) -> Storey:
    z_floor, height = level.z_floor, level.z_ceiling - level.z_floor
    walls = build_up(
        [_body(wall, z_floor) for wall in building.walls if level.holds(wall)],
        [_hole(opening, z_floor) for opening in building.openings if level.holds(opening)],
        height,
    )
    return Storey(
        name=level.name,
        z_floor=z_floor,
        z_ceiling=level.z_ceiling,
        rooms=_rooms(path, level, walls) if level.spaces else free_areas(walls.full),
        walls=walls.solid,
        openings=walls.openings,
    )


def _rooms(path: Path, level: _Level, walls: Walls) -> tuple[RoomOutline, ...]:
    rooms = [
        RoomOutline(space.guid, space.name, kind_of(space.name), part)
        for space in level.spaces
        for part in as_multipolygon(projected(space.vertices, space.triangles)).geoms
        if part.area > LEAST
    ]
    return sound_rooms(rooms, walls.solid, walls.full, f'{path}: storey "{level.name}"')


def _body(wall: Element, z_floor: float) -> Body:
    low, high = wall.z_range
    return Body(projected(wall.vertices, wall.triangles), low - z_floor, high - z_floor)


def _hole(opening: Element, z_floor: float) -> Opening:
    low, high = opening.z_range
    shadow = shapely.convex_hull(projected(opening.vertices, opening.triangles))
    glass = opening.kind in ("window", "pane")
    kind = "window" if glass else opening.kind
    return Opening(kind, shadow, low - z_floor, high - z_floor, glass)
