"""Where pieces are cut: where a wall of another direction stands on them, and where a passage
narrows to a door."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from semantics.bins import Bins
from semantics.lines import crossings, row_dots
from semantics.near import Pairs, columns, near_pairs
from semantics.pieces import Pieces, PreprocessConfig
from slam.core import Array, IntArray

SHORT_OF = 0.06
"""Less than any wall is thick [m]."""


def stubs(pieces: Pieces, bins: Bins, config: PreprocessConfig) -> tuple[IntArray, Array, Array]:
    """Pieces, and where [m] from their start, that have a hole opposite another face's hole; and
    the lines (B, 2, 2) between the two."""
    hole = bins.holes(config)
    if len(hole) == 0:
        return np.zeros(0, dtype=np.int64), np.zeros(0), np.zeros((0, 2, 2))
    middle = 0.5 * (bins.middle[hole] + bins.middle[hole + 1])
    along, axis = pieces.along, pieces.axis
    first, last = np.searchsorted(hole, np.stack(bins.places(pieces.plane_id, along)))
    holed = np.flatnonzero(first < last)
    i, j = (holed[k] for k in near_pairs(pieces.segment[holed], 0.5 * config.passage))
    away = row_dots(pieces.centre[j] - pieces.centre[i], pieces.normal[i])
    opposed = row_dots(axis[i], axis[j]) < -np.cos(config.crossing)
    opposed &= (away > config.in_front) & (away < config.passage)
    which: list[int] = []
    at: list[float] = []
    barrier: list[Array] = []
    for a, b in zip(i[opposed].tolist(), j[opposed].tolist(), strict=True):
        mine = middle[first[a] : last[a]] - along[a, 0]
        others = middle[first[b] : last[b]] - along[b, 0]
        spots = pieces.segment[b, 0] + others[:, None] * axis[b]
        off = np.abs(mine[:, None] - (spots - pieces.segment[a, 0]) @ axis[a])
        found = np.flatnonzero(off.min(axis=1) < config.stub_off)
        which += [a] * len(found)
        at += mine[found].tolist()
        here = pieces.segment[a, 0] + mine[found, None] * axis[a]
        barrier += [np.stack([here, spots[off[found].argmin(axis=1)]], axis=1)] if a < b else []
    lines = np.concatenate([np.zeros((0, 2, 2)), *barrier])
    return np.array(which, dtype=np.int64), np.array(at), lines


def crossed(
    pieces: Pieces, near: Pairs, bins: Bins, config: PreprocessConfig
) -> tuple[IntArray, Array]:
    """Pieces, and where [m] from their start, on whose front another one of a different direction
    stands."""
    i, j = near
    normal, axis, ends = pieces.normal.T.copy(), pieces.axis.T.copy(), columns(pieces.segment)
    n, a = normal.take(i, axis=1), axis.take(j, axis=1)
    sine = np.abs(a[0] * n[0] + a[1] * n[1])
    slanted = np.flatnonzero(sine > np.sin(config.crossing))
    i, j, sine, n = i[slanted], j[slanted], sine[slanted], n.take(slanted, axis=1)
    a = axis.take(i, axis=1)
    away = ends.take(j, axis=2) - ends[0].take(i, axis=1)  # of j's ends, from i's start
    height = away[:, 0] * n[0] + away[:, 1] * n[1]
    along = away[:, 0] * a[0] + away[:, 1] * a[1]
    rise = height[1] - height[0]
    at = along[0] - height[0] * (along[1] - along[0]) / rise
    least, most = np.minimum(height[0], height[1]), np.maximum(height[0], height[1])
    stands = (least < config.reach * sine) & (most > config.in_front)
    stands &= (at > config.inside) & (at < pieces.length[i] - config.inside)
    cut = np.flatnonzero(stands)
    i, j, at, least, rise = i[cut], j[cut], at[cut], least[cut], rise[cut]
    free = (pieces.length[j] > config.wall) | _as_high(pieces, i, j, at, bins, config)
    far = np.flatnonzero(free & (least > config.in_front))
    if len(far) == 0:
        return i[free], at[free]
    nearest = pieces.segment[j[far], (rise[far] < 0.0).astype(np.int64)]
    foot = pieces.segment[i[far], 0] + at[far, None] * pieces.axis[i[far]]
    free[far] = _in_sight(pieces, nearest, foot)
    return i[free], at[free]


def _as_high(
    pieces: Pieces, i: IntArray, j: IntArray, at: Array, bins: Bins, config: PreprocessConfig
) -> NDArray[np.bool_]:
    """(P,) was j seen about as high as i is about a place [m] from its start? How high depends on
    how far away the robot was, which differs along a long face."""
    middle = pieces.along[i, 0] + at
    about = np.column_stack([middle - config.about, middle + config.about])
    count, behind = bins.between(pieces.plane_id[i], about)
    low, high = np.where(count > 0, behind, pieces.height[i].T)
    _, there = bins.between(pieces.plane_id[j], pieces.along[j])
    return np.asarray(there[1] - low > config.as_high * (high - low))


def _in_sight(pieces: Pieces, start: Array, end: Array) -> NDArray[np.bool_]:
    """(P,) does no piece cross the way from start to end (P, 2)?

    Short of both by less than a wall is thick, so that neither piece is in its own way.
    """
    way = end - start
    step = SHORT_OF * way / np.linalg.norm(way, axis=1, keepdims=True)
    line, _ = crossings(np.stack([start + step, end - step], axis=1), pieces.segment)
    free = np.ones(len(start), dtype=bool)
    free[line] = False
    return free


def cut(pieces: Pieces, which: IntArray, at: Array, config: PreprocessConfig) -> Pieces:
    """The pieces, each cut at all of its places; what becomes too short is dropped."""
    count = len(pieces)
    owner = np.concatenate([np.arange(count), which])
    start = np.concatenate([np.zeros(count), at])
    order = np.lexsort((start, owner))
    owner, start = owner[order], start[order]
    last = np.append(owner[1:] != owner[:-1], True)
    end = np.where(last, pieces.length[owner], np.append(start[1:], 0.0))
    long = end - start >= config.min_length
    owner, ends = owner[long], np.column_stack([start, end])[long]
    chosen, axis = pieces.take(owner), pieces.axis[owner]
    segment = chosen.segment[:, :1] + ends[:, :, None] * axis[:, None, :]
    return Pieces(chosen.plane_id, segment, chosen.normal, chosen.height)
