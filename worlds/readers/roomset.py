"""The rooms of a storey as somebody else drew them, checked and made fit for a Plan."""

from __future__ import annotations

import logging
from collections import Counter
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import shapely
from shapely import STRtree
from shapely.geometry import MultiPolygon, Polygon

from slam.core import InputError
from worlds.drafting import as_multipolygon
from worlds.plan import MAX_NEIGHBOURS, RoomOutline

LEAST = 0.1
"""Rooms with less free space are left out [m2]."""
SHARED, SHARED_PART = 0.5, 0.05
"""Two rooms that share at most this area [m2], or this part of the smaller one, are parted."""
CUT_OFF, CUT_OFF_PART = 1.0, 0.2
"""A room from which walls cut off more than this area [m2] and this part lies across a wall."""
KINDS = {
    "corridor": ("corridor", "hallway", "passage", "korridor", "flur", "couloir", "corridoio"),
    "stairs": ("stair", "treppe", "scala", "escalier"),
    "elevator": ("elevator", "lift", "aufzug", "ascensore"),
}

log = logging.getLogger(__name__)


def kind_of(name: str) -> str:
    """corridor, stairs or elevator by a room's name; anything else is a room."""
    text = name.lower()
    return next((kind for kind, words in KINDS.items() if any(w in text for w in words)), "room")


def sound_rooms(
    rooms: Sequence[RoomOutline], walls: MultiPolygon, full: MultiPolygon, source: str
) -> tuple[RoomOutline, ...]:
    """The rooms that have free space, without overlaps, each with an id and a name of its own.

    walls: what is not free; full: the walls that part rooms; source: file and storey, for messages.
    Raises InputError for rooms that overlap, or lie across a wall, by more than a slip of the pen.
    """
    free = shapely.difference([room.outline for room in rooms], walls)
    kept = [i for i in range(len(rooms)) if shapely.area(free[i]) > LEAST]
    for i in sorted(set(range(len(rooms))).difference(kept)):
        log.warning('%s: room "%s" has no free space: left out', source, rooms[i].name)
    _check_across(rooms, full, kept, source)
    outlines = _parted([rooms[i] for i in kept], free[kept], source)
    named = _with_own_names([rooms[i] for i in kept])
    return tuple(replace(r, outline=p) for r, p in zip(named, outlines, strict=True))


def _check_across(
    rooms: Sequence[RoomOutline], full: MultiPolygon, kept: Sequence[int], source: str
) -> None:
    for i in kept:
        areas = [part.area for part in shapely.get_parts(rooms[i].outline.difference(full))]
        second = sorted(areas)[-2] if len(areas) > 1 else 0.0
        if second > CUT_OFF and second > CUT_OFF_PART * sum(areas):
            raise InputError(
                f'{source}: room "{rooms[i].name}": a wall runs through it and cuts off '
                f"{second:.1f} of {sum(areas):.1f} m2, expected walls between rooms"
            )


def _parted(rooms: Sequence[RoomOutline], free: np.ndarray, source: str) -> list[Polygon]:
    """Outlines that do not overlap: the smaller one of two rooms keeps what both claim."""
    outlines = [room.outline for room in rooms]
    tree = STRtree(outlines)
    neighbours = (sorted(tree.query(room.outline, "intersects").tolist()) for room in rooms)
    pairs = ((i, j) for i, near in enumerate(neighbours) for j in near if i < j)
    for count, (i, j) in enumerate(pairs):
        if count > MAX_NEIGHBOURS:
            raise InputError(f"{source}: expected rooms side by side, found them without end")
        shared = free[i].intersection(free[j]).area
        least = min(free[i].area, free[j].area)
        if shared > max(SHARED, SHARED_PART * least):
            raise InputError(
                f'{source}: rooms "{rooms[i].name}" and "{rooms[j].name}" overlap by '
                f"{shared:.1f} m2, expected rooms side by side"
            )
        small, large = (i, j) if free[i].area <= free[j].area else (j, i)
        if outlines[i].intersection(outlines[j]).area > 0.0:
            outlines[large] = _without(outlines[large], outlines[small])
    return outlines


def _without(large: Polygon, small: Polygon) -> Polygon:
    rest = as_multipolygon(large.difference(small))
    return max(rest.geoms, key=lambda part: part.area, default=large)


def _with_own_names(rooms: Sequence[RoomOutline]) -> list[RoomOutline]:
    """Names that occur twice are numbered; so are ids."""
    names = _numbered([room.name for room in rooms], " ")
    ids = _numbered([room.id for room in rooms], "-")
    return [replace(r, id=i, name=n) for r, i, n in zip(rooms, ids, names, strict=True)]


def _numbered(names: Sequence[str], between: str) -> list[str]:
    counts, seen = Counter(names), Counter[str]()
    taken = {name for name, count in counts.items() if count == 1}
    found = []
    for name in names:
        own = name
        while counts[name] > 1 and (own == name or own in taken):
            seen[name] += 1
            own = f"{name}{between}{seen[name]}"
        taken.add(own)
        found.append(own)
    return found
