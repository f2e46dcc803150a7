"""The proximity graph over plane pieces, and the features of its nodes and edges (paper, III-A)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np

from semantics.lines import crossings, row_dots, turn
from semantics.neighbours import Gaps, closest_centres, closest_segments
from semantics.pieces import Pieces
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
    """Which pieces are joined, and what a network is told of pieces and of pairs of them."""

    node_size: int
    edge_size: int

    def pairs(self, pieces: Pieces, neighbours: int) -> Gaps:
        """Each piece with so many of its closest ones."""
        ...

    def nodes(self, pieces: Pieces) -> Array:
        """(N, node_size)"""
        ...

    def edges(self, pieces: Pieces, i: IntArray, j: IntArray, gap: Array) -> Array:
        """(2 P, edge_size) of j as seen from i, then of i as seen from j; gap: (P,) their distance
        [m]."""
        ...


class PaperFeatures:
    """The paper's: nodes [n, w], edges [relative position of the centres, closest distance of the
    extremes], closest by their centres.

    In the map's axes, scaled by fixed limits: so it has to learn that headings do not matter.
    """

    node_size = 3
    edge_size = 3
    limit = 6.0

    def pairs(self, pieces: Pieces, neighbours: int) -> Gaps:
        """By the distance of the centres; the distance given is that of the extremes."""
        i, j = closest_centres(pieces, neighbours)
        ends_i, ends_j = pieces.segment[i], pieces.segment[j]
        apart = np.linalg.norm(ends_i[:, :, None, :] - ends_j[:, None, :, :], axis=3)
        return i, j, apart.min(axis=(1, 2))

    def nodes(self, pieces: Pieces) -> Array:
        """(N, 3) normal and width."""
        return np.column_stack([pieces.normal, pieces.length / self.limit])

    def edges(self, pieces: Pieces, i: IntArray, j: IntArray, gap: Array) -> Array:
        """(2 P, 3) offset of the centres and gap."""
        away = pieces.centre[j] - pieces.centre[i]
        return np.column_stack([np.concatenate([away, -away]), np.tile(gap, 2)]) / self.limit


class InvariantFeatures:
    """Ours: everything in the frame of the piece that looks, so no motion of the map changes it.

    x runs along the piece, y along its normal, into the room it bounds. Lengths enter by their
    logarithm: rooms come in all sizes. How high a piece was seen depends on where the robot stood:
    what tells a cupboard from a wall is how high those around it were seen.
    """

    node_size = 2
    edge_size = 16

    def pairs(self, pieces: Pieces, neighbours: int) -> Gaps:
        """By the distance of the segments, the long ones first: what stands about in a room does
        not come between its walls."""
        return closest_segments(pieces, neighbours)

    def nodes(self, pieces: Pieces) -> Array:
        """(N, 2) length and height."""
        return np.column_stack([np.log(pieces.length + 0.1), np.diff(pieces.height)])

    def edges(self, pieces: Pieces, i: IntArray, j: IntArray, gap: Array) -> Array:
        """(2 P, 16), see the lines below."""
        log_length = np.log(pieces.length + 0.1)
        here, there = np.concatenate([i, j]), np.concatenate([j, i])
        each = np.column_stack([pieces.normal, pieces.length, log_length, pieces.height]).T.copy()
        mine, other = each.take(here, axis=1), each.take(there, axis=1)
        away = (pieces.centre.take(j, axis=0) - pieces.centre.take(i, axis=0)).T
        away = np.concatenate([away, -away], axis=1)
        cosine, sine = mine[0] * other[0] + mine[1] * other[1], _cross(mine, other)
        x, y, half = _cross(mine, away), mine[0] * away[0] + mine[1] * away[1], 0.5 * mine[2]
        wide, deep = 0.5 * other[2] * np.abs(cosine), 0.5 * other[2] * np.abs(sine)
        common = np.minimum(x + wide, half) - np.maximum(x - wide, -half)
        metres = [x, y, y - deep, y + deep, x - wide - half, x + wide + half, common]
        squashed = _squashed(np.stack(metres))
        log_gap, blocked, ahead = np.log(gap + 0.05), _blocked(pieces, i, j), squashed[1]
        told = [
            cosine,
            sine,
            *squashed,
            np.clip(common / np.maximum(np.minimum(half, wide) * 2.0, 0.1), -1.0, 1.0),
            np.concatenate([log_gap, log_gap]),
            np.concatenate([ahead[len(i) :], ahead[: len(i)]]),  # of this one from the other one
            *(other[3:] - mine[3:]),
            np.concatenate([blocked, blocked]),
        ]
        return np.stack(told, axis=1)


def _cross(a: Array, b: Array) -> Array:
    """(E,) of rows x and y."""
    return a[0] * b[1] - a[1] * b[0]


def _squashed(metres: Array) -> Array:
    """Logarithms that are lengths near 0, and have a sign."""
    return np.sign(metres) * np.log1p(np.abs(metres))


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
    edge = features.edges(pieces, i, j, gap)
    source, target = np.concatenate([i, j]), np.concatenate([j, i])
    return ProximityGraph(features.nodes(pieces), source, target, edge)


def _blocked(pieces: Pieces, i: IntArray, j: IntArray) -> Array:
    """(E,) 1 where a third piece stands between the middles of two that face each other, or a
    barrier between any two.

    Looked at from a hand's breadth in front of each, so that neither hides itself. Where one lies
    behind the other, which the other features say, nobody looks for pieces.
    """
    eye = pieces.centre + 0.1 * pieces.normal
    start, end = eye.take(i, axis=0), eye.take(j, axis=0)
    away, mine, others = end - start, pieces.normal.take(i, axis=0), pieces.normal.take(j, axis=0)
    asked = np.flatnonzero((row_dots(away, mine) > 0.0) & (row_dots(away, others) < 0.0))
    sight = np.concatenate([start, end], axis=1).take(asked, axis=0).reshape(-1, 2, 2)
    line, third = crossings(sight, pieces.segment)
    line = asked.take(line)
    other = (third != i.take(line)) & (third != j.take(line))
    blocked = np.zeros(len(i))
    blocked[line[other]] = 1.0
    for start, end in pieces.barrier:
        apart = turn(eye[i], eye[j], start[None]) * turn(eye[i], eye[j], end[None]) < 0.0
        sides = turn(start[None], end[None], eye)
        blocked[apart & (sides[i] * sides[j] < 0.0)] = 1.0
    return blocked
