"""The proximity graph over plane pieces, and the features of its nodes and edges (paper, III-A)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np
import shapely
from numpy.typing import NDArray

from semantics.preprocess import Pieces, near_pairs, row_dots
from slam.core import Array, InputError, IntArray

NEIGHBOURS = 15
"""Closest neighbours that a piece is joined with (paper, IV)."""
REACH = 5.0
"""How far around a piece its neighbours are looked for at first [m], and"""
REACH_SHARE = 1.4
"""in lengths of a long one: few rooms are longer for their width."""
SHORT = 0.5
"""Pieces much shorter than this all count alike as neighbours [m]."""
TOUCH = 0.2
"""Pieces much nearer than this all count alike as neighbours [m]."""
FAR = 1e5
"""Beyond this, everything is as near as anything [m]."""


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


Pairs = tuple[IntArray, IntArray, Array]
"""Places i < j of the two pieces of each pair, and their distance [m]."""


class FeatureSet(Protocol):
    """Which pieces are joined, and what a network is told of pieces and of pairs of them."""

    node_size: int
    edge_size: int

    def pairs(self, pieces: Pieces, neighbours: int) -> Pairs:
        """Each piece with so many of its closest ones."""
        ...

    def nodes(self, pieces: Pieces) -> Array:
        """(N, node_size)"""
        ...

    def edges(self, pieces: Pieces, i: IntArray, j: IntArray, gap: Array) -> Array:
        """(E, edge_size) of j as seen from i; gap: (E,) distance of the two [m]."""
        ...


class PaperFeatures:
    """The paper's: nodes [n, w], edges [relative position of the centres, closest distance of the
    extremes], closest by their centres.

    In the map's axes, scaled by fixed limits: so it has to learn that headings do not matter.
    """

    node_size = 3
    edge_size = 3
    limit = 6.0

    def pairs(self, pieces: Pieces, neighbours: int) -> Pairs:
        """By the distance of the centres; the distance given is that of the extremes."""
        i, j = closest_centres(pieces, neighbours)
        ends_i, ends_j = pieces.segment[i], pieces.segment[j]
        apart = np.linalg.norm(ends_i[:, :, None, :] - ends_j[:, None, :, :], axis=3)
        return i, j, apart.min(axis=(1, 2))

    def nodes(self, pieces: Pieces) -> Array:
        """(N, 3) normal and width."""
        return np.column_stack([pieces.normal, pieces.length / self.limit])

    def edges(self, pieces: Pieces, i: IntArray, j: IntArray, gap: Array) -> Array:
        """(E, 3) offset of the centres and gap."""
        return np.column_stack([pieces.centre[j] - pieces.centre[i], gap]) / self.limit


class InvariantFeatures:
    """Ours: everything in the frame of the piece that looks, so no motion of the map changes it.

    x runs along the piece, y along its normal, into the room it bounds. Lengths enter by their
    logarithm: rooms come in all sizes. How high a piece was seen depends on where the robot stood:
    what tells a cupboard from a wall is how high those around it were seen.
    """

    node_size = 2
    edge_size = 16

    def pairs(self, pieces: Pieces, neighbours: int) -> Pairs:
        """By the distance of the segments, the long ones first: what stands about in a room does
        not come between its walls."""
        return closest_segments(pieces, neighbours)

    def nodes(self, pieces: Pieces) -> Array:
        """(N, 2) length and height."""
        return np.column_stack([np.log(pieces.length + 0.1), np.diff(pieces.height)])

    def edges(self, pieces: Pieces, i: IntArray, j: IntArray, gap: Array) -> Array:
        """(E, 16), see the lines below; both directions of every pair, as in the graph."""
        n_i, n_j, centre = pieces.normal[i], pieces.normal[j], pieces.centre
        away = centre[j] - centre[i]
        lengths, half = pieces.length, 0.5 * pieces.length[i]
        cosine = row_dots(n_i, n_j)
        sine = n_i[:, 0] * n_j[:, 1] - n_i[:, 1] * n_j[:, 0]
        x, y = n_i[:, 0] * away[:, 1] - n_i[:, 1] * away[:, 0], row_dots(n_i, away)
        wide, deep = 0.5 * lengths[j] * np.abs(cosine), 0.5 * lengths[j] * np.abs(sine)
        common = np.minimum(x + wide, half) - np.maximum(x - wide, -half)
        metres = np.column_stack(
            [
                x,
                y,
                y - deep,
                y + deep,
                x - wide - half,
                x + wide + half,
                common,
                -row_dots(n_j, away),
            ]
        )
        squashed = np.sign(metres) * np.log1p(np.abs(metres))
        return np.column_stack(
            [
                cosine,
                sine,
                squashed[:, :7],
                np.clip(common / np.maximum(np.minimum(half, wide) * 2.0, 0.1), -1.0, 1.0),
                np.log(gap + 0.05),
                squashed[:, 7],
                np.log(lengths + 0.1)[j] - np.log(lengths + 0.1)[i],
                pieces.height[j] - pieces.height[i],
                np.tile(_blocked(pieces, i[: len(i) // 2], j[: len(i) // 2]), 2),
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
    """Each piece joined with its closest ones, both ways."""
    i, j, gap = features.pairs(pieces, neighbours)
    source, target = np.concatenate([i, j]), np.concatenate([j, i])
    return ProximityGraph(
        features.nodes(pieces),
        source,
        target,
        features.edges(pieces, source, target, np.concatenate([gap, gap])),
    )


def closest_centres(pieces: Pieces, neighbours: int) -> tuple[IntArray, IntArray]:
    """Pairs i < j where either's centre is among the closest to the other's."""
    from scipy.spatial import cKDTree

    count = len(pieces)
    wanted = min(neighbours, count - 1)
    if wanted < 1:
        return np.zeros(0, dtype=np.int64), np.zeros(0, dtype=np.int64)
    _, found = cKDTree(pieces.centre).query(pieces.centre, k=wanted + 1)
    i, j = np.repeat(np.arange(count), wanted + 1), found.ravel().astype(np.int64)
    pairs = np.unique((np.minimum(i, j) * count + np.maximum(i, j))[i != j])
    return pairs // count, pairs % count


def closest_segments(pieces: Pieces, neighbours: int) -> Pairs:
    """Pairs i < j where either is among the other's closest, and their gaps [m].

    Closest by the gap in lengths of the other. Looks around each piece, and further only around
    those that have too few within reach.
    """
    count, length = len(pieces), pieces.length
    wanted = min(neighbours, count - 1)
    reach = 0.5 * np.maximum(REACH, REACH_SHARE * length)
    lonely = np.arange(count if wanted > 0 else 0)
    found: list[Pairs] = []
    while len(lonely):
        i, j = near_pairs(pieces, reach, lonely)
        gap = segment_gap(pieces.segment[i], pieces.segment[j])
        near = (gap <= reach[i] + reach[j]) | (reach[i] > FAR)
        i, j, gap = i[near], j[near], gap[near]
        found.append((np.minimum(i, j), np.maximum(i, j), gap))
        number = np.bincount(i, minlength=count)
        lonely = lonely[number[lonely] < wanted]
        reach = 2.0 * reach
    i, j, gap = _once(found, count)
    keep = _nearest(i, j, gap, length, neighbours)
    return i[keep], j[keep], gap[keep]


def _once(found: list[Pairs], count: int) -> Pairs:
    """All pairs that were found, in order, none twice."""
    if not found:
        return np.zeros(0, dtype=np.int64), np.zeros(0, dtype=np.int64), np.zeros(0)
    i, j, gap = (np.concatenate(column) for column in zip(*found, strict=True))
    _, first = np.unique(i * count + j, return_index=True)
    return i[first], j[first], gap[first]


def _nearest(
    i: IntArray, j: IntArray, gap: Array, length: Array, neighbours: int
) -> NDArray[np.bool_]:
    """Which pairs are among the ``neighbours`` closest of either of the two."""
    ends, others = np.concatenate([i, j]), np.concatenate([j, i])
    pair = np.tile(np.arange(len(i)), 2)
    order = np.lexsort(((np.tile(gap, 2) + TOUCH) / (length[others] + SHORT), ends))
    first = np.searchsorted(ends[order], np.arange(len(length)))
    rank = np.arange(len(ends)) - first[ends[order]]
    keep = np.zeros(len(i), dtype=bool)
    keep[pair[order[rank < neighbours]]] = True
    return keep


def segment_gap(a: Array, b: Array) -> Array:
    """(E,) shortest distance between segments a and b (E, 2, 2); 0 where they cross."""
    p, q, r, s = a[:, 0], a[:, 1], b[:, 0], b[:, 1]
    square = _point_gap2(p, r, s)
    for point, start, end in ((q, r, s), (r, p, q), (s, p, q)):
        np.minimum(square, _point_gap2(point, start, end), out=square)
    cross = (_turn(p, q, r) * _turn(p, q, s) < 0) & (_turn(r, s, p) * _turn(r, s, q) < 0)
    return np.where(cross, 0.0, np.sqrt(square))


def _point_gap2(point: Array, start: Array, end: Array) -> Array:
    """(E,) squared distance of points (E, 2) to segments."""
    run_x, run_y = end[:, 0] - start[:, 0], end[:, 1] - start[:, 1]
    x, y = point[:, 0] - start[:, 0], point[:, 1] - start[:, 1]
    length2 = np.maximum(run_x * run_x + run_y * run_y, 1e-12)
    at = np.minimum(np.maximum((x * run_x + y * run_y) / length2, 0.0), 1.0)
    off_x, off_y = x - at * run_x, y - at * run_y
    return off_x * off_x + off_y * off_y


def _blocked(pieces: Pieces, i: IntArray, j: IntArray) -> Array:
    """(E,) 1 where a third piece stands between the middles of two that face each other, or a
    barrier between any two.

    Looked at from a hand's breadth in front of each, so that neither hides itself. Where one lies
    behind the other, which the other features say, nobody looks for pieces.
    """
    eye = pieces.centre + 0.1 * pieces.normal
    away = eye[j] - eye[i]
    ahead = (row_dots(away, pieces.normal[i]) > 0.0) & (row_dots(away, pieces.normal[j]) < 0.0)
    asked = np.flatnonzero(ahead)
    sight = shapely.linestrings(np.stack([eye[i[asked]], eye[j[asked]]], axis=1))
    tree = shapely.STRtree(shapely.linestrings(pieces.segment))
    line, third = tree.query(sight, predicate="intersects")
    other = (third != i[asked[line]]) & (third != j[asked[line]])
    blocked = np.zeros(len(i))
    blocked[asked[line[other]]] = 1.0
    for start, end in pieces.barrier:
        apart = _turn(eye[i], eye[j], start[None]) * _turn(eye[i], eye[j], end[None]) < 0.0
        sides = _turn(start[None], end[None], eye)
        blocked[apart & (sides[i] * sides[j] < 0.0)] = 1.0
    return blocked


def _turn(a: Array, b: Array, c: Array) -> Array:
    """(E,) positive where c lies to the left of the way from a to b."""
    return (b[:, 0] - a[:, 0]) * (c[:, 1] - a[:, 1]) - (b[:, 1] - a[:, 1]) * (c[:, 0] - a[:, 0])
