"""Buildings that nobody here drew: floor plans, IFC, meshes and occupancy maps, each as a Plan."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from slam.core import InputError
from worlds.plan import Plan
from worlds.planfile import checked_json, plan_of
from worlds.readers.formats import format_of
from worlds.readers.options import DEFAULT, ReaderOptions
from worlds.readers.placing import near_origin

__all__ = ["DEFAULT", "ReaderOptions", "read_building"]


def read_building(path: Path, options: ReaderOptions = DEFAULT) -> Plan:
    """The plan of a building's file: our plan JSON, floor-plan JSON, IFC, OBJ, STL, PLY, GLB, DAE,
    or the yaml of a ROS occupancy map, by its suffix and content.

    What has no word on rooms (a mesh, a map without labels, an IFC without spaces) gets its free
    areas as rooms of the kind ``UNLABELLED``. Raises InputError, in one line, for whatever cannot
    be read, and for options that its format does not take.
    """
    kind = format_of(path)
    read, taken = _READERS[kind.name]
    for name in ("unit", "up"):
        if getattr(options, name) is not None and name not in taken:
            raise InputError(f"{path}: --{name}: {kind.name} files do not take it")
    return near_origin(read(path, options))


def _json(path: Path, _: ReaderOptions) -> Plan:
    from worlds.readers.floorplan import floorplan, is_floorplan

    root = checked_json(path)
    return floorplan(root, path) if is_floorplan(root) else plan_of(root, path)


def _ifc(path: Path, options: ReaderOptions) -> Plan:
    from worlds.readers.ifc import read_ifc

    return read_ifc(path, options)


def _mesh(path: Path, options: ReaderOptions) -> Plan:
    from worlds.readers.mesh import read_mesh

    return read_mesh(path, options)


def _rosmap(path: Path, _: ReaderOptions) -> Plan:
    from worlds.readers.rosmap import read_rosmap

    return read_rosmap(path)


_READERS: dict[str, tuple[Callable[[Path, ReaderOptions], Plan], tuple[str, ...]]] = {
    "JSON": (_json, ()),
    "IFC": (_ifc, ("unit",)),
    "ROS map": (_rosmap, ()),
    **dict.fromkeys(("COLLADA", "OBJ", "STL", "PLY", "GLB"), (_mesh, ("unit", "up"))),
}
"""How each format is read, and which options it takes."""
