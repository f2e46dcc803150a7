"""Which room a place between the rooms' cores belongs to: widest path, or modularity."""

from __future__ import annotations

import heapq
from collections import defaultdict
from collections.abc import Sequence

import numpy as np

from semantics.freespace.gvd import Ints
from semantics.freespace.places import Places
from semantics.hydra.config import RoomsConfig

Neighbours = list[list[tuple[int, float]]]


def assign(places: Places, seeds: Sequence[Ints], config: RoomsConfig) -> list[Ints]:
    """The members of each room, cores included; rooms below ``min_room`` places are dropped."""
    labels = np.full(len(places), -1, np.int64)
    for label, members in enumerate(seeds):
        labels[members] = label
    neighbours = _neighbours(places)
    if config.version == 1:
        by_modularity(labels, neighbours, config.sweeps, config.gamma)
    else:
        by_widest_path(labels, neighbours)
    rooms = [np.flatnonzero(labels == label) for label in range(len(seeds))]
    return [members for members in rooms if len(members) >= config.min_room]


def _neighbours(places: Places) -> Neighbours:
    found: Neighbours = [[] for _ in range(len(places))]
    for (a, b), width in zip(places.edges.tolist(), places.widths.tolist(), strict=True):
        found[a].append((b, width))
        found[b].append((a, width))
    return found


def by_widest_path(labels: Ints, neighbours: Neighbours) -> None:
    """Grows all cores at once over the widest edge that is left (in place)."""
    heap = [
        (-width, node, other)
        for node in np.flatnonzero(labels >= 0).tolist()
        for other, width in neighbours[node]
    ]
    heapq.heapify(heap)
    while heap:
        _, node, other = heapq.heappop(heap)
        if labels[other] < 0:
            labels[other] = labels[node]
            for further, width in neighbours[other]:
                if labels[further] < 0:
                    heapq.heappush(heap, (-width, other, further))


def by_modularity(labels: Ints, neighbours: Neighbours, sweeps: int, gamma: float) -> None:
    """Moves each place that was no core to the room that it gains most by (in place).

    Gain (as published): 2 w(v, C) - gamma K_C k_v / m, with m the number of edges.
    """
    degree = [sum(max(width, 0.0) for _, width in near) for near in neighbours]
    m = max(sum(len(near) for near in neighbours) / 2, 1)
    total: defaultdict[int, float] = defaultdict(float)
    for node, label in enumerate(labels.tolist()):
        total[label] += degree[node]
    free = np.flatnonzero(labels < 0).tolist()
    for _ in range(sweeps):
        moved = False
        for node in free:
            before = int(labels[node])
            total[before] -= degree[node]
            towards: defaultdict[int, float] = defaultdict(float)
            for other, width in neighbours[node]:
                if labels[other] >= 0:
                    towards[int(labels[other])] += max(width, 0.0)
            gains = {c: 2 * w - gamma * total[c] * degree[node] / m for c, w in towards.items()}
            best = max(gains, key=lambda c: (gains[c], -c), default=before)
            after = best if gains.get(best, 0.0) > 0.0 else before
            labels[node] = after
            total[after] += degree[node]
            moved |= after != before
        if not moved:
            return
