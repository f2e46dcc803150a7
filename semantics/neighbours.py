"""The closest neighbours of each plane piece: those it has an edge with."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from semantics.lines import segment_gaps
from semantics.near import boxes, touching
from semantics.pieces import Pieces
from slam.core import Array, IntArray

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

Gaps = tuple[IntArray, IntArray, Array]
"""Places i < j of the two pieces of each pair, and their distance [m]."""


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


def closest_segments(pieces: Pieces, neighbours: int) -> Gaps:
    """Pairs i < j where either is among the other's closest, and their gaps [m].

    Closest by the gap in lengths of the other. Looks around each piece, and further only around
    those that have too few within reach.
    """
    count, length = len(pieces), pieces.length
    wanted = min(neighbours, count - 1)
    reach = 0.5 * np.maximum(REACH, REACH_SHARE * length)
    lonely = np.arange(count if wanted > 0 else 0)
    found: list[Gaps] = []
    while len(lonely):
        i, j, gap = _within(pieces.segment, reach, lonely)
        found.append((np.minimum(i, j), np.maximum(i, j), gap))
        number = np.bincount(i, minlength=count)
        if len(lonely) == count:  # each pair was looked at once
            number += np.bincount(j, minlength=count)
        lonely = lonely[number[lonely] < wanted]
        reach = 2.0 * reach
    i, j, gap = _once(found, count)
    keep = np.flatnonzero(_nearest(i, j, gap, length, neighbours))
    return i.take(keep), j.take(keep), gap.take(keep)


def _within(segment: Array, reach: Array, of: IntArray) -> Gaps:
    """Pairs of some with any other that are nearer than the reach of both together, and their gaps;
    of all with all, each pair once."""
    box = boxes(segment, reach)
    every = len(of) == len(segment)
    i, j = touching(box if every else box.take(of, axis=2), box)
    i = of.take(i)
    other = np.flatnonzero(i < j if every else i != j)
    i, j = i.take(other), j.take(other)
    gap, own = segment_gaps(segment, i, j), reach.take(i)
    near = np.flatnonzero((gap <= own + reach.take(j)) | (own > FAR))
    return i.take(near), j.take(near), gap.take(near)


def _once(found: list[Gaps], count: int) -> Gaps:
    """All pairs that were found, in order, none twice."""
    if not found:
        return np.zeros(0, dtype=np.int64), np.zeros(0, dtype=np.int64), np.zeros(0)
    i, j, gap = (np.concatenate(column) for column in zip(*found, strict=True))
    if len(found) == 1:
        return i, j, gap
    _, first = np.unique(i * count + j, return_index=True)
    return i.take(first), j.take(first), gap.take(first)


def _nearest(
    i: IntArray, j: IntArray, gap: Array, length: Array, neighbours: int
) -> NDArray[np.bool_]:
    """Which pairs are among the ``neighbours`` closest of either of the two."""
    ends, others = np.concatenate([i, j]), np.concatenate([j, i])
    score = (np.concatenate([gap, gap]) + TOUCH) / (length + SHORT).take(others)
    order = np.argsort(score, kind="stable")
    owner = ends.take(order).astype(np.min_scalar_type(len(length)))  # small numbers sort faster
    order = order.take(np.argsort(owner, kind="stable"))
    number = np.bincount(ends, minlength=len(length))
    rank = np.arange(len(ends)) - np.repeat(np.cumsum(number) - number, number)
    keep = np.zeros(len(ends), dtype=bool)
    keep[order.take(np.flatnonzero(rank < neighbours))] = True
    return keep[: len(i)] | keep[len(i) :]
