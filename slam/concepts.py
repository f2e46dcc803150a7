"""Rooms, walls and the floor in the graph: variables that the published factors tie to planes."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass

import gtsam

from slam.core import Array
from slam.factors import PlaneKey, room_factor, wall_factor
from slam.optimiser import Optimiser
from slam.variables import FLOOR, ROOM, WALL


@dataclass(frozen=True)
class ConceptConfig:
    """Standard deviations [m] of the published factors, whose information the paper's code sets by
    hand (0.1, 10 and 1e-4). floor_moved [m]: how far a room goes before its floor is told."""

    room_sigma: float = 3.16
    wall_sigma: float = 0.316
    floor_sigma: float = 100.0
    floor_moved: float = 0.1


@dataclass(frozen=True)
class RoomNode:
    """A room to enter the graph: plane ids, the opposed pairs among them, its centre (3,), and the
    storey that it is on."""

    planes: tuple[int, ...]
    pairs: tuple[tuple[int, int], ...]
    centre: Array
    storey: int = 0


@dataclass(frozen=True)
class WallNode:
    """A wall to enter the graph: its two plane ids and its middle (3,)."""

    planes: tuple[int, int]
    centre: Array


class Concepts:
    """The rooms and walls that the graph holds, by their names. plane_key: the variable of a plane,
    and its chart."""

    def __init__(
        self,
        optimiser: Optimiser,
        plane_key: Callable[[int], PlaneKey],
        config: ConceptConfig,
    ) -> None:
        self._optimiser = optimiser
        self._factors = optimiser.factors
        self._plane_key = plane_key
        self._config = config
        self._held: dict[str, dict[int, RoomNode | WallNode]] = {ROOM: {}, WALL: {}}
        self._variables: dict[tuple[str, int], int] = {}
        self._next_variable = 0
        self._joined: dict[int, Array] = {}

    def hold(self, rooms: dict[int, RoomNode], walls: dict[int, WallNode]) -> None:
        """Makes the solver hold exactly these: adds, rewires and removes."""
        self._replace(ROOM, rooms)
        self._replace(WALL, walls)

    def forget_those_of(self, planes: set[int]) -> None:
        """Removes the rooms and walls that rest on any of these planes."""
        for layer, held in self._held.items():
            for name in [name for name, node in held.items() if planes & set(node.planes)]:
                self._remove(layer, name)

    def _replace(self, layer: str, nodes: Mapping[int, RoomNode | WallNode]) -> None:
        held = self._held[layer]
        for name in sorted(held.keys() - nodes.keys()):
            self._remove(layer, name)
        for name, node in nodes.items():
            known = held.get(name)
            if known is node:
                continue
            if known is None or known.planes != node.planes:
                self._add(layer, name, node, known is not None)
            elif isinstance(node, RoomNode):
                self._follow(name, node)
            held[name] = node

    def _remove(self, layer: str, name: int) -> None:
        self._factors.remove((layer, name))
        if layer == ROOM:
            self._factors.remove((FLOOR, name))
        self._optimiser.withdraw(self._variables.pop((layer, name)))
        del self._held[layer][name]

    def _add(self, layer: str, name: int, node: RoomNode | WallNode, known: bool) -> None:
        if not known:  # a new variable: one that is given up stays in the solver until its update
            self._variables[layer, name] = gtsam.symbol(layer, self._next_variable)
            self._next_variable += 1
        key = self._variables[layer, name]
        planes = [self._plane_key(plane) for plane in node.planes]
        if known:
            self._factors.remove((layer, name))
        if isinstance(node, RoomNode):
            noise = gtsam.noiseModel.Isotropic.Sigma(2, self._config.room_sigma)
            factor = room_factor(key, planes, node.pairs, node.centre, noise)
            if known:
                self._factors.remove((FLOOR, name))
            else:
                self._optimiser.insert(key, node.centre[:2])
            self._join_floor(name, node)
        else:
            noise = gtsam.noiseModel.Isotropic.Sigma(3, self._config.wall_sigma)
            factor = wall_factor(key, planes, node.centre, noise)
            if not known:
                self._optimiser.insert(key, node.centre)
        self._factors.add((layer, name), factor)

    def _join_floor(self, room: int, node: RoomNode) -> None:
        """A floor is amid its rooms. They do not hang on it: what it would tell of them is
        negligible, and all of them would be touched by each update."""
        key, place = gtsam.symbol(FLOOR, node.storey), node.centre[:2].copy()
        if not self._optimiser.solver.holds(key):
            self._optimiser.insert(key, place)
            weak = gtsam.noiseModel.Isotropic.Sigma(2, 100.0 * self._config.floor_sigma)
            self._factors.add(("floor", node.storey), gtsam.PriorFactorPoint2(key, place, weak))
        noise = gtsam.noiseModel.Isotropic.Sigma(2, self._config.floor_sigma)
        self._factors.add((FLOOR, room), gtsam.PriorFactorPoint2(key, place, noise))
        self._joined[room] = place

    def _follow(self, room: int, node: RoomNode) -> None:
        """The floor is told where a room has gone."""
        x, y = (node.centre[:2] - self._joined[room]).tolist()
        if math.hypot(x, y) > self._config.floor_moved:
            self._factors.remove((FLOOR, room))
            self._join_floor(room, node)
