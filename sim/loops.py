"""Loops of a building, driven round: doors that a tour left out, put in where that costs least."""

from __future__ import annotations

import itertools
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from slam.core import Array, IntArray


@dataclass(frozen=True)
class Passage:
    """A door that the base fits through: the grid's cell in its middle, and its two rooms."""

    cell: int
    rooms: tuple[int, int]


def with_loops(
    tour: Sequence[int],
    costs: Array,
    room: IntArray,
    passages: Sequence[Passage],
    place: Mapping[int, int],
    crossed: Sequence[IntArray],
    most: float,
) -> list[int]:
    """The tour with a way through one door of each two rooms between which it knew another way.

    tour: places, those of goals first; costs: (G, P) from goals to places; room: (G,) of the goals;
    place: of a cell; crossed: the rooms of the cells that the legs lead over, -1 in doorways; most:
    what a loop may cost [m].
    """
    found = list(tour)
    known = {pair for rooms in crossed for pair in _crossings(rooms)}
    for passage in passages:
        pair = frozenset(passage.rooms)
        if pair in known:
            continue
        extra, at, places = _cheapest(found, costs, room, passage, place[passage.cell])
        if extra <= most:
            found[at:at] = places
            known.add(pair)
    return found


def _crossings(rooms: IntArray) -> list[frozenset[int]]:
    """The pairs of rooms between which a way leads from the one straight into the other."""
    inside = rooms[rooms >= 0]
    changes = np.flatnonzero(np.diff(inside))
    return [frozenset((int(inside[k]), int(inside[k + 1]))) for k in changes]


def _cheapest(
    tour: Sequence[int], costs: Array, room: IntArray, passage: Passage, door: int
) -> tuple[float, int, list[int]]:
    """What it costs, where, and by which places: from one room through the door to the other."""
    best: tuple[float, int, list[int]] = (np.inf, 0, [])
    for k, (here, then) in enumerate(itertools.zip_longest(tour, tour[1:])):
        if here >= len(room) or room[here] not in passage.rooms:
            continue
        a, b = passage.rooms
        beyond = np.flatnonzero(room == (b if room[here] == a else a))
        cost = costs[here, door] + costs[beyond, door]
        if then is not None:
            cost = cost + costs[beyond, then] - costs[here, then]
        if not len(beyond):
            continue
        least = int(np.argmin(cost))
        if cost[least] < best[0]:
            best = float(cost[least]), k + 1, [door, int(beyond[least])]
    return best
