"""The edges of the proximity graph with what the networks say of them, kept where nothing moved."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from semantics.forward import Forward
from semantics.names import names_of, places_of
from semantics.near import boxes, touching
from semantics.pieces import Pieces
from semantics.proximity import features_named, proximity_graph
from slam.core import Array, InputError, IntArray

FARTHEST = 30.0
"""Answers about pairs that are further apart are dropped [m]. Where there is little near a piece,
its closest ones are in the next building, and hardly any pair of a training set is so far apart."""


@dataclass(frozen=True)
class Edges:
    """pairs: (P, 2) places of pieces, i < j; room, wall: (P,) calibrated probabilities that they
    share a room, and that they are the two faces of a wall."""

    pairs: IntArray
    room: Array
    wall: Array

    def take(self, places: IntArray | NDArray[np.bool_]) -> Edges:
        """Some of them."""
        return Edges(self.pairs[places], self.room[places], self.wall[places])


class EdgeModel:
    """The networks that together tell both relations, with their features and calibration."""

    def __init__(self, weights: Sequence[Path]):
        self._networks = [_loaded(path) for path in weights]
        known = [r for network in self._networks for r in network.config.relations]
        if sorted(known) != ["same_room", "same_wall"]:
            raise InputError(f"{weights[0]}: expected same_room and same_wall, got {known}")
        config = self._networks[0].config
        self._features, self._neighbours = features_named(config.features), config.neighbours
        if any(network.config.features != config.features for network in self._networks):
            raise InputError(f"{weights[-1]}: expected the features {config.features!r}")

    def __call__(self, pieces: Pieces) -> Edges:
        """All edges of the graph over these pieces."""
        graph = proximity_graph(pieces, self._features, self._neighbours)
        told: dict[str, Array] = {}
        for network in self._networks:
            told.update(zip(network.config.relations, network(graph).T, strict=True))
        edges = Edges(graph.pairs, told["same_room"], told["same_wall"])
        return edges.take(_apart(pieces, graph.pairs) < FARTHEST)


def _apart(pieces: Pieces, pairs: IntArray) -> Array:
    """(P,) at least so far are the two pieces of each pair apart [m]."""
    i, j = pairs.T
    centre, half = pieces.centre, 0.5 * pieces.length
    away = centre.take(j, axis=0) - centre.take(i, axis=0)
    return np.asarray(np.hypot(*away.T) - half.take(i) - half.take(j))


@cache
def _loaded(path: Path) -> Forward:
    """Reading weights takes longer than an inference; they are the same for every run."""
    return Forward.load(path)


@dataclass(frozen=True)
class LocalConfig:
    """still: a piece whose ends moved less than this [m] has not changed, if its heights did not
    by more than risen [m]; reach: how far from a change edges are worked out again, and how far
    from those the network is let look [m]; most: share of all pieces that it may be let look at;
    where it would be more, all are done at once."""

    still: float = 0.05
    risen: float = 0.15
    reach: float = 6.0
    most: float = 0.6


class LocalEdges:
    """Works out the edges around what has changed since the last call, and keeps the others.

    The networks look two hops far, which is what ``reach`` is for; what lies further away cannot
    tell the difference, so a keyframe in a large building costs what its surroundings cost.
    """

    def __init__(self, model: EdgeModel, config: LocalConfig = LocalConfig()):
        self._model = model
        self._config = config
        self._pieces: Pieces | None = None
        self._key = np.zeros(0, dtype=np.int64)
        self._edges = Edges(np.zeros((0, 2), np.int64), np.zeros(0), np.zeros(0))

    def __call__(self, pieces: Pieces) -> Edges:
        """All edges over these pieces."""
        key = names_of(pieces)
        before = places_of(self._key, key)  # (M,) of each piece among the known ones, -1: new
        changed, gone = self._changes(pieces, before)
        asked, shown = self._surroundings(pieces, before, changed, gone)
        if len(shown) > self._config.most * len(pieces):
            self._edges, self._pieces = self._model(pieces), pieces
        else:
            self._edges = self._update(pieces, before, asked, shown)
            self._pieces = self._remembered(pieces, before, asked)
        self._key = key
        return self._edges

    def _changes(self, pieces: Pieces, before: IntArray) -> tuple[NDArray[np.bool_], Array]:
        """Which pieces are new or moved (M,); segments (G, 2, 2) of those that went or moved."""
        known = self._pieces
        if known is None or len(known) == 0:
            return np.ones(len(pieces), dtype=bool), np.zeros((0, 2, 2))
        moved = np.abs(pieces.segment - known.segment[before]).max(axis=(1, 2))
        risen = np.abs(pieces.height - known.height[before]).max(axis=1)
        changed = (before < 0) | (moved > self._config.still) | (risen > self._config.risen)
        left = np.ones(len(known), dtype=bool)
        left[before[~changed]] = False
        return changed, known.segment[left]

    def _surroundings(
        self, pieces: Pieces, before: IntArray, changed: NDArray[np.bool_], gone: Array
    ) -> tuple[NDArray[np.bool_], IntArray]:
        """(M,) pieces whose edges are worked out again; and places of those the network sees."""
        spots = np.concatenate([pieces.segment[changed], gone])
        if len(spots) == 0:
            return np.zeros(len(pieces), dtype=bool), np.zeros(0, dtype=np.int64)
        asked = _within(pieces, spots, self._config.reach)
        shown = _within(pieces, pieces.segment[asked], self._config.reach)
        shown[self._partners(before, asked)] = True
        return asked, np.flatnonzero(shown | asked)

    def _partners(self, before: IntArray, asked: NDArray[np.bool_]) -> IntArray:
        """Pieces that had an edge with one of those asked for, near or not."""
        pairs, _ = self._left(before)
        return pairs[asked[pairs[:, 0]] | asked[pairs[:, 1]]].ravel()

    def _left(self, before: IntArray) -> tuple[IntArray, IntArray]:
        """Known pairs (K, 2) whose pieces both are still there, by where these are now; and the
        places of them among all known ones."""
        now = np.full(len(self._key), -1, dtype=np.int64)
        now[before[before >= 0]] = np.flatnonzero(before >= 0)
        pairs = now[self._edges.pairs]
        left = np.flatnonzero((pairs[:, 0] >= 0) & (pairs[:, 1] >= 0))
        return pairs.take(left, axis=0), left

    def _update(
        self, pieces: Pieces, before: IntArray, asked: NDArray[np.bool_], shown: IntArray
    ) -> Edges:
        kept, left = self._left(before)
        stay = ~(asked[kept[:, 0]] | asked[kept[:, 1]])
        old, kept = self._edges.take(left[stay]), np.sort(kept[stay], axis=1)
        if len(shown) == 0:
            return Edges(kept, old.room, old.wall)
        new = self._model(pieces.take(shown))
        pairs = shown[new.pairs]
        wanted = asked[pairs[:, 0]] | asked[pairs[:, 1]]
        new = new.take(wanted)
        return Edges(
            np.concatenate([kept, pairs[wanted]]),
            np.concatenate([old.room, new.room]),
            np.concatenate([old.wall, new.wall]),
        )

    def _remembered(self, pieces: Pieces, before: IntArray, asked: NDArray[np.bool_]) -> Pieces:
        """Pieces as they were when their edges were worked out, so that no drift adds up."""
        if self._pieces is None:
            return pieces
        segment, height = pieces.segment.copy(), pieces.height.copy()
        segment[~asked] = self._pieces.segment[before[~asked]]
        height[~asked] = self._pieces.height[before[~asked]]
        return replace(pieces, segment=segment, height=height)


def _within(pieces: Pieces, spots: Array, reach: float) -> NDArray[np.bool_]:
    """(M,) pieces whose bounding box comes within reach of one of the spots (S, 2, 2)."""
    _, j = touching(boxes(spots, 0.5 * reach), boxes(pieces.segment, 0.5 * reach))
    found = np.zeros(len(pieces), dtype=bool)
    found[j] = True
    return found
