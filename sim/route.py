"""The route of a run: into every room that the base can reach."""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from scipy.sparse.csgraph import connected_components

from sim.levels import Levels, driving_levels
from sim.loops import Passage, with_loops
from sim.roadmap import Roadmap, build_roadmap
from sim.roomchoice import choose_part, first_room, room_named, rooms_of, storeys_of
from sim.smooth import smooth
from sim.targets import targets_in
from sim.tour import plan_tour
from slam.core import Array, InputError, IntArray
from worlds.names import unknown

if TYPE_CHECKING:
    from worlds.plan import NamedRoute, Plan
    from worlds.truth import Room
    from worlds.world import World


@dataclass(frozen=True)
class RouteConfig:
    """radius of the disc and the margin kept to walls beyond it [m] (0.59 m doors leave 9 cm to
    each side of the disc); cell of the grid [m], and of that of a building with more than ``large``
    square metres of rooms (which the base leaves through doors of 0.63 m and more only); view [m],
    how far from the line of drive a part of a room may lie before it gets a visit of its own; sill
    [m], how far beyond the rooms' outlines the base may be (half the thickness of the walls that
    doors lead through); loop [m], how much longer the tour may become to close one loop; closed:
    whether it returns to its start."""

    radius: float = 0.20
    margin: float = 0.04
    cell: float = 0.05
    coarse_cell: float = 0.10
    large: float = 3000.0
    view: float = 7.0
    sill: float = 0.40
    loop: float = 12.0
    closed: bool = False


@dataclass(frozen=True)
class Route:
    """points: (N, 2) world [m], the first inside a room; rooms: names in the order of their first
    visit; unreachable: names of the rooms that no way leads to; storey: on which it starts."""

    points: Array
    rooms: tuple[str, ...]
    unreachable: tuple[str, ...]
    storey: int = 0

    @property
    def length(self) -> float:
        """Length of the line in plan view [m]."""
        return float(np.linalg.norm(np.diff(self.points, axis=0), axis=1).sum())


def plan_route(
    world: World,
    storey: int | None = None,
    start_room: str | None = None,
    config: RouteConfig = RouteConfig(),
    part: NamedRoute | None = None,
) -> Route:
    """A short tour through every room that is joined to the start by ways wide enough.

    It starts in ``start_room``, else in the first room of the largest part that is not a corridor,
    and enters each room to its middle, and farther where its middle does not show all of it. Loops
    of the building are driven round where that is no long detour. storey: that one only (None: all
    that ramps join, or the first); part: the rooms of that route only.
    Raises InputError for an unknown storey or room, and where no room can be reached.
    """
    storeys = storeys_of(world, storey if part is None else part.storey)
    rooms = rooms_of(world, storeys, part)
    start = room_named(rooms, start_room)
    levels = _levels(world, rooms, storeys, config)
    graph = levels.graph()
    _, parts = connected_components(graph, directed=False)
    inside = [levels.inside(room) for room in rooms]
    chosen = choose_part(parts, inside, rooms, start)
    reached = [cells[parts[cells] == chosen] for cells in inside]
    first = start if start is not None else first_room(rooms, reached)
    targets = [targets_in(levels, r, c, config.view) for r, c in zip(rooms, reached, strict=True)]
    passages = _passages(world, levels, rooms, reached)
    goals = _Goals.of(targets, first)
    roadmap = build_roadmap(graph, _places(goals, passages))
    legs, order = _tour(roadmap, goals, passages, _room_of(levels, inside), config)
    return Route(
        points=_line(levels, legs) if legs else _little_drive(levels, int(goals.cells[0])),
        rooms=tuple(rooms[i].name for i in order),
        unreachable=tuple(r.name for r, t in zip(rooms, targets, strict=True) if not len(t)),
        storey=rooms[first].storey,
    )


def named_route(plan: Plan, name: str) -> NamedRoute:
    """A route of a plan by its name (or by that one but for its case). Raises InputError."""
    for route in plan.routes:
        if route.name.lower() == name.lower():
            return route
    if not plan.routes:
        raise InputError(f"unknown route '{name}': scene '{plan.name}' names none")
    raise InputError(unknown("route", name, [route.name for route in plan.routes]))


# --- the world as cells --------------------------------------------------------------------------


def _levels(world: World, rooms: list[Room], storeys: Sequence[int], config: RouteConfig) -> Levels:
    area = sum(room.polygon.area for room in rooms)
    cell = config.cell if area <= config.large else config.coarse_cell
    distance = config.radius + config.margin
    return driving_levels(world, rooms, storeys, distance, config.sill, cell)


def _room_of(levels: Levels, inside: list[IntArray]) -> IntArray:
    """(F,) the room of each free cell, -1 in doorways."""
    found = np.full(len(levels.block), -1, dtype=np.int64)
    for i, cells in enumerate(inside):
        found[cells] = i
    return found


# --- the tour ------------------------------------------------------------------------------------


@dataclass(frozen=True)
class _Goals:
    """Cells to visit (G,), those of the first room first, and the room of each."""

    cells: IntArray
    room: IntArray

    @classmethod
    def of(cls, targets: list[IntArray], first: int) -> _Goals:
        visits = [first, *(i for i in range(len(targets)) if i != first)]
        cells = np.concatenate([targets[i] for i in visits])
        return cls(cells, np.repeat(visits, [len(targets[i]) for i in visits]))


def _passages(
    world: World, levels: Levels, rooms: list[Room], reached: list[IntArray]
) -> list[Passage]:
    """The doors between reached rooms that the base fits through."""
    place = {room.id: i for i, room in enumerate(rooms) if len(reached[i])}
    found = []
    for door in world.truth.doors:
        sides = [place[k] for k in door.rooms if k in place]
        if len(sides) == 2:
            storey = rooms[sides[0]].storey
            cell = levels.nearest(door.centre[:2], storey, within=0.15)
            if cell is not None:
                found.append(Passage(cell, (sides[0], sides[1])))
    return found


def _places(goals: _Goals, passages: list[Passage]) -> IntArray:
    """The goals, and then the middles of the doors."""
    places = dict.fromkeys(int(goal) for goal in goals.cells)
    for passage in passages:
        places.setdefault(passage.cell)
    return np.array(list(places), dtype=np.int64)


def _tour(
    roadmap: Roadmap,
    goals: _Goals,
    passages: list[Passage],
    room_of: IntArray,
    config: RouteConfig,
) -> tuple[list[IntArray], list[int]]:
    """The legs, cells each, of a tour through all goals; the rooms in the order of their visit."""
    count = len(goals.cells)
    costs, before = roadmap.distances(np.arange(count))
    tour = plan_tour(costs[:, :count], 0, config.closed).tolist()

    def leg(a: int, b: int) -> IntArray:
        # Ways are known from goals only; one that starts in a door is driven the other way round.
        if a < count:
            return roadmap.way(a, before[a], b)
        return roadmap.way(b, before[b], a)[::-1]

    legs = [leg(a, b) for a, b in itertools.pairwise(tour)]
    if config.loop > 0.0:
        crossed = [room_of[cells] for cells in legs]
        place = {int(cell): k for k, cell in enumerate(roadmap.places)}
        tour = with_loops(tour, costs, goals.room, passages, place, crossed, config.loop)
        legs = [leg(a, b) for a, b in itertools.pairwise(tour)]
    order = dict.fromkeys(int(goals.room[i]) for i in tour if i < count)
    return legs, list(order)


def _line(levels: Levels, legs: list[IntArray]) -> Array:
    """The line through all legs in the world, smoothed on each storey and ramp by itself."""
    sections: list[list[IntArray]] = []
    last = -1
    for leg in legs:
        block = levels.block[leg]
        for piece in np.split(leg, np.flatnonzero(np.diff(block)) + 1):
            if levels.block[piece[0]] != last:
                sections.append([])
                last = int(levels.block[piece[0]])
            sections[-1].append(piece)
    return np.concatenate([_section(levels, pieces) for pieces in sections])


def _section(levels: Levels, pieces: list[IntArray]) -> Array:
    points = smooth(levels.space, [levels.space.centres[piece] for piece in pieces])
    shift = levels.space.centres[pieces[0][0]] - levels.places(pieces[0][:1])[0]
    return points - shift


def _little_drive(levels: Levels, cell: int) -> Array:
    """A straight line in a building with one place to visit: some motion, at least."""
    here = levels.space.centres[cell]
    shift = here - levels.places(np.array([cell]))[0]
    angles = np.arange(16) * np.pi / 8.0
    reaches = np.arange(1.5, 0.0, -0.1)
    for reach in reaches:
        for angle in angles:
            there = here + reach * np.array([np.cos(angle), np.sin(angle)])
            if levels.space.clearance_along(here, there) > 0.0:
                return np.stack([here, there]) - shift
    return np.stack([here, here + 1e-3]) - shift
