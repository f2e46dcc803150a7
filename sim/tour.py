"""The order in which to visit places: nearest neighbour, then 2-opt. The tour is open."""

from __future__ import annotations

import numpy as np

from slam.core import Array, IntArray

MOST_SWAPS = 4000
"""Bounds the work on buildings with thousands of places; a hundred rooms need a hundred."""


def plan_tour(distances: Array, start: int) -> IntArray:
    """Places in the order of a short open tour that begins at ``start``.

    distances: (P, P), symmetric, finite.
    """
    return _untangle(distances, _greedy(distances, start))


def _greedy(distances: Array, start: int) -> IntArray:
    """Always on to the nearest place not yet seen."""
    waiting = np.ones(len(distances), dtype=bool)
    tour = [start]
    waiting[start] = False
    while waiting.any():
        tour.append(int(np.argmin(np.where(waiting, distances[tour[-1]], np.inf))))
        waiting[tour[-1]] = False
    return np.array(tour, dtype=np.int64)


def _untangle(distances: Array, tour: IntArray) -> IntArray:
    """2-opt: turn round the stretch whose turning gains most, until none gains."""
    for _ in range(MOST_SWAPS):
        first, last, gain = _best_turn(distances, tour)
        if gain < 1e-6:
            break
        tour[first : last + 1] = tour[first : last + 1][::-1].copy()
    return tour


def _best_turn(distances: Array, tour: IntArray) -> tuple[int, int, float]:
    """The stretch first..last (first >= 1) to turn round, and what that gains.

    The last place has no successor, so a stretch that ends there has but one end to reconnect.
    """
    if len(tour) < 3:
        return 0, 0, 0.0
    along = distances[np.ix_(tour, tour)]
    before, at = along[:-1], np.arange(1, len(tour))
    legs = along[at - 1, at]
    after_leg = np.append(legs[1:], 0.0)
    new_entry = before[:, 1:]
    new_exit = np.concatenate([along[1:, 2:], np.zeros((len(legs), 1))], axis=1)
    gain = np.triu(legs[:, None] + after_leg[None, :] - new_entry - new_exit, k=1)
    first, last = np.unravel_index(int(np.argmax(gain)), gain.shape)
    return int(first) + 1, int(last) + 1, float(gain[first, last])
