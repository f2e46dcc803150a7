"""The order in which to visit places: nearest neighbour, then turns and moves of stretches."""

from __future__ import annotations

import numpy as np

from slam.core import Array, IntArray

MOST_ROUNDS = 40
"""Bounds the work on buildings with thousands of places; a hundred rooms need about five."""
LONGEST_MOVE = 3
"""Most places in a row that are moved to elsewhere in the tour at once."""
LEAST_GAIN = 1e-6
"""Below this a change is but rounding [m]."""


def plan_tour(distances: Array, start: int, closed: bool = False) -> IntArray:
    """Places in the order of a short tour that begins at ``start``, and ends there if ``closed``.

    distances: (P, P), symmetric, finite.
    """
    order = _greedy(distances, start)
    # Both ends stay where they are: an open tour ends in a place that is no distance from anywhere.
    if closed:
        return _improved(distances, np.append(order, start))
    anywhere = np.pad(distances, ((0, 1), (0, 1)))
    return _improved(anywhere, np.append(order, len(distances)))[:-1]


def _greedy(distances: Array, start: int) -> IntArray:
    """Always on to the nearest place not yet seen."""
    waiting = np.ones(len(distances), dtype=bool)
    tour = [start]
    waiting[start] = False
    while waiting.any():
        tour.append(int(np.argmin(np.where(waiting, distances[tour[-1]], np.inf))))
        waiting[tour[-1]] = False
    return np.array(tour, dtype=np.int64)


def _improved(distances: Array, tour: IntArray) -> IntArray:
    """Changes that shorten the tour, the best one at each place, until there is none."""
    for _ in range(MOST_ROUNDS):
        gained = 0.0
        for first in range(1, len(tour) - 1):
            tour, gain = _turned(distances, tour, first)
            gained += gain
            for count in range(1, LONGEST_MOVE + 1):
                tour, gain = _moved(distances, tour, first, count)
                gained += gain
        if gained < LEAST_GAIN:
            break
    return tour


def _turned(distances: Array, tour: IntArray, first: int) -> tuple[IntArray, float]:
    """The stretch from ``first`` on that is best turned round, turned; and what that gains."""
    before, at = tour[first - 1], tour[first]
    last, after = tour[first:-1], tour[first + 1 :]
    gain = distances[before, at] + distances[last, after]
    gain = gain - distances[before, last] - distances[at, after]
    best = int(np.argmax(gain))
    if gain[best] < LEAST_GAIN:
        return tour, 0.0
    turned = tour.copy()
    turned[first : first + best + 1] = tour[first : first + best + 1][::-1]
    return turned, float(gain[best])


def _moved(distances: Array, tour: IntArray, first: int, count: int) -> tuple[IntArray, float]:
    """``count`` places from ``first`` on moved to where they fit best; and what that gains."""
    end = first + count
    if end >= len(tour):
        return tour, 0.0
    head, tail = tour[first], tour[end - 1]
    rest = np.concatenate([tour[:first], tour[end:]])
    near, far = rest[:-1], rest[1:]
    saved = distances[tour[first - 1], head] + distances[tail, tour[end]]
    saved -= distances[tour[first - 1], tour[end]]
    gap = distances[near, far]
    forth = distances[near, head] + distances[tail, far] - gap
    back = distances[near, tail] + distances[head, far] - gap
    cost = np.minimum(forth, back)
    best = int(np.argmin(cost))
    gain = float(saved - cost[best])
    if gain < LEAST_GAIN:
        return tour, 0.0
    piece = tour[first:end] if forth[best] <= back[best] else tour[first:end][::-1]
    return np.concatenate([rest[: best + 1], piece, rest[best + 1 :]]), gain
