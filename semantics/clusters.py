"""From the probabilities of edges to rooms and walls (paper, III-C), no size set in advance."""

from __future__ import annotations

import heapq
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from semantics.preprocess import Pieces
from slam.core import Array, IntArray


@dataclass(frozen=True)
class ClusterConfig:
    """room, wall: least probability of an edge for two clusters to be one room, and of a pair to
    be a wall; certain: probabilities are cut off at this, so that no single edge decides; sides:
    least number of pieces of a room; open_side: widest angle [rad] that no side of a room faces;
    corridor_*: two sides alone are a room if they face each other for this long [m] and this many
    times their distance; wall_gap: (least, largest) distance [m] of a wall's faces, wall_overlap:
    least common length [m], wall_angle [rad]: between them.
    """

    room: float = 0.7
    wall: float = 0.5
    certain: float = 0.99
    sides: int = 3
    open_side: float = np.radians(200.0)
    corridor_length: float = 3.0
    corridor_ratio: float = 2.0
    wall_gap: tuple[float, float] = (0.03, 0.65)
    wall_overlap: float = 0.3
    wall_angle: float = np.radians(8.0)


@dataclass(frozen=True)
class Cluster:
    """Places of the pieces of one room, and the mean probability of the edges that hold it."""

    members: IntArray
    confidence: float


def agglomerate(
    count: int, pairs: IntArray, probability: Array, config: ClusterConfig
) -> list[Cluster]:
    """Average linkage on log-odds: the two clusters whose edges speak loudest become one, until
    none speak for it on average. Pairs without an edge are silent.
    """
    limit = np.log(config.certain / (1.0 - config.certain))
    odds = np.log(np.maximum(probability, 1e-9) / np.maximum(1.0 - probability, 1e-9))
    odds = np.clip(odds, -limit, limit) - np.log(config.room / (1.0 - config.room))
    links: list[dict[int, tuple[float, int]]] = [{} for _ in range(count)]
    for (i, j), value in zip(pairs.tolist(), odds.tolist(), strict=True):
        links[i][j] = links[j][i] = (value, 1)
    members: dict[int, list[int]] = {i: [i] for i in range(count)}
    heap = [
        (-value, i, j, 1, 1)
        for (i, j), value in zip(pairs.tolist(), odds, strict=True)
        if value > 0
    ]
    heapq.heapify(heap)
    while heap:
        _, i, j, size_i, size_j = heapq.heappop(heap)
        current = (len(members.get(i, ())), len(members.get(j, ())))
        if current == (size_i, size_j):
            _merge(i, j, members, links, heap)
    return [
        Cluster(np.array(sorted(group)), _confidence(group, pairs, probability, count))
        for group in members.values()
    ]


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


def _confidence(group: list[int], pairs: IntArray, probability: Array, count: int) -> float:
    inside = np.zeros(count, dtype=bool)
    inside[group] = True
    held = inside[pairs].all(axis=1)
    return float(probability[held].mean()) if held.any() else 0.0


def is_room(pieces: Pieces, config: ClusterConfig) -> bool:
    """Do these sides enclose something: three that leave no wide side open, or a corridor's two?"""
    if len(pieces) < 2:
        return False
    angles = np.sort(np.arctan2(pieces.normal[:, 1], pieces.normal[:, 0]))
    gaps = np.diff(np.append(angles, angles[0] + 2.0 * np.pi))
    if len(pieces) >= config.sides and gaps.max() <= config.open_side:
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


def walls_of(
    pieces: Pieces,
    pairs: IntArray,
    probability: Array,
    clusters: Sequence[Cluster],
    config: ClusterConfig,
) -> list[tuple[int, int, float]]:
    """(i, j, confidence) of pairs that are two faces of a wall: likely, back to back, and not far.

    A long face may have a wall with each of several rooms behind it; but what one room has of a
    plane is one face, in however many pieces: of those the pair with most in common stands for all.
    """
    if len(pairs) == 0:
        return []
    common = _back_to_back(pieces, pairs, config)
    good = np.flatnonzero((common > config.wall_overlap) & (probability > config.wall))
    cluster = np.zeros(len(pieces), dtype=np.int64)
    for number, group in enumerate(clusters):
        cluster[group.members] = number
    best: dict[frozenset[tuple[int, int]], int] = {}
    for p in good[np.argsort(-common[good], kind="stable")].tolist():
        faces = frozenset((int(pieces.plane_id[k]), int(cluster[k])) for k in pairs[p])
        best.setdefault(faces, p)
    return [
        (int(pairs[p, 0]), int(pairs[p, 1]), float(probability[p])) for p in sorted(best.values())
    ]


def _back_to_back(pieces: Pieces, pairs: IntArray, config: ClusterConfig) -> Array:
    """(P,) length that two pieces have in common across a wall body [m]; 0 where there is none."""
    i, j = pairs.T
    normal = pieces.normal
    opposed = np.einsum("pc,pc->p", normal[i], normal[j]) < -np.cos(config.wall_angle)
    away = pieces.centre[j] - pieces.centre[i]
    depth_i = -np.einsum("pc,pc->p", away, normal[i])
    depth_j = np.einsum("pc,pc->p", away, normal[j])
    low, high = config.wall_gap
    near = (np.minimum(depth_i, depth_j) > low) & (np.maximum(depth_i, depth_j) < high)
    axis = np.column_stack([-normal[:, 1], normal[:, 0]])[i]
    along_i = np.sort(np.einsum("pkc,pc->pk", pieces.segment[i], axis), axis=1)
    along_j = np.sort(np.einsum("pkc,pc->pk", pieces.segment[j], axis), axis=1)
    common = np.minimum(along_i[:, 1], along_j[:, 1]) - np.maximum(along_i[:, 0], along_j[:, 0])
    return np.where(opposed & near, np.maximum(common, 0.0), 0.0)
