"""Which boxes touch: what can have to do with each other at all."""

from __future__ import annotations

import numpy as np
import shapely
from numpy.typing import NDArray

from slam.core import Array, IntArray

Pairs = tuple[IntArray, IntArray]
"""Places of the first and of the second of each pair."""
Boxes = NDArray
"""(2, 2, M): the lowest and the highest, x and y, of each box."""
FEW = 25_000
"""Up to so many pairs, a rougher look first gains nothing."""
MOST = 8_000_000
"""From so many pairs on, a tree is faster than looking at all."""


def boxes(segments: Array, reach: float | Array = 0.0) -> Boxes:
    """Around segments (M, 2, 2), each grown by ``reach``, or by its own (M,) [m]."""
    start, end = columns(segments)
    grown = np.empty((2, *start.shape))
    np.subtract(np.minimum(start, end), reach, out=grown[0])
    np.add(np.maximum(start, end), reach, out=grown[1])
    return grown


def columns(segments: Array) -> Array:
    """(2, 2, M) of (M, 2, 2): one number of all in one row, which is what arithmetic is fast on."""
    return np.ascontiguousarray(segments.reshape(-1, 4).T).reshape(2, 2, -1)


def touching(first: Boxes, second: Boxes) -> Pairs:
    """Places of those of the first (A) and of the second (B) that touch, sorted."""
    pairs = first.shape[2] * second.shape[2]
    if pairs > MOST:
        return _by_tree(first, second)
    if pairs <= FEW:
        return _touching(first, second)
    i, j = _touching(*_in_bytes(first, second))
    there = np.ones(len(i), dtype=bool)
    for low_i, high_i, low_j, high_j in zip(*first, *second, strict=True):
        there &= low_i.take(i) <= high_j.take(j)
        there &= high_i.take(i) >= low_j.take(j)
    return i[there], j[there]


def near_pairs(segments: Array, reach: float) -> Pairs:
    """All (i, j), i not j, whose boxes, each grown by ``reach`` [m], touch; sorted."""
    box = boxes(segments, reach)
    i, j = touching(box, box)
    other = np.flatnonzero(i != j)
    return i[other], j[other]


def _by_tree(first: Boxes, second: Boxes) -> Pairs:
    tree = shapely.STRtree(shapely.box(*second.reshape(4, -1)))
    i, j = tree.query(shapely.box(*first.reshape(4, -1)))
    order = np.lexsort((j, i))
    return i[order], j[order]


def _in_bytes(first: Boxes, second: Boxes) -> tuple[Boxes, Boxes]:
    """The same in 255ths of the whole, rounded down: what touches still does."""
    low = np.minimum(first[0].min(axis=1), second[0].min(axis=1))[:, None]
    high = np.maximum(first[1].max(axis=1), second[1].max(axis=1))[:, None]
    scale = 255.0 / np.maximum(high - low, 1e-9)
    return ((first - low) * scale).astype(np.uint8), ((second - low) * scale).astype(np.uint8)


def _touching(first: Boxes, second: Boxes) -> Pairs:
    (low_x, low_y), (high_x, high_y) = first[..., None]
    touch = low_x <= second[1, 0]
    touch &= low_y <= second[1, 1]
    touch &= high_x >= second[0, 0]
    touch &= high_y >= second[0, 1]
    place, count = np.flatnonzero(touch), max(second.shape[2], 1)
    i = place // count
    return i, place - i * count
