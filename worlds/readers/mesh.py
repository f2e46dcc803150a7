"""A building mesh (OBJ, STL, PLY, GLB, DAE) as a Plan: floors, walls and ceilings by slicing.

A mesh has no word on rooms. Its free areas come as rooms of the kind ``UNLABELLED``, which are not
truth.
"""

from __future__ import annotations

import logging
from itertools import pairwise
from pathlib import Path

from slam.core import InputError
from worlds.plan import Plan, Storey
from worlds.readers.carving import Slice, carve
from worlds.readers.freeareas import free_areas
from worlds.readers.levels import Span, changes, clear_of, storeys_of
from worlds.readers.meshfile import Mesh, read_triangles
from worlds.readers.options import DEFAULT, ReaderOptions
from worlds.readers.slices import MAX_LINES, lines_at, solid_in
from worlds.readers.units import size_text

NOTE = "A mesh: no room truth; the rooms are the free areas between the walls."

log = logging.getLogger(__name__)


def read_mesh(path: Path, options: ReaderOptions = DEFAULT) -> Plan:
    """The plan of a building mesh. Raises InputError, with the file and what was expected."""
    mesh = read_triangles(path, options)
    found = [_storey(path, mesh, span, str(k)) for k, span in enumerate(storeys_of(mesh))]
    storeys = tuple(storey for storey in found if storey is not None)
    if not storeys:
        raise InputError(
            f"{path}: expected walls that enclose free space, found none in "
            f"{size_text(mesh.vertices.max(axis=0) - mesh.vertices.min(axis=0))}: "
            "are unit and up axis right?"
        )
    return Plan(path.stem, storeys, NOTE)


def _storey(path: Path, mesh: Mesh, span: Span, name: str) -> Storey | None:
    """The storey, or None where no walls enclose anything: a roof."""
    heights = changes(mesh, span)
    slices = [_slice(path, mesh, low, high, span.z_floor) for low, high in pairwise(heights)]
    walls, openings = carve(slices)
    rooms = free_areas(walls)
    if not rooms:
        log.warning("%s: from %.2f m up: no free space between walls", path, span.z_floor)
        return None
    return Storey(name, span.z_floor, span.z_ceiling, rooms, walls, openings)


def _slice(path: Path, mesh: Mesh, low: float, high: float, z_floor: float) -> Slice:
    z = clear_of(mesh, low, high)
    lines = lines_at(mesh, z)
    if len(lines.ends) > MAX_LINES:
        raise InputError(
            f"{path}: {len(lines.ends)} lines in the slice at {z:.2f} m, expected at most "
            f"{MAX_LINES}: a scan rather than a model of a building"
        )
    try:
        return Slice(low - z_floor, high - z_floor, solid_in(lines))
    except ValueError as error:
        message = f"slice at {z:.2f} m: expected walls, found {error}"
        raise InputError(f"{path}: {message}") from error
