"""An IFC file's walls, spaces and openings as meshes in metres. Needs the extra ``ifc``."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from slam.core import Array, InputError, IntArray
from worlds.readers.units import unit_scale

if TYPE_CHECKING:
    import ifcopenshell

WALLS = ("IfcWall", "IfcColumn", "IfcCurtainWall")
TAIL = 4096
"""The end of a file, in which the closing line stands [bytes]."""
MAX_NESTING = 20
"""Spaces within spaces that are followed up to their storey."""
MAX_ELEMENTS = 200_000
"""Most walls, spaces and openings."""
SHAPELESS = "walls, spaces or openings without a shape that can be drawn"
MAX_TRIANGLES = 2_000_000
"""Most triangles of them all."""


@dataclass(frozen=True)
class Element:
    """A wall, column, space or opening. vertices: (V, 3) [m], world; triangles: (T, 3)."""

    guid: str
    name: str
    kind: str
    storey: str
    vertices: Array
    triangles: IntArray

    @property
    def z_range(self) -> tuple[float, float]:
        """Lowest and highest point [m]."""
        return float(self.vertices[:, 2].min()), float(self.vertices[:, 2].max())


@dataclass(frozen=True)
class Building:
    """What a world needs of an IFC file. storeys: (guid, name) of those in the file; left_out:
    (entity, count); scale: metres per unit of the file."""

    walls: tuple[Element, ...]
    spaces: tuple[Element, ...]
    openings: tuple[Element, ...]
    storeys: tuple[tuple[str, str], ...]
    left_out: tuple[tuple[str, int], ...]
    scale: float
    unit_declared: bool


@dataclass
class _Wanted:
    """Elements to be triangulated, by the number of their entity."""

    kinds: dict[int, str] = field(default_factory=dict)
    storeys: dict[int, str] = field(default_factory=dict)

    def add(self, entity: ifcopenshell.entity_instance, kind: str, storey: str = "") -> None:
        self.kinds[entity.id()] = kind
        self.storeys[entity.id()] = storey


def read_ifc_file(path: Path, unit: str | None) -> Building:
    """The building in an IFC file. unit: of length, in the place of the file's own. Raises
    InputError where the file is broken or cut off, and where it has no walls."""
    model = _open(path)
    try:
        return _building(path, model, unit)
    except InputError:
        raise
    except Exception as error:
        raise InputError(f"{path}: expected sound IFC: {_reason(error)}") from error


def _building(path: Path, model: ifcopenshell.file, unit: str | None) -> Building:
    wanted = _wanted(model)
    if "wall" not in wanted.kinds.values():
        raise InputError(f"{path}: IfcWall: expected at least one wall, found none")
    if len(wanted.kinds) > MAX_ELEMENTS:
        raise InputError(f"{path}: expected at most {MAX_ELEMENTS} walls, spaces and openings")
    declared = _declared_unit(path, model)
    scale = unit_scale(unit) if unit is not None else (declared or 1.0)
    # ifcopenshell has applied the declared unit.
    found = _triangulated(path, model, wanted, scale / (declared or 1.0))
    return Building(
        walls=tuple(e for e in found if e.kind in ("wall", "pane")),
        spaces=tuple(e for e in found if e.kind == "space"),
        openings=tuple(e for e in found if e.kind in ("door", "window", "opening", "pane")),
        storeys=tuple((s.GlobalId, s.Name or "") for s in model.by_type("IfcBuildingStorey")),
        left_out=_left_out(model, len(wanted.kinds) - len(found)),
        scale=scale,
        unit_declared=declared is not None,
    )


def _open(path: Path) -> ifcopenshell.file:
    import ifcopenshell

    with path.open("rb") as file:
        file.seek(max(0, path.stat().st_size - TAIL))
        if b"END-ISO-10303-21" not in file.read():
            raise InputError(f"{path}: expected IFC to its last line, found a file that is cut off")
    try:
        return ifcopenshell.open(str(path))
    except Exception as error:
        # Whatever a foreign parser stumbles over in a broken file is the file's fault.
        raise InputError(f"{path}: expected IFC2x3 or IFC4: {_reason(error)}") from error


def _reason(error: Exception) -> str:
    if isinstance(error, AttributeError | TypeError):
        return "an entity refers to nothing, or to one of another kind"
    return (str(error).splitlines() or [type(error).__name__])[0][:120]


# --- which elements ------------------------------------------------------------------------------


def _wanted(model: ifcopenshell.file) -> _Wanted:
    wanted = _Wanted()
    walls = _walls(model)
    for wall, storey in walls:
        wanted.add(wall, "pane" if wall.is_a("IfcPlate") else "wall", storey)
    for space in model.by_type("IfcSpace"):
        wanted.add(space, "space", _above(space))
    for opening in _openings(model, {wall.id() for wall, _ in walls}):
        wanted.add(opening, _filling(opening))
    return wanted


def _walls(model: ifcopenshell.file) -> list[tuple[ifcopenshell.entity_instance, str]]:
    """Walls and columns with their storeys; of what is made of parts, a curtain wall say, its
    parts."""
    found = {}
    for kind in WALLS:
        for entity in model.by_type(kind):
            for part in _parts(entity):
                found[part.id()] = (part, _storey_of(entity))
    return list(found.values())


def _storey_of(wall: ifcopenshell.entity_instance) -> str:
    """GlobalId of the storey that holds a wall, empty where the file does not say."""
    holders = [rel.RelatingStructure for rel in wall.ContainedInStructure]
    return next((str(h.GlobalId) for h in holders if h.is_a("IfcBuildingStorey")), "")


def _parts(entity: ifcopenshell.entity_instance) -> list[ifcopenshell.entity_instance]:
    if entity.Representation is not None:
        return [entity]
    related = [part for rel in entity.IsDecomposedBy for part in rel.RelatedObjects]
    return [p for p in related if getattr(p, "Representation", None) is not None]


def _openings(model: ifcopenshell.file, walls: set[int]) -> list[ifcopenshell.entity_instance]:
    """The openings in walls, not those in roofs and cupboards."""
    found = model.by_type("IfcOpeningElement")
    return [
        opening
        for opening in found
        if any(rel.RelatingBuildingElement.id() in walls for rel in opening.VoidsElements)
    ]


def _filling(opening: ifcopenshell.entity_instance) -> str:
    """door or window by what fills the opening, opening where nothing does."""
    kinds = [rel.RelatedBuildingElement.is_a() for rel in opening.HasFillings]
    if any(kind.startswith("IfcDoor") for kind in kinds):
        return "door"
    return "window" if any(kind.startswith("IfcWindow") for kind in kinds) else "opening"


def _above(space: ifcopenshell.entity_instance) -> str:
    """GlobalId of the storey that a space belongs to, empty where the file does not say."""
    for _ in range(MAX_NESTING):
        parents = [rel.RelatingObject for rel in space.Decomposes]
        if not parents or parents[0].is_a("IfcBuildingStorey"):
            return str(parents[0].GlobalId) if parents else ""
        space = parents[0]
    return ""


def _left_out(model: ifcopenshell.file, shapeless: int) -> tuple[tuple[str, int], ...]:
    kinds = ("IfcFurnishingElement", "IfcStair", "IfcRamp", "IfcRailing")
    counts = [(kind, len(model.by_type(kind))) for kind in kinds]
    counts.append((SHAPELESS, shapeless))
    return tuple((kind, count) for kind, count in counts if count)


# --- geometry ------------------------------------------------------------------------------------


def _declared_unit(path: Path, model: ifcopenshell.file) -> float | None:
    """Metres per unit of length of the file."""
    import ifcopenshell.util.unit

    units = [u for a in model.by_type("IfcUnitAssignment") for u in a.Units]
    if not any(getattr(unit, "UnitType", None) == "LENGTHUNIT" for unit in units):
        return None
    scale = float(ifcopenshell.util.unit.calculate_unit_scale(model))
    if not 0.0 < scale < np.inf:
        raise InputError(f"{path}: IfcUnitAssignment: expected a unit of length, found {scale:g} m")
    return scale


def _triangulated(
    path: Path, model: ifcopenshell.file, wanted: _Wanted, factor: float
) -> list[Element]:
    import ifcopenshell.geom

    settings = ifcopenshell.geom.settings()
    settings.set("use-world-coords", True)
    settings.set("disable-opening-subtractions", True)
    entities = [model.by_id(i) for i in wanted.kinds]
    found: list[Element] = []
    count = 0
    iterator = ifcopenshell.geom.iterator(settings, model, 1, include=entities)
    proceed = bool(iterator.initialize())
    while proceed:
        element = _element(model, iterator.get(), wanted, factor)
        if element is not None:
            found.append(element)
            count += len(element.triangles)
        if count > MAX_TRIANGLES:
            raise InputError(f"{path}: expected at most {MAX_TRIANGLES} triangles")
        proceed = bool(iterator.next())
    if any(not np.isfinite(element.vertices).all() for element in found):
        raise InputError(f"{path}: expected finite coordinates, found NaN or infinity")
    return sorted(found, key=lambda e: e.guid)


def _element(
    model: ifcopenshell.file, shape: object, wanted: _Wanted, factor: float
) -> Element | None:
    number, mesh = shape.id, shape.geometry  # type: ignore[attr-defined]
    vertices = np.array(mesh.verts, dtype=np.float64).reshape(-1, 3) * factor
    triangles = np.array(mesh.faces, dtype=np.int64).reshape(-1, 3)
    if not len(triangles):
        return None
    entity = model.by_id(number)
    words = (getattr(entity, "LongName", None), entity.Name)
    name = " ".join(dict.fromkeys(word for word in words if word)) or entity.GlobalId
    kind, storey = wanted.kinds[number], wanted.storeys[number]
    return Element(entity.GlobalId, name, kind, storey, vertices, triangles)
