"""Where the base can drive in a building of several storeys: storeys and ramps, side by side.

Every storey and every ramp becomes a block of one grid, shifted along x, so that whatever works on
a grid works on a building. Cells of a ramp's block that lie beyond its foot or its head are linked
to the same places on the storeys that it joins.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
import shapely
from scipy.sparse import coo_matrix, csr_matrix
from shapely import affinity
from shapely.geometry import Polygon
from shapely.geometry.base import BaseGeometry

from sim.freespace import FreeSpace, free_space
from slam.core import Array, IntArray

if TYPE_CHECKING:
    from worlds.plan import Ramp
    from worlds.truth import Room
    from worlds.world import World

APPROACH = 0.8
"""How far a ramp's block reaches beyond its foot and its head [m]."""
INTO_RAMP = 0.2
"""A storey's wall under a ramp's head, or over its foot, may reach this far beyond its end [m]."""
ABOVE = 0.5
"""From this far below a storey's floor upwards, a ramp counts as a part of that storey [m]."""


@dataclass(frozen=True)
class Block:
    """A storey, or (with ``ramp``) a ramp up from it; shift: along x in the grid [m]; rise [m]."""

    storey: int
    shift: float
    ramp: Ramp | None = None
    rise: float = 0.0


@dataclass(frozen=True)
class Levels:
    """The grid of all blocks; block: (F,) of each free cell; links: (L, 2) cells that are one."""

    space: FreeSpace
    blocks: tuple[Block, ...]
    block: IntArray
    links: IntArray

    def graph(self) -> csr_matrix:
        """(F, F) costs between neighbouring and linked cells, every pair once."""
        graph = self.space.graph()
        if not len(self.links):
            return graph
        cost = np.full(len(self.links), 1e-3)
        return (graph + coo_matrix((cost, tuple(self.links.T)), shape=graph.shape)).tocsr()

    def places(self, cells: IntArray) -> Array:
        """(N, 2) where cells are in the world."""
        shift = np.array([block.shift for block in self.blocks])[self.block[cells]]
        return self.space.centres[cells] - np.column_stack([shift, np.zeros(len(cells))])

    def inside(self, room: Room) -> IntArray:
        """Free cells of a room; those of a ramp's upper end are in the room above it."""
        found = []
        for k, block in enumerate(self.blocks):
            cells = self.space.inside(affinity.translate(room.polygon, block.shift))
            cells = cells[self.block[cells] == k]
            if block.ramp is not None:
                height = ramp_height(block.ramp, block.rise, self.places(cells))
                upper = height >= block.rise - ABOVE
                cells = cells[upper if room.storey == block.storey + 1 else ~upper]
            if room.storey - block.storey in ((0,) if block.ramp is None else (0, 1)):
                found.append(cells)
        return np.concatenate(found)

    def nearest(self, point: Array, storey: int, within: float) -> int | None:
        """The free cell nearest to a point (2,) on a storey, if one is within that distance [m]."""
        block = next(b for b in self.blocks if b.storey == storey and b.ramp is None)
        return self.space.nearest(point + np.array([block.shift, 0.0]), within)


def ramp_height(ramp: Ramp, rise: float, points: Array) -> Array:
    """(N,) of the ramp's surface above its foot at points (N, 2) [m]; level beyond its ends."""
    foot, head = ramp.foot.mean(axis=0), ramp.head.mean(axis=0)
    along = (head - foot) / np.linalg.norm(head - foot)
    return rise * np.clip((points - foot) @ along / ramp.run, 0.0, 1.0)


def driving_levels(
    world: World,
    rooms: Sequence[Room],
    storeys: Sequence[int],
    distance: float,
    sill: float,
    cell: float,
) -> Levels:
    """Where the base can drive in ``rooms`` and on the ramps between ``storeys``.

    distance: kept to walls [m]; sill: how far beyond the rooms' outlines it may be [m]; cell: of
    the grid, which divides a metre [m].
    """
    blocks = _blocks(world, rooms, storeys, sill)
    walls, regions = [], []
    for block in blocks:
        own = [room.polygon for room in rooms if room.storey == block.storey]
        if block.ramp is None:
            ramps = [r for r in world.ramps if block.storey in (r.storey, r.storey + 1)]
            wall = [world.footprints[block.storey], *(ramp.outline for ramp in ramps)]
            region = shapely.buffer(shapely.union_all(own), sill, join_style="mitre")
        else:
            wall, region = _ramp_walls(world, block.ramp), _approached(block.ramp)
        walls += [affinity.translate(w, block.shift) for w in wall]
        regions.append(affinity.translate(region, block.shift))
    space = free_space(shapely.union_all(walls), shapely.union_all(regions), distance, cell)
    starts = np.array([block.shift for block in blocks]) - 0.5 * _gap(sill)
    low_x = min(room.polygon.bounds[0] for room in rooms)
    block_of = np.searchsorted(low_x + starts, space.centres[:, 0], side="right") - 1
    return Levels(space, blocks, block_of, _links(space, blocks, block_of))


def _gap(sill: float) -> float:
    """Between two blocks [m]."""
    return 4.0 * (sill + APPROACH)


def _blocks(
    world: World, rooms: Sequence[Room], storeys: Sequence[int], sill: float
) -> tuple[Block, ...]:
    ramps = [r for r in world.ramps if {r.storey, r.storey + 1} <= set(storeys)]
    floors = {floor.storey: floor.z_floor for floor in world.truth.floors}
    low_x, _, high_x, _ = shapely.total_bounds([room.polygon for room in rooms])
    width = float(np.ceil(high_x - low_x + _gap(sill)))
    found = [Block(storey, k * width) for k, storey in enumerate(storeys)]
    for k, ramp in enumerate(ramps, start=len(found)):
        rise = floors[ramp.storey + 1] - floors[ramp.storey]
        found.append(Block(ramp.storey, k * width, ramp, rise))
    return tuple(found)


def _approached(ramp: Ramp) -> Polygon:
    """A ramp's outline with the approaches to its foot and to its head."""
    along = APPROACH * _uphill(ramp)
    return Polygon([*(ramp.foot - along), *(ramp.head + along)[::-1]])


def _uphill(ramp: Ramp) -> Array:
    return (ramp.head.mean(axis=0) - ramp.foot.mean(axis=0)) / ramp.run


def _ramp_walls(world: World, ramp: Ramp) -> list[BaseGeometry]:
    """The walls beside a ramp: the lower storey's up to its head, the upper's from its foot on."""
    around = shapely.buffer(_approached(ramp), 1.0, join_style="mitre")
    lower, upper = world.footprints[ramp.storey], world.footprints[ramp.storey + 1]
    onto, off = INTO_RAMP * _uphill(ramp), 2.0 * APPROACH * _uphill(ramp)
    at_foot = Polygon([*(ramp.foot + onto), *(ramp.foot - off)[::-1]])
    at_head = Polygon([*(ramp.head - onto), *(ramp.head + off)[::-1]])
    return [
        lower.intersection(around).difference(at_head),
        upper.intersection(around).difference(at_foot),
    ]


def _links(space: FreeSpace, blocks: Sequence[Block], block_of: IntArray) -> IntArray:
    """(L, 2) cells beyond the ends of ramps, and the same places on the storeys there."""
    found = [np.empty((0, 2), dtype=np.int64)]
    shift_of = {block.storey: block.shift for block in blocks if block.ramp is None}
    for k, block in enumerate(blocks):
        if block.ramp is None:
            continue
        cells = np.flatnonzero(block_of == k)
        places = space.centres[cells] - [block.shift, 0.0]
        along = (places - block.ramp.foot.mean(axis=0)) @ _uphill(block.ramp)
        for beyond, storey in (
            (along < 0.0, block.storey),
            (along > block.ramp.run, block.storey + 1),
        ):
            columns = round((shift_of[storey] - block.shift) / space.cell)
            row, column = space.cells[cells[beyond]].T
            there = space.index[row, column + columns]
            pairs = np.column_stack([cells[beyond], there])
            found.append(pairs[there >= 0])
    return np.concatenate(found)
