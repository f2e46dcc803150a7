"""Where people walk: from place to place through the doors, and never into the base's way.

The base is blind to people, so they look out for it. Places well off its route are safe. Whoever
wants to cross the route, or to walk along it, sets out only if the base, as fast as it drives,
cannot be near before they are safe again; else they stop and wait, or think of something else.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np
import shapely
from scipy.ndimage import distance_transform_edt
from scipy.sparse.csgraph import dijkstra

from sim.freespace import FreeSpace, free_space
from sim.smooth import smooth
from slam.core import Array, IntArray
from worlds.people import REACH

if TYPE_CHECKING:
    from worlds.world import World

SPACING = 0.05
"""Between the samples of a walk [m]."""


@dataclass(frozen=True)
class WalkerConfig:
    """How people behave. off_walls: of their middle [m]; off_route: what makes a place safe beside
    the sizes of base and person [m]; speed, dwell: ranges of walking speed [m/s] and of standing
    between two walks [s]; patience: of waiting for the base [s]; nearest, farthest: costs of a walk
    [m]; apart: between two people's lines [m]; turn: fastest [rad/s]; stride_angle, stride_length:
    the legs' largest angle [rad], and how far one walks in a full cycle [m]; cell: of the grid [m];
    sill: how far beyond the rooms' outlines one may be, in doorways [m].
    """

    off_walls: float = 0.28
    off_route: float = 0.12
    speed: tuple[float, float] = (0.7, 1.3)
    dwell: tuple[float, float] = (1.0, 8.0)
    patience: float = 5.0
    farthest: float = 18.0
    nearest: float = 1.5
    apart: float = 0.75
    turn: float = 3.0
    stride_angle: float = 0.28
    stride_length: float = 1.4
    cell: float = 0.10
    sill: float = 0.40


@dataclass(frozen=True)
class Walk:
    """A line (K, 2), sampled every SPACING; safe: (K,) whether the base keeps clear of it."""

    points: Array
    safe: Array

    def unsafe_end(self, at: int) -> int:
        """Where the stretch that begins at a sample, and is not safe, ends: the next safe one."""
        later = np.flatnonzero(self.safe[at:])
        return at + int(later[0]) if len(later) else len(self.safe) - 1


@dataclass
class Walker:
    """Somebody on their way. place (2,) [m], yaw, stride: angle of the legs [rad]; along the walk
    [m]; until: standing till then [s]; waited: for the base [s]."""

    speed: float
    place: Array
    yaw: float
    walk: Walk | None = None
    along: float = 0.0
    until: float = 0.0
    waited: float = 0.0
    stride: float = 0.0

    @property
    def line(self) -> shapely.Geometry:
        """What of the floor they may still need."""
        if self.walk is None:
            return shapely.Point(self.place)
        return shapely.linestrings(self.walk.points)


@dataclass
class Walkers:
    """The people of one storey. places: (P, 2) and yaws where they stand at first."""

    space: FreeSpace
    safe: Array
    base_radius: float
    base_speed: float
    rng: np.random.Generator
    config: WalkerConfig = WalkerConfig()
    people: list[Walker] = field(default_factory=list)
    time: float = 0.0

    def __post_init__(self) -> None:
        self._graph = self.space.graph()
        off = self.base_radius + REACH + self.config.off_route
        rows, columns = self.space.cells.T
        self._safe_cells = np.flatnonzero(self.safe[rows, columns] >= off)
        self._off = off

    def join(self, place: Array, yaw: float) -> Walker | None:
        """One more person, at the safe place nearest to the one given; None if there is none."""
        free = self._at(self._safe_cells)
        for other in self.people:
            free = free[np.linalg.norm(free - other.place, axis=1) >= self.config.apart]
        if not len(free):
            return None
        at = free[int(np.argmin(np.linalg.norm(free - place, axis=1)))]
        speed, until = self.rng.uniform(*self.config.speed), self.rng.uniform(*self.config.dwell)
        walker = Walker(float(speed), at, yaw, until=float(until) - self.config.dwell[0])
        self.people.append(walker)
        return walker

    def advance(self, step: float, base: Array) -> None:
        """Moves everybody on by a step [s]; the base's middle is at (2,) now."""
        self.time += step
        for walker in self.people:
            if walker.walk is None:
                walker.stride *= 0.5
                if self.time >= walker.until:
                    self._set_out(walker)
            else:
                self._go_on(walker, walker.walk, step, base)

    def _go_on(self, walker: Walker, walk: Walk, step: float, base: Array) -> None:
        here = int(walker.along / SPACING)
        there = min(
            int(np.ceil((walker.along + walker.speed * step) / SPACING)), len(walk.safe) - 1
        )
        if walk.safe[here] and not walk.safe[here : there + 1].all():
            first = here + int(np.argmin(walk.safe[here : there + 1]))
            if not self._may_cross(walker, walk, first, base):
                self._wait(walker, step)
                return
        walker.waited = 0.0
        walker.along += walker.speed * step
        s = walker.along / SPACING
        if s >= len(walk.points) - 1:
            self._arrive(walker, walk.points[-1])
            return
        k = int(s)
        ahead = walk.points[k + 1] - walk.points[k]
        walker.place = walk.points[k] + (s - k) * ahead
        self._turn(walker, float(np.arctan2(ahead[1], ahead[0])), step)
        cycle = 2.0 * np.pi * walker.along / self.config.stride_length
        walker.stride = float(self.config.stride_angle * np.sin(cycle))

    def _turn(self, walker: Walker, heading: float, step: float) -> None:
        left = (heading - walker.yaw + np.pi) % (2.0 * np.pi) - np.pi
        most = self.config.turn * step
        walker.yaw += float(np.clip(left, -most, most))

    def _may_cross(self, walker: Walker, walk: Walk, first: int, base: Array) -> bool:
        """Whether the base cannot come near before the walker is safe again."""
        end = walk.unsafe_end(first)
        duration = ((end - first + 2) * SPACING) / walker.speed + 0.2
        gap = float(np.linalg.norm(walk.points[max(first - 1, 0) : end + 1] - base, axis=1).min())
        return gap > self.base_speed * duration + self.base_radius + REACH + SPACING

    def _wait(self, walker: Walker, step: float) -> None:
        walker.stride *= 0.5
        walker.waited += step
        if walker.waited > self.config.patience:
            self._arrive(walker, walker.place)

    def _arrive(self, walker: Walker, place: Array) -> None:
        walker.place, walker.walk, walker.along, walker.waited = place, None, 0.0, 0.0
        walker.until = self.time + float(self.rng.uniform(*self.config.dwell))

    # --- finding a way ---------------------------------------------------------------------------

    def _at(self, cells: IntArray) -> Array:
        """(K, 2) the middles of cells (K,)."""
        return self.space.origin + self.space.cell * self.space.cells[cells][:, ::-1]

    def _clear_of_others(self, walk: Walk, own: Walker) -> bool:
        line = shapely.linestrings(walk.points)
        others = [other.line for other in self.people if other is not own]
        return all(line.distance(other) >= self.config.apart for other in others)

    def _set_out(self, walker: Walker) -> None:
        """A walk to a random safe place, if nobody is in the way; else a moment's thought."""
        walk = self._found(walker)
        if walk is None or not self._clear_of_others(walk, walker):
            walker.until = self.time + float(self.rng.uniform(*self.config.dwell)) / 2.0
            return
        walker.walk, walker.along = walk, 0.0

    def _found(self, walker: Walker) -> Walk | None:
        start = self.space.nearest(walker.place, within=3.0 * self.config.cell)
        if start is None:
            return None
        cost, before = dijkstra(
            self._graph, indices=start, limit=self.config.farthest, return_predecessors=True
        )
        far = cost[self._safe_cells]
        goals = self._safe_cells[np.isfinite(far) & (far > self.config.nearest)]
        if not len(goals):
            return None
        chain = [int(self.rng.choice(goals))]
        while chain[-1] != start:
            chain.append(int(before[chain[-1]]))
        line = smooth(self.space, [self._at(np.array(chain[::-1]))])
        return self._sampled(np.concatenate([walker.place[None], line[1:]]))

    def _sampled(self, line: Array) -> Walk:
        along = np.append(0.0, np.cumsum(np.linalg.norm(np.diff(line, axis=0), axis=1)))
        s = np.append(np.arange(0.0, along[-1], SPACING), along[-1])
        points = np.stack([np.interp(s, along, line[:, k]) for k in (0, 1)], axis=1)
        columns, rows = np.round((points - self.space.origin) / self.space.cell).astype(int).T
        # The ends are cells that are safe by choice; a corner that was cut may lie in none.
        safe = self.safe[rows, columns] >= self._off
        return Walk(points, safe)


def gather_walkers(
    world: World,
    storey: int,
    route: Array,
    base_radius: float,
    base_speed: float,
    rng: np.random.Generator,
    config: WalkerConfig = WalkerConfig(),
) -> tuple[Walkers, list[Walker | None]]:
    """Everybody on a storey that the base drives through on ``route`` (N, 2), in the order of
    ``world.people``; None for those for whom no place is safe, and on other storeys."""
    rooms = [room.polygon for room in world.truth.rooms if room.storey == storey]
    region = shapely.buffer(shapely.union_all(rooms), config.sill, join_style="mitre")
    space = free_space(world.footprints[storey], region, config.off_walls, config.cell)
    walkers = Walkers(space, off_route(space, route), base_radius, base_speed, rng, config)
    return walkers, [
        walkers.join(np.array(person.place), person.yaw) if person.storey == storey else None
        for person in world.people
    ]


def off_route(space: FreeSpace, route: Array) -> Array:
    """(H, W) distance of the grid's cells from a line (N, 2), never too large [m]."""
    line = shapely.get_coordinates(shapely.segmentize(shapely.linestrings(route), space.cell / 2.0))
    columns, rows = np.round((line - space.origin) / space.cell).astype(int).T
    height, width = space.index.shape
    inside = (rows >= 0) & (rows < height) & (columns >= 0) & (columns < width)
    free = np.ones((height, width), dtype=bool)
    free[rows[inside], columns[inside]] = False
    return distance_transform_edt(free) * space.cell - space.cell
