"""Names of pieces that last from one inference to the next."""

from __future__ import annotations

import numpy as np

from semantics.pieces import Pieces
from slam.core import IntArray

MOST = 1 << 12
"""Pieces of one plane that have different names."""


def names_of(pieces: Pieces) -> IntArray:
    """(M,) the plane of each piece, and the how-manieth of its pieces it is."""
    order = np.argsort(pieces.plane_id, kind="stable")
    ordered = pieces.plane_id[order]
    number = np.empty(len(pieces), dtype=np.int64)
    number[order] = np.arange(len(pieces)) - np.searchsorted(ordered, ordered)
    return pieces.plane_id * MOST + np.minimum(number, MOST - 1)


def places_of(known: IntArray, wanted: IntArray) -> IntArray:
    """(M,) where each of the wanted names is among the known, -1 where it is not."""
    if len(known) == 0:
        return np.full(len(wanted), -1, dtype=np.int64)
    order = np.argsort(known, kind="stable")
    slot = np.minimum(np.searchsorted(known[order], wanted), len(known) - 1)
    return np.where(known[order][slot] == wanted, order[slot], -1)


def earlier(known: Pieces, pieces: Pieces) -> IntArray:
    """(M,) place of the known piece of the same plane that has most in common with each, -1 where
    there is none: however many pieces the plane has by now."""
    order = np.argsort(known.plane_id, kind="stable")
    first = np.searchsorted(known.plane_id[order], pieces.plane_id, side="left")
    number = np.searchsorted(known.plane_id[order], pieces.plane_id, side="right") - first
    mine = np.repeat(np.arange(len(pieces)), number)
    step = np.arange(len(mine)) - np.repeat(np.cumsum(number) - number, number)
    other = order[first[mine] + step]
    x, y = pieces.normal[mine].T
    there = known.segment[other]
    start, end = np.sort(there[:, :, 1] * x[:, None] - there[:, :, 0] * y[:, None], axis=1).T
    low, high = pieces.along[mine].T
    common = np.minimum(high, end) - np.maximum(low, start)
    found = np.full(len(pieces), -1, dtype=np.int64)
    by_common = np.argsort(common, kind="stable")
    by_common = by_common[common[by_common] > 0.0]
    found[mine[by_common]] = other[by_common]  # the last one written is the one with most
    return found
