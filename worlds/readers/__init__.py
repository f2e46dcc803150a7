"""Buildings that nobody here drew: floor plans, IFC, meshes and occupancy maps, each as a Plan."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import shapely
from shapely.errors import GEOSException

from slam.core import InputError
from worlds.plan import Plan
from worlds.planfile import checked_json, plan_of
from worlds.readers.formats import format_of
from worlds.readers.options import DEFAULT, ReaderOptions
from worlds.readers.placing import near_origin
from worlds.readers.units import HIGHEST, LARGEST

__all__ = ["DEFAULT", "ReaderOptions", "building_files", "read_building"]


def read_building(path: Path, options: ReaderOptions = DEFAULT) -> Plan:
    """The plan of a building's file: our plan JSON, floor-plan JSON, IFC, OBJ, STL, PLY, GLB, DAE,
    or the yaml of a ROS occupancy map, by its suffix and content.

    What has no word on rooms (a mesh, a map without labels, an IFC without spaces) gets its free
    areas as rooms of the kind ``UNLABELLED``. What others drew far from the origin is moved there.
    Raises InputError, in one line, for whatever cannot be read, and for options that its format
    does not take.
    """
    kind = format_of(path)
    read, taken = _READERS[kind.name]
    for name in ("unit", "up"):
        if getattr(options, name) is not None and name not in taken:
            raise InputError(f"{path}: --{name}: {kind.name} files do not take it")
    try:
        plan = read(path, options)
    except GEOSException as error:
        # Outlines that no geometry can be made of, past all that the readers check.
        reason = (str(error).splitlines() or ["broken"])[0]
        raise InputError(f"{path}: expected sound outlines: {reason}") from error
    _check_size(plan, path)
    return plan


def _check_size(plan: Plan, path: Path) -> None:
    """Refuses what is larger than any building, before grids and meshes are made of it."""
    for i, storey in enumerate(plan.storeys):
        outlines = [storey.walls, *(room.outline for room in storey.rooms)]
        low_x, low_y, high_x, high_y = shapely.total_bounds(outlines)
        sides, height = (high_x - low_x, high_y - low_y), storey.z_ceiling - storey.z_floor
        if max(sides) > LARGEST or height > HIGHEST:
            raise InputError(
                f"{path}: storeys[{i}]: {sides[0]:.0f} x {sides[1]:.0f} m, {height:.0f} m high, "
                f"expected a building of at most {LARGEST:.0f} m, storeys of {HIGHEST:.0f} m"
            )


def building_files(path: Path) -> tuple[Path, ...]:
    """The file of a building, and those that it names: the images of an occupancy map."""
    if format_of(path).name != "ROS map":
        return (path,)
    from worlds.readers.mapfile import read_map_file

    return read_map_file(path).files


def _json(path: Path, _: ReaderOptions) -> Plan:
    from worlds.readers.floorplan import floorplan, is_floorplan

    root = checked_json(path)
    return near_origin(floorplan(root, path)) if is_floorplan(root) else plan_of(root, path)


def _ifc(path: Path, options: ReaderOptions) -> Plan:
    from worlds.readers.ifc import read_ifc

    return near_origin(read_ifc(path, options))


def _mesh(path: Path, options: ReaderOptions) -> Plan:
    from worlds.readers.mesh import read_mesh

    return near_origin(read_mesh(path, options))


def _rosmap(path: Path, _: ReaderOptions) -> Plan:
    from worlds.readers.rosmap import read_rosmap

    return near_origin(read_rosmap(path))


_READERS: dict[str, tuple[Callable[[Path, ReaderOptions], Plan], tuple[str, ...]]] = {
    "JSON": (_json, ()),
    "IFC": (_ifc, ("unit",)),
    "ROS map": (_rosmap, ()),
    **dict.fromkeys(("COLLADA", "OBJ", "STL", "PLY", "GLB"), (_mesh, ("unit", "up"))),
}
"""How each format is read, and which options it takes."""
