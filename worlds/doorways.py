"""Openings as drawn: where they interrupt walls, how wide they are, and which rooms they join."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import shapely
from shapely.geometry import MultiPolygon, Polygon

from slam.core import Array
from worlds.drafting import as_multipolygon
from worlds.outline import TOUCH, Outline
from worlds.plan import Opening
from worlds.sidemap import NOTHING, SideMap, side_map

THRESHOLD = 0.05
"""An opening that begins lower than this above the floor interrupts the wall [m]."""


@dataclass(frozen=True)
class Doorway:
    """A passable opening as drawn. space: what it takes out of the walls (empty where rooms meet
    without any); middle: (2,); rooms: NOTHING stands for outside; width, height [m]; across: (2,)
    unit vector through it, into the first of the rooms.
    """

    space: Polygon
    middle: Array
    rooms: tuple[int, int]
    width: float
    height: float
    across: Array


def interrupts(opening: Opening) -> bool:
    """Whether an opening reaches down to the floor, so that no wall is left below it."""
    return opening.z_min < THRESHOLD


def passable(opening: Opening) -> bool:
    """Whether one can drive through: nobody does through a window or a pane, however low."""
    return interrupts(opening) and opening.kind != "window" and not opening.glass


def interruptions(outline: Outline, openings: Sequence[Opening]) -> SideMap:
    """Where each opening (its place in ``openings``) interrupts a side."""
    if not openings or not len(outline.start):
        return side_map([])
    footprints = np.array([opening.footprint for opening in openings])
    opening, side = outline.tree.query(footprints, predicate="intersects")
    inside = shapely.intersection(outline.tree.geometries[side], footprints[opening])
    parts, row = shapely.get_parts(inside, return_index=True)
    long = shapely.length(parts) > TOUCH
    bounds = [shapely.get_point(parts[long], k) for k in (0, -1)]
    ends = [np.column_stack([shapely.get_x(p), shapely.get_y(p)]) for p in bounds]
    along = np.stack([outline.along(side[row[long]], end) for end in ends])
    return SideMap(side[row[long]], along.min(axis=0), along.max(axis=0), opening[row[long]])


def doorways(
    outline: Outline, openings: Sequence[Opening], gaps: SideMap, bounds: SideMap
) -> list[Doorway]:
    """The passable openings that cut a wall. bounds: which room each stretch of wall bounds."""
    by_opening: dict[int, list[tuple[int, float, float]]] = {}
    for side, low, high, k in zip(gaps.side, gaps.low, gaps.high, gaps.value, strict=True):
        by_opening.setdefault(int(k), []).append((int(side), float(low), float(high)))
    return [
        _doorway(outline, openings[k], rows, bounds)
        for k, rows in sorted(by_opening.items())
        if passable(openings[k])
    ]


def _doorway(
    outline: Outline, opening: Opening, rows: list[tuple[int, float, float]], bounds: SideMap
) -> Doorway:
    footprint = opening.footprint
    inside = as_multipolygon(footprint.intersection(outline.near(footprint)))
    space = max(inside.geoms, key=lambda p: p.area)
    longest = max(rows, key=lambda row: row[2] - row[1])
    widths, rooms = [0.0, 0.0], [NOTHING, NOTHING]
    for side, low, high in rows:
        facing = float(outline.normal[side] @ outline.normal[longest[0]])
        if abs(facing) < 0.5:  # a side that runs through the opening, not along it
            continue
        k = 0 if facing > 0.0 else 1
        widths[k] += high - low
        room = bounds.at(side, (low + high) / 2.0)
        rooms[k] = room if rooms[k] == NOTHING else rooms[k]
    middle = np.asarray(space.centroid.coords)[0]
    height = opening.z_max - max(opening.z_min, 0.0)
    across = outline.normal[longest[0]]
    return Doorway(space, middle, (rooms[0], rooms[1]), max(widths), height, across)


def without(solid: MultiPolygon, openings: Sequence[Opening]) -> MultiPolygon:
    """The walls with openings taken out, without corners that coincide."""
    holes = shapely.union_all([opening.footprint for opening in openings])
    cut = as_multipolygon(solid.difference(holes))
    sound = shapely.remove_repeated_points(cut, TOUCH)
    return as_multipolygon(shapely.orient_polygons(shapely.normalize(sound)))
