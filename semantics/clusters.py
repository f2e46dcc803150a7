"""From the probabilities of edges to rooms (paper, III-C), with no size set in advance."""

from __future__ import annotations

import heapq
import math
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from semantics.pieces import Pieces
from slam.core import Array, IntArray


@dataclass(frozen=True)
class ClusterConfig:
    """room: least probability of an edge for two clusters to be one room; certain: probabilities
    are cut off at this, so that no single edge decides; sides: least number of pieces of a room;
    open_side: widest angle [rad] that no side of a room faces; corridor_*: two sides alone are a
    room if they face each other for this long [m] and this many times their distance.
    """

    room: float = 0.5
    certain: float = 0.99
    sides: int = 3
    open_side: float = np.radians(200.0)
    corridor_length: float = 3.0
    corridor_ratio: float = 2.0


@dataclass(frozen=True)
class Clusters:
    """label: (M,) the cluster that each piece is in, -1 for none; confidence: (K,) of each, the
    mean probability of the edges that hold it, 0 for a piece alone."""

    label: IntArray
    confidence: Array

    def groups(self) -> list[IntArray]:
        """Places of the pieces of each cluster, in order."""
        order = np.argsort(self.label, kind="stable")
        bounds = np.searchsorted(self.label[order], np.arange(len(self.confidence) + 1))
        return [order[a:b] for a, b in pairwise(bounds.tolist())]


def labelled(label: IntArray, pairs: IntArray, probability: Array) -> Clusters:
    """Clusters from labels 0, 1, ... (-1: none), with the confidence that the edges give them."""
    count = int(label.max(initial=-1)) + 1
    first, second = label[pairs[:, 0]], label[pairs[:, 1]]
    inside = (first == second) & (first >= 0)
    total = np.bincount(first[inside], weights=probability[inside], minlength=count)
    number = np.bincount(first[inside], minlength=count)
    return Clusters(label, total / np.maximum(number, 1))


def agglomerate(count: int, pairs: IntArray, probability: Array, config: ClusterConfig) -> Clusters:
    """Average linkage on log-odds: the two clusters whose edges speak loudest become one, until
    none speak for it on average. Pairs without an edge are silent.

    Only pieces that are joined by a chain of edges in favour can end in one cluster, and where all
    edges among those are in favour they do; so only contradictions cost time.
    """
    odds = _odds(probability, config)
    part = _parts(count, pairs[odds > 0.0])
    inner = part[pairs[:, 0]] == part[pairs[:, 1]]
    contradicted = np.unique(part[pairs[inner & (odds <= 0.0), 0]])
    label = part.copy()
    rank = np.searchsorted(contradicted, part[pairs[:, 0]])
    mine = np.append(contradicted, -1)[rank] == part[pairs[:, 0]]
    chosen = np.flatnonzero(inner & mine)
    chosen = chosen[np.argsort(rank[chosen], kind="stable")]
    bounds = np.searchsorted(rank[chosen], np.arange(len(contradicted) + 1))
    top = int(part.max(initial=-1)) + 1
    for a, b in pairwise(bounds.tolist()):
        edges = chosen[a:b]
        members, local = np.unique(pairs[edges], return_inverse=True)
        found = _linked(len(members), local.reshape(-1, 2), odds[edges])
        label[members] = np.where(found == 0, label[members], top + found - 1)
        top += int(found.max())
    _, label = np.unique(label, return_inverse=True)
    return labelled(label.astype(np.int64), pairs, probability)


def _odds(probability: Array, config: ClusterConfig) -> Array:
    """(P,) log-odds, cut off, above those at which two pieces become one room."""
    limit = np.log(config.certain / (1.0 - config.certain))
    odds = np.log(np.maximum(probability, 1e-9) / np.maximum(1.0 - probability, 1e-9))
    return np.clip(odds, -limit, limit) - np.log(config.room / (1.0 - config.room))


def _parts(count: int, pairs: IntArray) -> IntArray:
    """(count,) connected parts, numbered by their first pieces."""
    i, j = pairs.T
    part, before = np.arange(count), np.full(count, -1)
    while not np.array_equal(part, before):
        before = part.copy()
        least = np.minimum(part[i], part[j])
        np.minimum.at(part, i, least)
        np.minimum.at(part, j, least)
        part = part[part]
    return np.unique(part, return_inverse=True)[1]


def _linked(count: int, pairs: IntArray, odds: Array) -> IntArray:
    """(count,) clusters 0, 1, ... by average linkage; a heap of offers, stale ones are ignored."""
    links: list[dict[int, tuple[float, int]]] = [{} for _ in range(count)]
    for (i, j), value in zip(pairs.tolist(), odds.tolist(), strict=True):
        links[i][j] = links[j][i] = (value, 1)
    members: dict[int, list[int]] = {i: [i] for i in range(count)}
    heap = [
        (-value, i, j, 1, 1)
        for (i, j), value in zip(pairs.tolist(), odds.tolist(), strict=True)
        if value > 0
    ]
    heapq.heapify(heap)
    while heap:
        _, i, j, size_i, size_j = heapq.heappop(heap)
        current = (len(members.get(i, ())), len(members.get(j, ())))
        if current == (size_i, size_j):
            _merge(i, j, members, links, heap)
    label = np.zeros(count, dtype=np.int64)
    for number, group in enumerate(members.values()):
        label[group] = number
    return label


def _merge(
    i: int,
    j: int,
    members: dict[int, list[int]],
    links: list[dict[int, tuple[float, int]]],
    heap: list[tuple[float, int, int, int, int]],
) -> None:
    """j becomes part of i; links of both are added up and offered anew."""
    members[i] = members[i] + members.pop(j)
    del links[i][j]
    for k, (value, number) in links[j].items():
        if k == i:
            continue
        known, held = links[i].get(k, (0.0, 0))
        links[i][k] = links[k][i] = (known + value, held + number)
        del links[k][j]
    links[j] = {}
    for k, (value, number) in links[i].items():
        if value > 0.0:
            a, b = min(i, k), max(i, k)
            heapq.heappush(heap, (-value / number, a, b, len(members[a]), len(members[b])))


def is_room(pieces: Pieces, config: ClusterConfig) -> bool:
    """Do these sides enclose something: three that leave no wide side open, or a corridor's two?"""
    if len(pieces) < 2:
        return False
    angles = sorted(math.atan2(y, x) for x, y in pieces.normal.tolist())
    widest = max(b - a for a, b in pairwise([*angles, angles[0] + 2.0 * math.pi]))
    if len(pieces) >= config.sides and widest <= config.open_side:
        return True
    return _corridor(pieces, config)


def _corridor(pieces: Pieces, config: ClusterConfig) -> bool:
    """Two long sides that face each other, whatever else there is."""
    order = np.argsort(-pieces.length)
    first = order[0]
    normal = pieces.normal[first]
    axis = np.array([-normal[1], normal[0]])
    for other in order[1:]:
        if pieces.normal[other] @ normal > -0.95:
            continue
        along = np.sort(pieces.segment[[first, other]] @ axis, axis=1)
        common = along[:, 1].min() - along[:, 0].max()
        gap = (pieces.centre[other] - pieces.centre[first]) @ normal
        return bool(gap > 0.5 and common > max(config.corridor_length, config.corridor_ratio * gap))
    return False
