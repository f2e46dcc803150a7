"""Ramps: what slopes too little for a wall and too much for a floor."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from slam.core import Array, IntArray
from slam.extraction.config import ExtractionConfig
from slam.extraction.sweep import Sweep

SAMPLE = 2000
"""So many of the candidates tell where a ramp is."""
TRIES = 100
"""Planes through three of them each."""


def on_ramp(
    sweep: Sweep,
    known: NDArray[np.bool_],
    below: IntArray,
    above: IntArray,
    config: ExtractionConfig,
) -> NDArray[np.bool_]:
    """(N,) which returns are on a ramp, or on the level floor beyond the one that the base is on.

    Beams run along it on arcs that pass for walls. known: (N,) those on floor or ceiling; below,
    above: see ``Sweep.above``.
    """
    free = ~(known[below] | known[above])
    below, above = below[free], above[free]
    step = sweep.xyz[above] - sweep.xyz[below]
    sloped = _is_slope(step[:, 2], np.hypot(step[:, 0], step[:, 1]), config)
    places = np.unique(np.concatenate([below[sloped], above[sloped]]))
    if len(places) < config.ramp_min_points:
        return np.zeros(len(sweep), dtype=bool)
    found = _best_plane(sweep.xyz[places[:: max(1, len(places) // SAMPLE)]], config)
    if found is None:
        return np.zeros(len(sweep), dtype=bool)
    normal, offset = found
    off = np.abs(sweep.xyz @ normal - offset)
    first, second = off[below] < config.floor_width, off[above] < config.floor_width
    both, one = int((first & second).sum()), int((first ^ second).sum())
    if both < max(config.ramp_min_points, one):  # a cut through what stands about
        return np.zeros(len(sweep), dtype=bool)
    return np.asarray(off < config.floor_distance)


def _best_plane(points: Array, config: ExtractionConfig) -> tuple[Array, float] | None:
    """Normal (3,) and offset of the plane through three of the points (M, 3) that slopes as ramps
    do and that most others lie on; None where none slopes so."""
    rng = np.random.default_rng(0)  # the same sweep gives the same planes
    a, b, c = points[rng.integers(len(points), size=(TRIES, 3))].transpose(1, 0, 2)
    normal = np.cross(b - a, c - a)
    normal /= np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), 1e-12)
    slopes = _is_slope(np.hypot(normal[:, 0], normal[:, 1]), np.abs(normal[:, 2]), config)
    if not slopes.any():
        return None
    normal, a = normal[slopes], a[slopes]
    offset = np.einsum("ti,ti->t", normal, a)
    near = np.abs(points @ normal.T - offset) < config.floor_width
    best = int(near.sum(axis=0).argmax())
    return normal[best], float(offset[best])


def _is_slope(rise: Array, run: Array, config: ExtractionConfig) -> NDArray[np.bool_]:
    least, most = np.tan(config.ramp)
    return np.asarray((np.abs(rise) > least * run) & (np.abs(rise) < most * run))
