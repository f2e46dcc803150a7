"""The ways between a few places of a large grid, found in one search that starts at all of them."""

from __future__ import annotations

import itertools
from dataclasses import dataclass

import numpy as np
from scipy.sparse import coo_matrix, csr_matrix
from scipy.sparse.csgraph import dijkstra

from slam.core import Array, IntArray


@dataclass(frozen=True)
class Roadmap:
    """Places (P,), cells of a grid, and the cheapest ways between neighbouring ones.

    Two places are neighbours where the regions of cells nearest to them touch; ways between others
    lead through neighbours (Mehlhorn 1988). So the search costs the same for ten places and for a
    thousand. costs: (P, P) sparse, symmetric; bridges: (P, P) sparse, 1 + the edge in ``crossings``
    (E, 2), the two cells where a way goes from one region into the other; predecessors: (F,) each
    cell's next cell towards its own place.
    """

    places: IntArray
    costs: csr_matrix
    bridges: csr_matrix
    crossings: IntArray
    predecessors: IntArray

    def distances(self, sources: IntArray) -> tuple[Array, IntArray]:
        """Costs (S, P) from places to all places, and the place before each on the way."""
        cost, before = dijkstra(
            self.costs, directed=False, indices=sources, return_predecessors=True
        )
        return cost, before

    def way(self, source: int, before: IntArray, target: int) -> IntArray:
        """Cells from place to place; ``before`` (P,) is the source's row of ``distances``."""
        chain = [target]
        while chain[-1] != source:
            chain.append(int(before[chain[-1]]))
        chain.reverse()
        legs = [self._leg(a, b) for a, b in itertools.pairwise(chain)]
        return np.concatenate([self.places[[source]], *(leg[1:] for leg in legs)])

    def _leg(self, start: int, end: int) -> IntArray:
        """Cells between two neighbouring places."""
        bridge = int(self.bridges[min(start, end), max(start, end)]) - 1
        low, high = self.crossings[bridge]
        near, far = (low, high) if start < end else (high, low)
        return np.concatenate([self._home(int(near))[::-1], self._home(int(far))])

    def _home(self, cell: int) -> IntArray:
        """Cells from ``cell`` to its own place."""
        cells = [cell]
        while self.predecessors[cells[-1]] >= 0:
            cells.append(int(self.predecessors[cells[-1]]))
        return np.array(cells, dtype=np.int64)


def build_roadmap(graph: csr_matrix, places: IntArray) -> Roadmap:
    """The roadmap of distinct ``places`` on a grid; ``graph``: costs between cells, each once."""
    cost, predecessors, source = dijkstra(
        graph, directed=False, indices=places, min_only=True, return_predecessors=True
    )
    place_of = np.full(graph.shape[0], -1, dtype=np.int64)
    place_of[places] = np.arange(len(places))
    region = np.where(source >= 0, place_of[np.maximum(source, 0)], -1)
    edges = graph.tocoo()
    border = region[edges.row] != region[edges.col]
    border &= (region[edges.row] >= 0) & (region[edges.col] >= 0)
    a, b = edges.row[border].astype(np.int64), edges.col[border].astype(np.int64)
    swapped = region[a] > region[b]
    a, b = np.where(swapped, b, a), np.where(swapped, a, b)
    through = cost[a] + edges.data[border] + cost[b]
    best = _cheapest_per_pair(region[a], region[b], through)
    size = (len(places), len(places))
    pair = (region[a[best]], region[b[best]])
    costs = coo_matrix((through[best], pair), shape=size).tocsr()
    bridges = coo_matrix((np.arange(len(best)) + 1, pair), shape=size).tocsr()
    crossings = np.stack([a[best], b[best]], axis=1)
    return Roadmap(places, (costs + costs.T).tocsr(), bridges, crossings, predecessors)


def _cheapest_per_pair(a: IntArray, b: IntArray, cost: Array) -> IntArray:
    """For every pair (a, b) the place of its cheapest entry."""
    order = np.lexsort((cost, b, a))
    first = np.ones(len(order), dtype=bool)
    first[1:] = (np.diff(a[order]) != 0) | (np.diff(b[order]) != 0)
    return order[first]
