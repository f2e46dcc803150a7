"""Segments in plan view: how far apart they are, and which of them cross."""

from __future__ import annotations

import numpy as np
import shapely
from numpy.typing import NDArray

from semantics.near import boxes, columns, touching
from slam.core import Array, IntArray

SURE = 1e-14
"""A turn that is larger than this share of its two terms is no rounding error (up to 4e-16)."""


def row_dots(a: Array, b: Array) -> Array:
    """(P,) products of the rows of (P, 2)."""
    return a[:, 0] * b[:, 0] + a[:, 1] * b[:, 1]


def turn(a: Array, b: Array, c: Array) -> Array:
    """(E,) positive where c lies to the left of the way from a to b."""
    return (b[:, 0] - a[:, 0]) * (c[:, 1] - a[:, 1]) - (b[:, 1] - a[:, 1]) * (c[:, 0] - a[:, 0])


def segment_gaps(segments: Array, i: IntArray, j: IntArray) -> Array:
    """(E,) shortest distance between two of the segments (M, 2, 2) each; 0 where they cross."""
    every = columns(segments)
    a, b = every.take(i, axis=2), every.take(j, axis=2)
    (to_a, across_a), (to_b, across_b) = _end_gaps(b, a), _end_gaps(a, b)
    return np.where(across_a & across_b, 0.0, np.sqrt(np.minimum(to_a, to_b)))


def _end_gaps(ends: Array, line: Array) -> tuple[Array, NDArray[np.bool_]]:
    """(E,) squared distance of the nearer end of one segment (2, 2, E) to another; and whether its
    ends lie on different sides of that."""
    run_x, run_y = line[1] - line[0]
    x, y = ends[:, 0] - line[0, 0], ends[:, 1] - line[0, 1]
    length2 = np.maximum(run_x * run_x + run_y * run_y, 1e-12)
    at = np.minimum(np.maximum((x * run_x + y * run_y) / length2, 0.0), 1.0)
    off_x, off_y = x - at * run_x, y - at * run_y
    square = off_x * off_x + off_y * off_y
    left = run_x * y - run_y * x
    return np.minimum(square[0], square[1]), left[0] * left[1] < 0.0


def crossings(lines: Array, segments: Array) -> tuple[IntArray, IntArray]:
    """Places of the lines (P, 2, 2) and segments (M, 2, 2) that have a point in common.

    Where rounding might decide it, shapely does.
    """
    line, other = touching(boxes(lines), boxes(segments))
    a, b = columns(lines).take(line, axis=2), columns(segments).take(other, axis=2)
    seen, back = _sides(a, b), _sides(b, a)
    hit = (seen < 0.0) & (back < 0.0)
    unsure = np.flatnonzero((seen <= 0.0) & (back <= 0.0) & ~hit)
    if len(unsure):
        ends = lines[line[unsure]], segments[other[unsure]]
        hit[unsure] = shapely.intersects(*(shapely.linestrings(each) for each in ends))
    return line[hit], other[hit]


def _sides(line: Array, ends: Array) -> Array:
    """(K,) for segments (2, 2, K): 1 where both ends lie on one side of the line, -1 where they lie
    on different ones, 0 where that is not sure."""
    run_x, run_y = line[1] - line[0]
    left, right = run_x * (ends[:, 1] - line[0, 1]), run_y * (ends[:, 0] - line[0, 0])
    turns = left - right
    sure = np.abs(turns) > SURE * (np.abs(left) + np.abs(right))
    first, second = np.sign(turns) * sure
    return first * second
