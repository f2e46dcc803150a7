"""The proximity graph over plane pieces, and the features of its nodes and edges (paper, III-A)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from semantics.preprocess import Pieces
from slam.core import Array, InputError, IntArray

NEIGHBOURS = 15
"""Closest neighbours that a piece is joined with (paper, IV)."""


@dataclass(frozen=True)
class ProximityGraph:
    """node: (N, F) features; edges both ways, the first E/2 from i to j, the others back.

    source, target: (E,); edge: (E, G) features, of the target as seen from the source. ``pairs`` is
    the undirected half.
    """

    node: Array
    source: IntArray
    target: IntArray
    edge: Array

    @property
    def pairs(self) -> IntArray:
        """(E/2, 2) i < j."""
        half = len(self.source) // 2
        return np.column_stack([self.source[:half], self.target[:half]])


class FeatureSet(Protocol):
    """What a network is told of pieces and of pairs of them."""

    node_size: int
    edge_size: int

    def nodes(self, pieces: Pieces) -> Array:
        """(N, node_size)"""
        ...

    def edges(self, pieces: Pieces, i: IntArray, j: IntArray, gap: Array) -> Array:
        """(E, edge_size) of j as seen from i; gap: (E,) shortest distance of the two [m]."""
        ...


class PaperFeatures:
    """The paper's: nodes [n, w], edges [relative position of the centres, closest distance].

    In the map's axes, scaled by fixed limits: so it has to learn that headings do not matter.
    """

    node_size = 3
    edge_size = 3
    limit = 6.0

    def nodes(self, pieces: Pieces) -> Array:
        """(N, 3) normal and width."""
        return np.column_stack([pieces.normal, pieces.length / self.limit])

    def edges(self, pieces: Pieces, i: IntArray, j: IntArray, gap: Array) -> Array:
        """(E, 3) offset of the centres and gap."""
        return np.column_stack([pieces.centre[j] - pieces.centre[i], gap]) / self.limit


class InvariantFeatures:
    """Ours: everything in the frame of the piece that looks, so no motion of the map changes it.

    x runs along the piece, y along its normal, into the room it bounds. Lengths enter by their
    logarithm: rooms come in all sizes.
    """

    node_size = 1
    edge_size = 14

    def nodes(self, pieces: Pieces) -> Array:
        """(N, 1) length. What is seen of the height depends on where one stands."""
        return np.log(pieces.length + 0.1)[:, None]

    def edges(self, pieces: Pieces, i: IntArray, j: IntArray, gap: Array) -> Array:
        """(E, 14), see the lines below."""
        axis = np.column_stack([-pieces.normal[:, 1], pieces.normal[:, 0]])
        away = pieces.segment[j] - pieces.centre[i][:, None, :]
        x = np.einsum("ekc,ec->ek", away, axis[i])
        y = np.einsum("ekc,ec->ek", away, pieces.normal[i])
        half = 0.5 * pieces.length[i]
        low, high = x.min(axis=1), x.max(axis=1)
        common = np.minimum(high, half) - np.maximum(low, -half)
        towards = pieces.centre[i] - pieces.centre[j]
        looks_back = np.einsum("ec,ec->e", towards, pieces.normal[j])
        return np.column_stack(
            [
                np.einsum("ec,ec->e", pieces.normal[i], pieces.normal[j]),
                np.einsum("ec,ec->e", axis[i], pieces.normal[j]),
                _squash(0.5 * (low + high)),
                _squash(0.5 * (y[:, 0] + y[:, 1])),
                _squash(y.min(axis=1)),
                _squash(y.max(axis=1)),
                _squash(low - half),
                _squash(high + half),
                _squash(common),
                np.clip(common / np.maximum(np.minimum(2.0 * half, high - low), 0.1), -1.0, 1.0),
                np.log(gap + 0.05),
                _squash(looks_back),
                np.log(pieces.length[j] + 0.1) - np.log(pieces.length[i] + 0.1),
                _blocked(pieces, i, j),
            ]
        )


FEATURES: dict[str, FeatureSet] = {"invariant": InvariantFeatures(), "paper": PaperFeatures()}


def features_named(name: str) -> FeatureSet:
    """A feature set. Raises InputError."""
    if name not in FEATURES:
        raise InputError(f"features: {name!r} is unknown, expected one of {', '.join(FEATURES)}")
    return FEATURES[name]


def proximity_graph(
    pieces: Pieces, features: FeatureSet, neighbours: int = NEIGHBOURS
) -> ProximityGraph:
    """Each piece joined with its closest ones, by the distance of the segments, both ways."""
    i, j, gap = closest_pairs(pieces, neighbours)
    source, target = np.concatenate([i, j]), np.concatenate([j, i])
    return ProximityGraph(
        features.nodes(pieces),
        source,
        target,
        features.edges(pieces, source, target, np.concatenate([gap, gap])),
    )


def closest_pairs(pieces: Pieces, neighbours: int) -> tuple[IntArray, IntArray, Array]:
    """Pairs i < j where either is among the other's closest, and their gaps [m]."""
    count = len(pieces)
    if count < 2:
        empty = np.zeros(0, dtype=np.int64)
        return empty, empty, np.zeros(0)
    i, j = _candidates(pieces, neighbours)
    gap = segment_gap(pieces.segment[i], pieces.segment[j])
    keep = _nearest(i, j, gap, count, neighbours)
    return i[keep], j[keep], gap[keep]


def _candidates(pieces: Pieces, neighbours: int) -> tuple[IntArray, IntArray]:
    """Pairs i < j worth a closer look: all of them, or in a large map those with near samples."""
    count = len(pieces)
    if count <= 160:
        i, j = np.triu_indices(count, 1)
        return i, j
    from scipy.spatial import cKDTree

    samples, owner = _samples(pieces, 1.5)
    tree = cKDTree(samples)
    _, found = tree.query(samples, k=min(len(samples), 6 * neighbours))
    i, j = np.repeat(owner, found.shape[1]), owner[found.ravel()]
    pairs = np.unique(np.minimum(i, j)[i != j] * count + np.maximum(i, j)[i != j])
    return pairs // count, pairs % count


def _samples(pieces: Pieces, spacing: float) -> tuple[Array, IntArray]:
    """Points (S, 2) along the pieces, and whose they are."""
    number = np.maximum(2, np.ceil(pieces.length / spacing).astype(np.int64) + 1)
    owner = np.repeat(np.arange(len(pieces)), number)
    first = np.cumsum(number) - number
    fraction = (np.arange(len(owner)) - first[owner]) / (number[owner] - 1)
    start, end = pieces.segment[owner, 0], pieces.segment[owner, 1]
    return start + fraction[:, None] * (end - start), owner


def _nearest(
    i: IntArray, j: IntArray, gap: Array, count: int, neighbours: int
) -> NDArray[np.bool_]:
    """Which pairs are among the ``neighbours`` smallest gaps of either of the two."""
    ends = np.concatenate([i, j])
    pair = np.tile(np.arange(len(i)), 2)
    order = np.lexsort((np.tile(gap, 2), ends))
    first = np.searchsorted(ends[order], np.arange(count))
    rank = np.arange(len(ends)) - first[ends[order]]
    keep = np.zeros(len(i), dtype=bool)
    keep[pair[order[rank < neighbours]]] = True
    return keep


def segment_gap(a: Array, b: Array) -> Array:
    """(E,) shortest distance between segments a and b (E, 2, 2); 0 where they cross."""
    ends = [
        _point_gap(a[:, 0], b),
        _point_gap(a[:, 1], b),
        _point_gap(b[:, 0], a),
        _point_gap(b[:, 1], a),
    ]
    return np.where(_cross(a, b), 0.0, np.min(ends, axis=0))


def _point_gap(points: Array, segments: Array) -> Array:
    run = segments[:, 1] - segments[:, 0]
    away = points - segments[:, 0]
    length2 = np.maximum(np.einsum("ec,ec->e", run, run), 1e-12)
    at = np.clip(np.einsum("ec,ec->e", away, run) / length2, 0.0, 1.0)
    return np.linalg.norm(away - at[:, None] * run, axis=1)


def _cross(a: Array, b: Array) -> NDArray[np.bool_]:
    """(E,) do the segments properly cross?"""
    return (_side(a, b[:, 0]) * _side(a, b[:, 1]) < 0) & (_side(b, a[:, 0]) * _side(b, a[:, 1]) < 0)


def _side(segments: Array, points: Array) -> Array:
    run = segments[:, 1] - segments[:, 0]
    away = points - segments[:, 0]
    return run[:, 0] * away[:, 1] - run[:, 1] * away[:, 0]


def _squash(metres: Array) -> Array:
    """Lengths of any sign, the long ones compressed."""
    return np.sign(metres) * np.log1p(np.abs(metres))


def _blocked(pieces: Pieces, i: IntArray, j: IntArray) -> Array:
    """(E,) 1 where a third piece, one of i's neighbours, stands between the two pieces' middles.

    Looked at from a hand's breadth in front of each, so that neither hides itself.
    """
    count = len(pieces)
    order = np.argsort(i, kind="stable")
    bounds = np.searchsorted(i[order], np.arange(count + 1))
    eye = pieces.centre + 0.1 * pieces.normal
    sight = np.stack([eye[i], eye[j]], axis=1)
    most = int(np.diff(bounds).max(initial=0))
    blocked = np.zeros(len(i), dtype=bool)
    for k in range(most):
        place = bounds[i] + k
        valid = place < bounds[i + 1]
        third = np.where(valid, j[order[np.minimum(place, len(order) - 1)]], j)
        blocked |= valid & (third != j) & _cross(sight, pieces.segment[third])
    return blocked.astype(np.float64)
