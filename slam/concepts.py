"""Rooms, walls and the floor in the graph: variables that the published factors tie to planes."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import gtsam

from slam.core import Array
from slam.factors import PlaneKey, room_factor, wall_factor
from slam.solver import Solver

WALL, ROOM, FLOOR = "w", "r", "f"


@dataclass(frozen=True)
class ConceptConfig:
    """Standard deviations [m] of the published factors, whose information the paper's code sets by
    hand (0.1, 10 and 1e-4)."""

    room_sigma: float = 3.16
    wall_sigma: float = 0.316
    floor_sigma: float = 100.0


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
    """The rooms and walls that a solver holds, by their names. plane_key: the variable of a plane,
    and its chart."""

    def __init__(
        self, solver: Solver, plane_key: Callable[[int], PlaneKey], config: ConceptConfig
    ) -> None:
        self._solver = solver
        self._plane_key = plane_key
        self._config = config
        self._held: dict[str, dict[int, RoomNode | WallNode]] = {ROOM: {}, WALL: {}}
        self._variables: dict[tuple[str, int], int] = {}
        self._next_variable = 0

    def hold(self, rooms: dict[int, RoomNode], walls: dict[int, WallNode]) -> None:
        """Makes the solver hold exactly these: adds, rewires and removes."""
        self._replace(ROOM, dict(rooms))
        self._replace(WALL, dict(walls))

    def forget_those_of(self, planes: set[int]) -> None:
        """Removes the rooms and walls that rest on any of these planes."""
        for layer, held in self._held.items():
            for name in [name for name, node in held.items() if planes & set(node.planes)]:
                self._remove(layer, name)

    def planes(self, layer: str) -> dict[int, Sequence[int]]:
        """Plane ids of each room or wall."""
        return {name: node.planes for name, node in self._held[layer].items()}

    def floor(self, storey: int = 0) -> Array | None:
        """The place (2,) of a storey's floor node, once there is a room."""
        key = gtsam.symbol(FLOOR, storey)
        return self._solver.point2(key) if self._solver.holds(key) else None

    def _replace(self, layer: str, nodes: dict[int, RoomNode | WallNode]) -> None:
        held = self._held[layer]
        for name in [name for name in held if name not in nodes]:
            self._remove(layer, name)
        for name, node in nodes.items():
            if name in held and held[name].planes == node.planes:
                continue
            known = name in held
            if known:
                self._solver.remove((layer, name))
            self._add(layer, name, node, known)

    def _remove(self, layer: str, name: int) -> None:
        self._solver.remove((layer, name))
        if layer == ROOM:
            self._solver.remove((FLOOR, name))
        self._solver.withdraw(self._variables.pop((layer, name)))
        del self._held[layer][name]

    def _add(self, layer: str, name: int, node: RoomNode | WallNode, known: bool) -> None:
        if not known:  # a new variable: one that is given up stays in the solver until its update
            self._variables[layer, name] = gtsam.symbol(layer, self._next_variable)
            self._next_variable += 1
        key = self._variables[layer, name]
        planes = [self._plane_key(plane) for plane in node.planes]
        if isinstance(node, RoomNode):
            noise = gtsam.noiseModel.Isotropic.Sigma(2, self._config.room_sigma)
            factor = room_factor(key, planes, node.pairs, node.centre, noise)
            if known:
                self._solver.remove((FLOOR, name))
            else:
                self._solver.insert(key, node.centre[:2])
            self._join_floor(name, key, node)
        else:
            noise = gtsam.noiseModel.Isotropic.Sigma(3, self._config.wall_sigma)
            factor = wall_factor(key, planes, node.centre, noise)
            if not known:
                self._solver.insert(key, node.centre)
        self._solver.add((layer, name), factor)
        self._held[layer][name] = node

    def _join_floor(self, room: int, key: int, node: RoomNode) -> None:
        """A floor node is tied to its rooms by their relative position when found (S-Graphs+), or
        when they came to rest on other planes, which may move them by metres."""
        floor_key, centre = gtsam.symbol(FLOOR, node.storey), node.centre
        floor = self.floor(node.storey)
        if floor is None:
            floor = centre[:2]
            self._solver.insert(floor_key, floor)
            weak = gtsam.noiseModel.Isotropic.Sigma(2, self._config.floor_sigma)
            self._solver.add(
                ("floor", node.storey), gtsam.PriorFactorPoint2(floor_key, floor, weak)
            )
        noise = gtsam.noiseModel.Isotropic.Sigma(2, self._config.floor_sigma)
        factor = gtsam.BetweenFactorPoint2(floor_key, key, centre[:2] - floor, noise)
        self._solver.add((FLOOR, room), factor)
