"""Rooms as drawn: their clear outlines, the wall sides that bound them, and which are one."""

from __future__ import annotations

import logging
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import shapely
from shapely import STRtree
from shapely.geometry import LineString, Polygon

from slam.core import Array, IntArray
from worlds.drafting import as_multipolygon
from worlds.outline import Outline
from worlds.plan import RoomOutline
from worlds.sidemap import SideMap

REACH = 0.02
"""A room reaches up to walls that its outline misses by this much [m]."""
LEAST = 0.02
"""Rooms with less free space are drawing errors [m2]."""
WIDE = 2.5
"""An opening wider than this does not separate rooms [m]."""
FULL_WIDTH = 0.8
"""An open boundary over this part of the narrower room's width does not separate rooms."""
INWARD = 0.5
"""How far inside its open boundary the width of a room is taken [m]."""
CONTACT = 0.001
"""Rooms that are this near to each other have no wall between them [m]."""
GRID = 1e-7
"""Grid on which clear outlines are united, well below ``outline.TOUCH`` [m]."""


@dataclass(frozen=True)
class ClearRoom:
    """What the walls leave free of a room as drawn."""

    name: str
    kind: str
    polygon: Polygon


@dataclass(frozen=True)
class OpenBoundary:
    """Where two rooms meet without a wall, (2, 2) from end to end."""

    rooms: tuple[int, int]
    ends: Array

    @property
    def length(self) -> float:
        """[m]."""
        return float(np.linalg.norm(self.ends[1] - self.ends[0]))

    @property
    def across(self) -> Array:
        """(2,) a unit vector through it, to either side."""
        run = (self.ends[1] - self.ends[0]) / self.length
        return np.array([-run[1], run[0]])


def clear_rooms(rooms: Sequence[RoomOutline], outline: Outline) -> list[ClearRoom]:
    """The rooms that have free space: the largest part of each outline that no wall covers."""
    if not rooms:
        return []
    outlines = np.array([room.outline for room in rooms])
    grown = shapely.buffer(outlines, REACH, join_style="mitre", mitre_limit=2.0)
    tree, taken = STRtree(grown), list(outlines)
    clear = []
    for i, room in enumerate(rooms):
        others = [taken[j] for j in tree.query(grown[i]) if j != i]
        free = shapely.union_all([*others, outline.near(grown[i])])
        taken[i] = largest_part(grown[i].difference(free))
        if taken[i].area > LEAST:
            clear.append(ClearRoom(room.name, room.kind, taken[i]))
        else:
            logging.getLogger(__name__).warning('room "%s" has no free space', room.name)
    return clear


def largest_part(shape: shapely.Geometry) -> Polygon:
    """The largest polygon of any geometry, an empty one where it has none."""
    return max(as_multipolygon(shape).geoms, key=lambda p: p.area, default=Polygon())


def boundaries(rooms: Sequence[ClearRoom], outline: Outline) -> SideMap:
    """Which room each stretch of wall bounds: its place in ``rooms``."""
    edges = [_edges(room.polygon) for room in rooms]
    owner = np.repeat(np.arange(len(rooms)), [len(e) for e in edges])
    ends = np.concatenate([np.empty((0, 2, 2)), *edges])
    side = outline.side_under(ends[:, 0], ends[:, 1]) if len(ends) else owner
    on = side >= 0
    along = np.stack([outline.along(side[on], ends[on, k]) for k in (0, 1)])
    return SideMap(side[on], along.min(axis=0), along.max(axis=0), owner[on])


def _edges(polygon: Polygon) -> Array:
    """(K, 2, 2) the edges of all rings, without those of no length."""
    rings = [np.asarray(ring.coords) for ring in (polygon.exterior, *polygon.interiors)]
    edges = np.concatenate([np.stack([ring[:-1], ring[1:]], axis=1) for ring in rings])
    return edges[np.linalg.norm(edges[:, 1] - edges[:, 0], axis=1) > 1e-6]


# --- which rooms are one -------------------------------------------------------------------------


def open_boundaries(rooms: Sequence[ClearRoom]) -> list[OpenBoundary]:
    """Every stretch along which two rooms meet without a wall."""
    if len(rooms) < 2:
        return []
    polygons = np.array([room.polygon for room in rooms])
    first, second = STRtree(polygons).query(polygons, predicate="dwithin", distance=CONTACT)
    found = []
    for i, j in zip(first.tolist(), second.tolist(), strict=True):
        if i < j:
            touching = polygons[j].buffer(CONTACT, join_style="mitre")
            runs = shapely.line_merge(polygons[i].boundary.intersection(touching))
            found += [OpenBoundary((i, j), _ends(run)) for run in shapely.get_parts(runs)]
    return [boundary for boundary in found if boundary.length > 10.0 * CONTACT]


def _ends(run: shapely.Geometry) -> Array:
    coords = np.asarray(run.coords)
    return coords[[0, -1]]


def separates(boundary: OpenBoundary, rooms: Sequence[ClearRoom]) -> bool:
    """Whether an open boundary is but a doorway, and the rooms at its sides are two."""
    if boundary.length > WIDE:
        return False
    widths = [_width_inside(rooms[i].polygon, boundary.ends) for i in boundary.rooms]
    return boundary.length < FULL_WIDTH * min(widths)


def _width_inside(room: Polygon, ends: Array) -> float:
    """The room's width beside its open boundary, along it; zero where it is not that deep."""
    run = (ends[1] - ends[0]) / np.linalg.norm(ends[1] - ends[0])
    for across in (np.array([-run[1], run[0]]), np.array([run[1], -run[0]])):
        middle = ends.mean(axis=0) + INWARD * across
        line = LineString([middle - 100.0 * run, middle + 100.0 * run]).intersection(room)
        here = [p.length for p in shapely.get_parts(line) if p.distance(shapely.Point(middle)) == 0]
        if room.contains(shapely.Point(middle)):
            return max(here, default=0.0)
    return 0.0


def united(
    rooms: Sequence[ClearRoom], group: IntArray, between: Sequence[tuple[int, Polygon]]
) -> list[ClearRoom]:
    """One room per group. between: (room, the space in an opening that does not separate it)."""
    merged = []
    for g in range(int(group.max(initial=-1)) + 1):
        members = [room for room, own in zip(rooms, group, strict=True) if own == g]
        if len(members) == 1:
            merged.append(members[0])
            continue
        spaces = [space for room, space in between if group[room] == g]
        polygons = [room.polygon for room in members]
        whole = largest_part(shapely.union_all([*polygons, *spaces], grid_size=GRID))
        largest = max(members, key=lambda room: room.polygon.area)
        merged.append(ClearRoom(" + ".join(room.name for room in members), largest.kind, whole))
    return merged
