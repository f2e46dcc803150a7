"""The route of a run: into every room that the base can reach."""

from __future__ import annotations

import itertools
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
import shapely
from scipy.ndimage import label
from shapely.geometry import Polygon

from sim.freespace import FreeSpace, free_space
from sim.names import unknown_name
from sim.roadmap import build_roadmap
from sim.smooth import smooth
from sim.tour import plan_tour
from slam.core import Array, InputError, IntArray

if TYPE_CHECKING:
    from worlds.truth import Room
    from worlds.world import World


@dataclass(frozen=True)
class RouteConfig:
    """radius of the disc and the margin kept to walls beyond it [m] (0.59 m doors leave 9 cm to
    each side of the disc); cell of the grid [m]; view [m], how far from the line of drive a part of
    a room may lie before it gets a visit of its own; sill [m], how far beyond the rooms' outlines
    the base may be (half the thickness of the walls that doors lead through)."""

    radius: float = 0.20
    margin: float = 0.04
    cell: float = 0.05
    view: float = 7.0
    sill: float = 0.40


@dataclass(frozen=True)
class Route:
    """points: (N, 2) world [m], the first inside a room; rooms: names in the order of their first
    visit; unreachable: names of the rooms that no way leads to; storey: which."""

    points: Array
    rooms: tuple[str, ...]
    unreachable: tuple[str, ...]
    storey: int = 0

    @property
    def length(self) -> float:
        """Length of the line [m]."""
        return float(np.linalg.norm(np.diff(self.points, axis=0), axis=1).sum())


def plan_route(
    world: World,
    storey: int = 0,
    start_room: str | None = None,
    config: RouteConfig = RouteConfig(),
) -> Route:
    """A short tour through every room that is joined to the start by ways wide enough.

    It starts in ``start_room``, else in the first room of the largest part that is not a corridor,
    and enters each room to its middle, and farther where its middle does not show all of it.
    Raises InputError for an unknown storey or room, and where no room can be reached.
    """
    rooms = _rooms_of(world, storey)
    start = _named(rooms, start_room)
    space = _space(world, rooms, storey, config)
    parts = _parts(space)
    inside = [_cells_inside(space, room) for room in rooms]
    part = _choose_part(parts, inside, rooms, start)
    reached = [cells[parts[cells] == part] for cells in inside]
    first = start if start is not None else _first(rooms, reached)
    targets = [_targets(space, r, c, config) for r, c in zip(rooms, reached, strict=True)]
    tour_cells, order = _tour(world, space, parts == part, rooms, targets, first)
    return Route(
        points=smooth(space, tour_cells),
        rooms=tuple(rooms[i].name for i in order),
        unreachable=tuple(r.name for r, t in zip(rooms, targets, strict=True) if not len(t)),
        storey=storey,
    )


# --- which rooms ---------------------------------------------------------------------------------


def _rooms_of(world: World, storey: int) -> list[Room]:
    storeys = len(world.footprints)
    if not 0 <= storey < storeys:
        raise InputError(f"storey {storey}: the building has storeys 0 to {storeys - 1}")
    rooms = [room for room in world.truth.rooms if room.storey == storey]
    if not rooms:
        raise InputError(f"storey {storey}: expected at least one room")
    return rooms


def _named(rooms: list[Room], name: str | None) -> int | None:
    """The place of the room with that name (or with that one but for its case)."""
    if name is None:
        return None
    names = [room.name for room in rooms]
    folded = [n.lower() for n in names]
    if name.lower() not in folded:
        raise unknown_name("start room", name, names)
    return names.index(name) if name in names else folded.index(name.lower())


def _space(world: World, rooms: list[Room], storey: int, config: RouteConfig) -> FreeSpace:
    outlines = shapely.union_all([room.polygon for room in rooms])
    region = shapely.buffer(outlines, config.sill, join_style="mitre")
    distance = config.radius + config.margin
    return free_space(world.footprints[storey], region, distance, config.cell)


def _parts(space: FreeSpace) -> IntArray:
    """(F,) the connected part that each free cell belongs to."""
    parts, _ = label(space.index >= 0, structure=np.ones((3, 3)))
    return parts[tuple(space.cells.T)].astype(np.int64)


def _cells_inside(space: FreeSpace, room: Room) -> IntArray:
    """Free cells within a room's outline."""
    low_x, low_y, high_x, high_y = room.polygon.bounds
    centres = space.centres
    near = np.flatnonzero(
        (centres[:, 0] >= low_x)
        & (centres[:, 0] <= high_x)
        & (centres[:, 1] >= low_y)
        & (centres[:, 1] <= high_y)
    )
    return near[shapely.contains_xy(room.polygon, *centres[near].T)]


def _choose_part(
    parts: IntArray, inside: list[IntArray], rooms: list[Room], start: int | None
) -> int:
    """The part that holds most of the start room; without one, that which reaches most rooms."""
    if start is not None:
        if not len(inside[start]):
            raise InputError(f"start room '{rooms[start].name}': the base does not fit into it")
        return int(np.bincount(parts[inside[start]]).argmax())
    reached = np.zeros(int(parts.max(initial=0)) + 1)
    for cells in inside:
        area = np.bincount(parts[cells], minlength=len(reached))
        reached += (area > 0) + area / max(len(parts), 1)
    if not reached.any():
        raise InputError("not one room that the base can reach: no room has space for it")
    return int(reached.argmax())


def _first(rooms: list[Room], reached: list[IntArray]) -> int:
    """The first reached room that is a room, not a corridor; a corridor where there is no other."""
    open_rooms = [i for i, cells in enumerate(reached) if len(cells)]
    return min(open_rooms, key=lambda i: (_dislike(rooms[i].kind), i))


def _dislike(kind: str) -> int:
    """How little a kind of room is liked to start in."""
    return {"room": 0, "corridor": 2, "stairs": 2, "elevator": 2}.get(kind, 1)


# --- where to go in them -------------------------------------------------------------------------


def _targets(space: FreeSpace, room: Room, cells: IntArray, config: RouteConfig) -> IntArray:
    """Cells to visit in a room: its middle, then whatever is far from all chosen or hidden."""
    if not len(cells):
        return cells
    points = space.centres[cells]
    clearance = space.clearance[tuple(space.cells[cells].T)]
    outline = shapely.buffer(room.polygon, -0.05)
    shapely.prepare(outline)
    chosen = [_middle(points, clearance, room)]
    unseen = points[:: max(1, len(points) // 400)]
    few = 0.03 * len(unseen)
    unseen = _hidden(unseen, points[chosen[0]], outline, config.view)
    while len(unseen) > few:
        midst = unseen[np.argmin(np.linalg.norm(unseen - np.median(unseen, axis=0), axis=1))]
        chosen.append(_roomy_near(points, clearance, midst))
        unseen = unseen[np.linalg.norm(unseen - midst, axis=1) > 1.0]
        unseen = _hidden(unseen, points[chosen[-1]], outline, config.view)
    return np.unique(cells[chosen])


def _middle(points: Array, clearance: Array, room: Room) -> int:
    """The roomy cell nearest to the middle of the outline."""
    off_middle = np.linalg.norm(points - np.asarray(room.polygon.centroid.coords[0]), axis=1)
    return int(np.argmin(np.where(clearance >= 0.7 * clearance.max(), off_middle, np.inf)))


def _hidden(samples: Array, eye: Array, outline: Polygon, view: float) -> Array:
    """The samples (N, 2) that are farther than ``view`` from ``eye`` or behind a corner."""
    lines = np.stack([np.broadcast_to(eye, samples.shape), samples], axis=1)
    near = np.linalg.norm(samples - eye, axis=1) <= view
    return samples[~(near & shapely.covers(outline, shapely.linestrings(lines)))]


def _roomy_near(points: Array, clearance: Array, place: Array) -> int:
    """The cell with most room about it within 1 m of a place."""
    distances = np.linalg.norm(points - place, axis=1)
    liked = np.where(distances <= distances.min() + 1.0, clearance - 0.1 * distances, -np.inf)
    return int(np.argmax(liked))


# --- the tour ------------------------------------------------------------------------------------


def _tour(
    world: World,
    space: FreeSpace,
    usable: np.ndarray,
    rooms: list[Room],
    targets: list[IntArray],
    first: int,
) -> tuple[list[Array], list[int]]:
    """The legs (M, 2) of a tour through all targets, and the rooms in the order of their visit."""
    visits = [first, *(i for i in range(len(rooms)) if i != first)]
    goals = np.concatenate([targets[i] for i in visits])
    room_of = np.repeat(visits, [len(targets[i]) for i in visits])
    roadmap = build_roadmap(space.graph(), _with_doors(world, space, usable, rooms, goals))
    sources = np.arange(len(goals))
    costs, before = roadmap.distances(sources)
    tour = plan_tour(costs[:, : len(goals)], 0)
    centres = space.centres
    legs = [centres[roadmap.way(int(a), before[a], int(b))] for a, b in itertools.pairwise(tour)]
    if not legs:
        legs = [_little_drive(space, int(goals[0]))]
    visited = list(dict.fromkeys(int(room_of[i]) for i in tour))
    return legs, visited


def _with_doors(
    world: World, space: FreeSpace, usable: np.ndarray, rooms: list[Room], goals: IntArray
) -> IntArray:
    """The goals, and then the middles of the doors that the base fits through."""
    ids = {room.id for room in rooms}
    places = dict.fromkeys(int(goal) for goal in goals)
    for door in world.truth.doors:
        if ids.intersection(door.rooms):
            cell = space.nearest(door.centre[:2], within=0.15)
            if cell is not None and usable[cell]:
                places.setdefault(cell)
    return np.array(list(places), dtype=np.int64)


def _little_drive(space: FreeSpace, cell: int) -> Array:
    """A straight line in a building with one place to visit: some motion, at least."""
    here = space.centres[cell]
    angles = np.arange(16) * np.pi / 8.0
    reaches = np.arange(1.5, 0.0, -0.1)
    for reach in reaches:
        for angle in angles:
            there = here + reach * np.array([np.cos(angle), np.sin(angle)])
            if space.clearance_along(here, there) > 0.0:
                return np.stack([here, there])
    return np.stack([here, here + 1e-3])
