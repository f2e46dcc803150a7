"""Names of pieces that last from one inference to the next."""

from __future__ import annotations

import numpy as np

from semantics.preprocess import Pieces
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
