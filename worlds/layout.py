"""A storey as drawn, understood: its outline, its rooms, what bounds them and what joins them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from shapely.geometry import MultiPolygon, Polygon

from slam.core import IntArray
from worlds.doorways import Doorway, doorways, interruptions, interrupts, passable, without
from worlds.outline import TOUCH, Outline, joined, trace
from worlds.plan import Opening, Storey
from worlds.rooms import (
    WIDE,
    ClearRoom,
    OpenBoundary,
    boundaries,
    clear_rooms,
    open_boundaries,
    separates,
    united,
)
from worlds.sidemap import NOTHING, SideMap

PILLAR = 1.2
"""A free-standing wall part whose sides are all shorter than this is a pillar [m]."""


@dataclass(frozen=True)
class Layout:
    """rooms: those that are scored, merged where nothing separates them; bounds: the room at each
    stretch of wall; gaps: where openings that reach the floor interrupt the sides; parapets: where
    those that reach the ceiling, but not the floor, leave a low wall (both by their places in the
    storey's openings); doors: between two rooms or to the outside; pillars: parts of the outline's
    solid; cut: walls without any opening; open_cut: walls without the passable ones.
    """

    storey: Storey
    outline: Outline
    rooms: tuple[ClearRoom, ...]
    bounds: SideMap
    gaps: SideMap
    parapets: SideMap
    doors: tuple[Doorway, ...]
    pillars: frozenset[int]
    cut: MultiPolygon
    open_cut: MultiPolygon

    @property
    def height(self) -> float:
        """From floor to ceiling [m]."""
        return self.storey.z_ceiling - self.storey.z_floor


def lay_out(storey: Storey) -> Layout:
    """The layout of a storey."""
    outline = trace(storey.walls)
    rooms = clear_rooms(storey.rooms, outline)
    bounds = boundaries(rooms, outline)
    gaps = interruptions(outline, storey.openings)
    doors = doorways(outline, storey.openings, gaps, bounds)
    meetings = open_boundaries(rooms)
    group, doors = _merge(rooms, doors, meetings, storey)
    between = [(d.rooms[0], d.space) for d in doors if d.width > WIDE and NOTHING not in d.rooms]
    merged_bounds = bounds.relabelled(group[bounds.value])
    return Layout(
        storey=storey,
        outline=outline,
        rooms=tuple(united(rooms, group, between)),
        bounds=merged_bounds,
        gaps=_only(gaps, [interrupts(o) for o in storey.openings]),
        parapets=_only(gaps, [_above_parapet(o, storey) for o in storey.openings]),
        doors=tuple(_regrouped(doors, group)),
        pillars=_pillars(outline, merged_bounds),
        cut=without(outline.solid, storey.openings),
        open_cut=without(outline.solid, [o for o in storey.openings if passable(o)]),
    )


def _merge(
    rooms: list[ClearRoom], doors: list[Doorway], meetings: list[OpenBoundary], storey: Storey
) -> tuple[IntArray, list[Doorway]]:
    """(R,) the scored room of each room, and the doors with those that are mere gaps in a wall."""
    wide = [d.rooms for d in doors if d.width > WIDE and NOTHING not in d.rooms]
    apart = [separates(meeting, rooms) for meeting in meetings]
    open_ = [m.rooms for m, narrow in zip(meetings, apart, strict=True) if not narrow]
    pairs = np.array([*wide, *open_], dtype=np.int64).reshape(-1, 2)
    narrow = [m for m, is_narrow in zip(meetings, apart, strict=True) if is_narrow]
    height = storey.z_ceiling - storey.z_floor
    gaps = [
        Doorway(Polygon(), m.ends.mean(axis=0), m.rooms, m.length, height, m.across) for m in narrow
    ]
    return joined(np.arange(len(rooms)), pairs), [*doors, *gaps]


def _regrouped(doors: list[Doorway], group: IntArray) -> list[Doorway]:
    """The doors between the scored rooms; what lies inside one of them is none."""
    found = []
    for door in doors:
        a, b = (int(group[room]) if room != NOTHING else NOTHING for room in door.rooms)
        if a != b:
            found.append(replace(door, rooms=(a, b)))
    return found


def _above_parapet(opening: Opening, storey: Storey) -> bool:
    to_ceiling = opening.z_max > storey.z_ceiling - storey.z_floor - TOUCH
    return to_ceiling and not interrupts(opening) and not opening.glass


def _only(gaps: SideMap, wanted: Sequence[bool]) -> SideMap:
    kept = np.array([wanted[k] for k in gaps.value], dtype=bool)
    return SideMap(gaps.side[kept], gaps.low[kept], gaps.high[kept], gaps.value[kept])


def _pillars(outline: Outline, bounds: SideMap) -> frozenset[int]:
    """Small parts of the walls that stand free in one room."""
    found = []
    part = outline.part[bounds.side]
    for index in range(len(outline.solid.geoms)):
        sides, around = outline.part == index, part == index
        covered = float((bounds.high - bounds.low)[around].sum())
        whole = covered > 0.999 * float(outline.length[sides].sum())
        if whole and len(set(bounds.value[around])) == 1 and outline.length[sides].max() < PILLAR:
            found.append(index)
    return frozenset(found)
