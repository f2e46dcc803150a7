"""Places: a sparse graph of free space, made from its Voronoi diagram by compression."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from semantics.freespace.gvd import Gvd, Ints
from semantics.freespace.tsdf import Volume
from slam.core import Array


@dataclass(frozen=True)
class PlacesConfig:
    """From the diagram to a sparse graph of places (uhumans2).

    compression: side of the cells that become one place [m]; min_node, min_edge: least clearance
    [m]; merge: places this close become one [m], the wider of them, or with ``merge_by_basis`` the
    one with more basis points; by_clearance: of two voxels with equal numbers of basis points the
    wider stands for a place (else the narrower, as Hydra's discovery order has it); least: smaller
    groups of connected places are dropped.
    """

    compression: float = 1.5
    min_node: float = 0.4
    min_edge: float = 0.25
    merge: float = 0.7
    merge_by_basis: bool = False
    by_clearance: bool = False
    least: int = 3


@dataclass(frozen=True)
class Places:
    """positions: (N, 3) map frame [m]; clearance: (N,) [m]; edges: (E, 2) places; widths: (E,)
    the least clearance along each edge [m]."""

    positions: Array
    clearance: Array
    edges: Ints
    widths: Array

    def __len__(self) -> int:
        return len(self.positions)


def places_of(gvd: Gvd, volume: Volume, config: PlacesConfig) -> Places:
    """Connected voxels of the diagram inside one cell are one place; touching ones are joined."""
    kept = np.flatnonzero(gvd.clearance >= config.min_node)
    new_place = np.full(len(gvd.voxels), -1, np.int64)
    new_place[kept] = np.arange(len(kept))
    pairs = new_place[gvd.pairs]
    pairs = pairs[(pairs >= 0).all(axis=1)]
    voxels, clearance = gvd.voxels[kept], gvd.clearance[kept]
    group = _groups(volume.low + voxels * volume.voxel, pairs, config)
    chosen = _representatives(group, gvd.basis[kept], clearance, config)
    edges = _touching(group, pairs)
    nodes = voxels[chosen]
    widths = _least_clearance(nodes, clearance[chosen], edges, gvd.distance)
    wide = widths >= config.min_edge
    merged = _Merging(
        volume.low + nodes * volume.voxel,
        clearance[chosen],
        gvd.basis[kept][chosen],
        edges[wide],
        widths[wide],
        config,
    )
    return _without_small_groups(merged.places(), config.least)


def _groups(positions: Array, pairs: Ints, config: PlacesConfig) -> Ints:
    """(N,) the place that each voxel belongs to."""
    cell = np.rint(positions / config.compression).astype(np.int64)
    within = pairs[(cell[pairs[:, 0]] == cell[pairs[:, 1]]).all(axis=1)]
    return components(len(positions), within)


def components(n: int, pairs: Ints) -> Ints:
    """(n,) the connected component of each node, counted from 0."""
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components

    if n == 0:
        return np.zeros(0, np.int64)
    ones = np.ones(len(pairs), np.int8)
    graph = coo_array((ones, (pairs[:, 0], pairs[:, 1])), shape=(n, n))
    return np.asarray(connected_components(graph, directed=False)[1], np.int64)


def _representatives(group: Ints, basis: Ints, clearance: Array, config: PlacesConfig) -> Ints:
    """The voxel that stands for each group: most basis points, ties by clearance."""
    tie = -clearance if config.by_clearance else clearance
    order = np.lexsort((np.arange(len(group)), tie, -basis, group))
    _, first = np.unique(group[order], return_index=True)
    return order[first]


def _touching(group: Ints, pairs: Ints) -> Ints:
    """(E, 2) groups that have neighbouring voxels."""
    across = np.sort(group[pairs], axis=1)
    across = across[across[:, 0] != across[:, 1]]
    count = int(group.max(initial=0)) + 1
    return np.column_stack(np.divmod(np.unique(across[:, 0] * count + across[:, 1]), count))


def _least_clearance(
    nodes: Ints, clearance: Array, edges: Ints, distance: NDArray[np.float32]
) -> Array:
    """(E,) the least clearance at both ends and on the straight line between; unseen is ignored."""
    if not len(edges):
        return np.zeros(0)
    ends = clearance[edges].min(axis=1)
    start, run = nodes[edges[:, 0]], nodes[edges[:, 1]] - nodes[edges[:, 0]]
    steps = int(np.abs(run).max())
    along = np.full(len(edges), np.inf)
    for step in range(1, steps):
        share = np.minimum(step / np.maximum(np.abs(run).max(axis=1), 1), 1.0)
        at = np.rint(start + share[:, None] * run).astype(np.int64)
        along = np.fmin(along, distance[tuple(at.T)])
    return np.minimum(ends, along)


class _Merging:
    """Joined places closer than ``merge`` become the better one of the two."""

    def __init__(
        self,
        positions: Array,
        clearance: Array,
        basis: Ints,
        edges: Ints,
        widths: Array,
        config: PlacesConfig,
    ) -> None:
        self._positions, self._clearance = positions, clearance
        self._edges, self._widths = edges, widths
        self._target = np.arange(len(positions))
        quality = basis if config.merge_by_basis else clearance
        length = np.linalg.norm(positions[edges[:, 0]] - positions[edges[:, 1]], axis=1)
        for a, b in edges[length <= config.merge]:
            better, worse = (a, b) if quality[a] >= quality[b] else (b, a)
            ends = self._last(better), self._last(worse)
            self._target[ends[1]] = ends[0]

    def _last(self, place: int) -> int:
        while self._target[place] != place:
            place = self._target[place]
        return int(place)

    def places(self) -> Places:
        """The remaining places; of edges that became one the wider stays."""
        last = np.array([self._last(k) for k in range(len(self._target))], np.int64)
        remaining, new_place = np.unique(last, return_inverse=True)
        edges = np.sort(new_place[self._edges], axis=1)
        order = np.argsort(-self._widths, kind="stable")
        order = order[edges[order, 0] != edges[order, 1]]
        unique, first = np.unique(edges[order], axis=0, return_index=True)
        widths = self._widths[order][first]
        return Places(self._positions[remaining], self._clearance[remaining], unique, widths)


def _without_small_groups(places: Places, least: int) -> Places:
    group = components(len(places), places.edges)
    size = np.bincount(group, minlength=1)
    kept = np.flatnonzero(size[group] >= least) if len(group) else np.zeros(0, np.int64)
    new_place = np.full(len(places), -1, np.int64)
    new_place[kept] = np.arange(len(kept))
    edges = new_place[places.edges]
    whole = (edges >= 0).all(axis=1)
    return Places(
        places.positions[kept], places.clearance[kept], edges[whole], places.widths[whole]
    )
