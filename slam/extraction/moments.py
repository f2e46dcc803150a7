"""Sums over stretches of points in plan view, and the lines that fit them."""

from __future__ import annotations

import numpy as np

from slam.core import Array, IntArray


def moments_of(xy: Array) -> Array:
    """(N, 6) of single points (N, 2): their count, and the sums of x, y, xx, xy, yy."""
    x, y = xy.T
    return np.column_stack([np.ones(len(xy)), x, y, x * x, x * y, y * y])


def running(moments: Array) -> Array:
    """(N + 1, 6) sums of the first ones: their differences are the moments of any stretch."""
    return np.concatenate([np.zeros((1, 6)), np.cumsum(moments, axis=0)])


def moved(moments: Array, shift: Array) -> Array:
    """Moments (R, 6) of points that are all shifted by (R, 2)."""
    weight, x, y, xx, xy, yy = moments.T
    u, v = shift.T
    columns = [
        weight,
        x + weight * u,
        y + weight * v,
        xx + (2.0 * x + weight * u) * u,
        xy + x * v + y * u + weight * u * v,
        yy + (2.0 * y + weight * v) * v,
    ]
    return np.stack(columns, axis=1)


class Lines:
    """The lines through points with moments (R, 6), by least squares across them.

    weight: (R,); mean: (R, 2); residual: (R,) weighted sum of squared distances across the line,
    spread: along it; angle: (R,) of the line's direction.
    """

    def __init__(self, moments: Array):
        weight, x, y, xx, xy, yy = moments.T
        mean_x, mean_y = x / weight, y / weight
        a, b, c = xx - x * mean_x, xy - x * mean_y, yy - y * mean_y
        middle, half = 0.5 * (a + c), np.hypot(0.5 * (a - c), b)
        self.weight = weight
        self.mean = np.stack([mean_x, mean_y], axis=1)
        self.residual = np.maximum(middle - half, 0.0)
        self.spread = middle + half
        self.angle = 0.5 * np.arctan2(2.0 * b, a - c)

    @property
    def direction(self) -> Array:
        """(R, 2) unit."""
        return np.stack([np.cos(self.angle), np.sin(self.angle)], axis=1)


def turn_between(first: Array, second: Array) -> Array:
    """Smallest angles between lines of these directions [rad], in [0, pi / 2]."""
    return np.abs((first - second + 0.5 * np.pi) % np.pi - 0.5 * np.pi)


class Split:
    """Where one line had better be two: a stretch's best place to be cut.

    Of the stretch from ``start`` to ``stop`` of running moments (N + 1, 6), cut at each of ``cuts``
    (C,). gain: (C,) by how much two lines fit better; gap: (C,) how far apart they are where they
    meet [m]; bend: (C,) the angle between them [rad].
    """

    def __init__(self, sums: Array, start: IntArray, cuts: IntArray, stop: IntArray):
        whole = Lines(sums[stop] - sums[start])
        left, right = Lines(sums[cuts] - sums[start]), Lines(sums[stop] - sums[cuts])
        self.gain = whole.residual - left.residual - right.residual
        self.bend = turn_between(left.angle, right.angle)
        self.gap = _gap(left, right)


def _gap(left: Lines, right: Lines) -> Array:
    """(C,) distance between two lines midway between the stretches that they were fitted to."""
    first, second = left.direction, right.direction
    second = np.where((np.einsum("ci,ci->c", first, second) < 0.0)[:, None], -second, second)
    way = right.mean - left.mean
    length = np.maximum(np.hypot(*way.T), 1e-9)
    half = [np.sqrt(3.0 * side.spread / side.weight) for side in (left, right)]
    middle = 0.5 * (length + half[0] - half[1]) / length
    return np.abs(middle * _cross(first, way) + (1.0 - middle) * _cross(second, way))


def _cross(a: Array, b: Array) -> Array:
    return np.asarray(a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0])
