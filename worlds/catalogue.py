"""The scenes that come with roomloop, and what is in them."""

from __future__ import annotations

import difflib
import hashlib
from collections import Counter
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import shapely
from shapely.geometry import Polygon

from slam.core import InputError
from worlds.largebuilding import is_large_building, large_building
from worlds.outline import clean_union, trace
from worlds.plan import Plan
from worlds.planfile import plan_sources, plan_text
from worlds.readers import DEFAULT, ReaderOptions, building_files, read_building
from worlds.rooms import clear_rooms

SCENES = Path(__file__).parent / "scenes"
ELONGATED = 1.8
"""A rectangular room longer than this many times its width is elongated."""
CONVEX = 0.95
"""A room that fills less than this part of its convex hull is not convex."""
RECTANGULAR = 0.8
"""A convex room that fills less than this part of the rectangle about it is irregular."""
L_CORNERS = 6
"""Corners of an L-shape; a room that is not convex and has more is irregular."""
STRAIGHT = 0.05
"""Corners that are this near to the line between their neighbours do not count [m]."""


@dataclass(frozen=True)
class SceneCounts:
    """What a plan holds. rooms: (shape, count) in the words of the paper's Table I; size: (x, y)
    extent of the largest storey [m]; area: of all rooms [m2].
    """

    name: str
    storeys: int
    rooms: tuple[tuple[str, int], ...]
    doors: int
    size: tuple[float, float]
    area: float

    @property
    def room_total(self) -> int:
        """Rooms and corridors together."""
        return sum(count for _, count in self.rooms)


def scene_names() -> list[str]:
    """Names of the catalogue's scenes, sorted."""
    return sorted(path.stem for path in SCENES.glob("*.json"))


def scene_path(name_or_path: str) -> Path:
    """The plan file of a scene's name, or of a path. Raises InputError if there is no such file."""
    if name_or_path in scene_names():
        return SCENES / f"{name_or_path}.json"
    path = Path(name_or_path)
    if path.is_file():
        return path
    if path.suffix or len(path.parts) > 1:
        problem = "is a folder" if path.is_dir() else "does not exist"
        raise InputError(f"{path}: {problem}, expected a plan file or a scene's name")
    near = _nearest(name_or_path)
    raise InputError(f'scene "{name_or_path}": unknown, {near}')


def _nearest(name: str) -> str:
    names = scene_names()
    folded = {known.lower(): known for known in names}
    near = difflib.get_close_matches(name.lower(), folded, n=3, cutoff=0.4)
    if near:
        return f"did you mean {' or '.join(folded[n] for n in near)}?"
    return f"expected one of {', '.join(names)}, rooms-N-SEED or the path of a plan file"


def load_scene(name_or_path: str, options: ReaderOptions = DEFAULT) -> Plan:
    """The plan of a scene's name, ``rooms-N-SEED`` among them, or of a building's file
    (``worlds.readers``). Raises InputError for what cannot be read."""
    if is_large_building(name_or_path):
        return large_building(name_or_path)
    return read_building(scene_path(name_or_path), options)


def scene_sha256(name_or_path: str) -> str:
    """Hexadecimal SHA-256 of a scene's file or files, which names exactly what was run."""
    if is_large_building(name_or_path):
        return hashlib.sha256(plan_text(large_building(name_or_path)).encode()).hexdigest()
    path = scene_path(name_or_path)
    sources = plan_sources(path) if path.suffix == ".json" else building_files(path)
    return hashlib.sha256(b"".join(source.read_bytes() for source in sources)).hexdigest()


def scene_counts(plan: Plan) -> SceneCounts:
    """What ``roomloop scenes`` tells of a plan."""
    shapes: Counter[str] = Counter()
    area, extents = 0.0, []
    for storey in plan.storeys:
        rooms = clear_rooms(storey.rooms, trace(storey.walls))
        shapes.update(room_shape(room.kind, room.polygon) for room in rooms)
        area += sum(room.polygon.area for room in rooms)
        x_min, y_min, x_max, y_max = clean_union(storey.walls).bounds or np.zeros(4)
        extents.append((float(x_max - x_min), float(y_max - y_min)))
    return SceneCounts(
        name=plan.name,
        storeys=len(plan.storeys),
        rooms=tuple(sorted(shapes.items(), key=lambda item: (-item[1], item[0]))),
        doors=sum(o.kind != "window" for storey in plan.storeys for o in storey.openings),
        size=max(extents, key=lambda extent: extent[0] * extent[1]),
        area=area,
    )


def room_shape(kind: str, polygon: Polygon) -> str:
    """squared, elongated, L-shaped, irregular; any kind but ``room`` is a shape of its own."""
    if kind != "room":
        return kind
    if polygon.area < CONVEX * polygon.convex_hull.area:
        corners = len(polygon.simplify(STRAIGHT).exterior.coords) - 1
        return "L-shaped" if corners <= L_CORNERS and not polygon.interiors else "irregular"
    rectangle = shapely.minimum_rotated_rectangle(polygon)
    if polygon.area < RECTANGULAR * rectangle.area:
        return "irregular"
    corner = np.asarray(rectangle.exterior.coords)
    sides = np.linalg.norm(np.diff(corner[:3], axis=0), axis=1)
    return "elongated" if sides.max() > ELONGATED * sides.min() else "squared"
