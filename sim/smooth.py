"""From a chain of grid cells to a line that a base likes to drive."""

from __future__ import annotations

from itertools import pairwise

import numpy as np

from sim.freespace import FreeSpace
from slam.core import Array

EASY = 0.45
"""Distance from walls [m] that a short cut or a rounded corner may come down to."""

SHARPEST_CURVE = np.radians(110.0)
"""Corners sharper than this stay corners: the base stops and turns on the spot."""

LONGEST_CURVE = 0.7
"""Distance from a corner at which its curve may begin [m]."""


def smooth(space: FreeSpace, legs: list[Array]) -> Array:
    """One polyline (N, 2) through the ends of all ``legs``, each (M, 2), with rounded corners.

    The ends of the legs are visited; between them the line is pulled straight where it keeps
    clear of walls.
    """
    corners = [legs[0][:1]]
    corners += [_pull(space, leg)[1:] for leg in legs]
    return _round_corners(space, _distinct(np.concatenate(corners)))


def _distinct(points: Array) -> Array:
    """Without points that repeat the one before."""
    moved = np.linalg.norm(np.diff(points, axis=0), axis=1) > 1e-6
    return points[np.append(True, moved)]


def _pull(space: FreeSpace, leg: Array) -> Array:
    """The leg with as few corners as straight pieces allow that stay as clear as it did."""
    clearance = np.minimum(space.clearance_at(leg), EASY)
    corners = [0]
    while corners[-1] < len(leg) - 1:
        corners.append(_farthest_straight(space, leg, clearance, corners[-1]))
    return leg[corners]


def _farthest_straight(space: FreeSpace, leg: Array, clearance: Array, start: int) -> int:
    """How far along the leg one can go straight from ``start``: by doubling, then by halving."""

    def clear(end: int) -> bool:
        least = float(clearance[start : end + 1].min())
        return space.clearance_along(leg[start], leg[end]) >= least - 1e-9

    last, good, step = len(leg) - 1, start + 1, 2
    while good < last and clear(min(start + step, last)):
        good, step = min(start + step, last), 2 * step
    bad = min(start + step, last + 1)
    while bad - good > 1:
        middle = (good + bad) // 2
        good, bad = (middle, bad) if clear(middle) else (good, middle)
    return good


def _round_corners(space: FreeSpace, points: Array) -> Array:
    """Every corner but the sharpest replaced by a curve as wide as its surroundings allow."""
    line = [points[:1]]
    for before, corner, after in zip(points, points[1:], points[2:], strict=False):
        line.append(_curve(space, before, corner, after))
    line.append(points[-1:])
    return _distinct(np.concatenate(line))


def _curve(space: FreeSpace, before: Array, corner: Array, after: Array) -> Array:
    """Points of a quadratic Bezier curve round a corner, or the corner where none fits."""
    into, out = before - corner, after - corner
    length_in, length_out = float(np.linalg.norm(into)), float(np.linalg.norm(out))
    turn = np.pi - np.arccos(np.clip(into @ out / (length_in * length_out), -1.0, 1.0))
    if turn > SHARPEST_CURVE or turn < 1e-3:
        return corner[None]
    reach = min(LONGEST_CURVE, 0.5 * length_in, 0.5 * length_out)
    while reach > 0.05:
        curve = _bezier(
            corner + into / length_in * reach, corner, corner + out / length_out * reach
        )
        if _stays_clear(space, curve):
            return curve
        reach *= 0.7
    return corner[None]


def _stays_clear(space: FreeSpace, curve: Array) -> bool:
    """Whether a curve comes no closer to a wall than its ends and its corner do, or is easy."""
    least = min(EASY, float(space.clearance_at(curve[[0, -1]]).min()))
    return all(space.clearance_along(a, b) >= least - 0.01 for a, b in pairwise(curve))


def _bezier(start: Array, control: Array, end: Array) -> Array:
    """Twelve points of a quadratic Bezier curve."""
    t = np.linspace(0.0, 1.0, 12)[:, None]
    return (1.0 - t) ** 2 * start + 2.0 * t * (1.0 - t) * control + t**2 * end
