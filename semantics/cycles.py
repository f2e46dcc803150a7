"""From the probabilities of edges to rooms as the paper does it (III-C, III-D): cycles of four
planes, then of two.

Nothing is enumerated that could grow without bound: of each piece only the most likely neighbours
are looked at, and four pieces are a cycle if two of them share the other two as neighbours.
"""

from __future__ import annotations

from itertools import combinations

import numpy as np

from semantics.clusters import ClusterConfig, Clusters, labelled
from semantics.pieces import Pieces
from slam.core import Array, IntArray

BRANCHES = 12
"""Most likely neighbours of a piece that cycles may run through."""


def cycles(count: int, pairs: IntArray, probability: Array, config: ClusterConfig) -> Clusters:
    """Sets of four pieces through which a cycle runs, then of two that are left.

    Sets with more cycles come first (three where all six edges are there), then the likelier ones;
    each piece is in one room at most.
    """
    likely = np.flatnonzero(probability > config.room)
    likely = likely[np.argsort(-probability[likely], kind="stable")]
    around: list[dict[int, float]] = [{} for _ in range(count)]
    for place in likely.tolist():
        i, j = pairs[place].tolist()
        if len(around[i]) < BRANCHES and len(around[j]) < BRANCHES:
            around[i][j] = around[j][i] = float(probability[place])
    label = np.full(count, -1, dtype=np.int64)
    taken = 0
    ranked = sorted((_rank(four, around), four) for four in _fours(around))
    twos = (tuple(sorted(pairs[place].tolist())) for place in likely.tolist())
    for members in [*(four for _, four in ranked), *twos]:
        if all(label[k] < 0 for k in members):
            label[list(members)] = taken
            taken += 1
    return labelled(label, pairs, probability)


def _fours(around: list[dict[int, float]]) -> set[tuple[int, ...]]:
    """Sets of four with at least one cycle: two pieces, and two neighbours that they share."""
    shared: dict[tuple[int, int], list[int]] = {}
    for middle, neighbours in enumerate(around):
        for a, b in combinations(sorted(neighbours), 2):
            shared.setdefault((a, b), []).append(middle)
    return {
        tuple(sorted((a, b, c, d)))
        for (a, b), both in shared.items()
        for c, d in combinations(both, 2)
    }


def _rank(four: tuple[int, ...], around: list[dict[int, float]]) -> tuple[int, float]:
    """Cycles through the four, the most first, then the sum of their probabilities."""
    a, b, c, d = four
    rings = [(a, b, c, d), (a, c, b, d), (a, b, d, c)]
    number = sum(all(ring[k] in around[ring[k - 1]] for k in range(4)) for ring in rings)
    total = sum(around[i].get(j, 0.0) for i, j in combinations(four, 2))
    return -number, -total


def has_opposed_sides(sides: Pieces, config: ClusterConfig) -> bool:
    """Two sides that face each other, or two such pairs across each other: what the paper's rooms
    of two and of four planes are."""
    normal, centre = sides.normal, sides.centre
    opposed = [
        (i, j)
        for i, j in combinations(range(len(sides)), 2)
        if normal[i] @ normal[j] < -0.9 and (centre[j] - centre[i]) @ normal[i] > 0.0
    ]
    return len(opposed) == len(sides) // 2


def mean_centre(sides: Pieces) -> Array:
    """(2,) the mean of the sides' centres (equation 4)."""
    return np.asarray(sides.centre.mean(axis=0))
