"""Heights at which something begins or ends in a mesh: floors, ceilings, sills, lintels."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from slam.core import Array
from worlds.readers.meshfile import Mesh

LEVEL = 0.95
"""Least vertical part of the normal of a level surface."""
BIN = 0.05
"""Level surfaces nearer than this are one [m]."""
LARGE = 0.3
"""Floors and ceilings have at least this part of the area of the largest level surface."""
STEP = 0.6
"""Level surfaces nearer than this are the two faces of a slab [m]."""
HEADROOM = 1.8
"""Least height of a storey [m]."""
EDGE, TOTAL = 0.3, 1.0
"""Level edges at least this long count, and mark a level if together they are this long [m]."""
APART = 0.05
"""Levels nearer than this are one [m]."""
MOST_LEVELS = 12
"""Most heights at which the walls of a storey are taken to change."""
TALLEST_SLICE = 1.0
"""Walls are looked at once in every such stretch of height, at least, in a usual storey [m]."""


@dataclass(frozen=True)
class Span:
    """A storey of a mesh: from floor to ceiling [m]."""

    z_floor: float
    z_ceiling: float


def storeys_of(mesh: Mesh) -> list[Span]:
    """The storeys between the large level surfaces; one from bottom to top where there are none.

    Which way the surfaces face does not matter: many meshes have each triangle twice, or turned.
    """
    bottom, top = float(mesh.vertices[:, 2].min()), float(mesh.vertices[:, 2].max())
    slabs = _slabs(_level_areas(mesh)) or [(bottom, bottom)]
    spans = []
    for _, floor in slabs:
        over = [lower for lower, _ in slabs if lower >= floor + HEADROOM]
        spans.append(Span(floor, min(over, default=top)))
    kept = [span for span in spans if span.z_ceiling - span.z_floor >= HEADROOM]
    return kept or [Span(bottom, top)]


def _slabs(levels: list[tuple[float, float]]) -> list[tuple[float, float]]:
    """Lower and upper face of each slab: large surfaces that are near to each other."""
    most = max((area for _, area in levels), default=0.0)
    slabs: list[tuple[float, float]] = []
    for z, area in levels:
        if area < LARGE * most:
            continue
        if slabs and z - slabs[-1][1] < STEP:
            slabs[-1] = (slabs[-1][0], z)
        else:
            slabs.append((z, z))
    return slabs


def _level_areas(mesh: Mesh) -> list[tuple[float, float]]:
    """(height, area) of the level surfaces, upwards."""
    a, b, c = np.moveaxis(mesh.vertices[mesh.faces], 1, 0)
    normal = np.cross(b - a, c - a)
    twice = np.linalg.norm(normal, axis=1)
    steep = np.divide(np.abs(normal[:, 2]), twice, out=np.zeros(len(a)), where=twice > 0.0)
    level = steep > LEVEL
    return _clusters((a + b + c)[level, 2] / 3.0, twice[level] / 2.0, BIN)


def _clusters(heights: Array, weights: Array, gap: float) -> list[tuple[float, float]]:
    """(weighted median height, total weight) of runs of heights less than ``gap`` apart."""
    order = np.argsort(heights, kind="stable")
    heights, weights = heights[order], weights[order]
    runs = np.split(np.arange(len(heights)), np.flatnonzero(np.diff(heights) > gap) + 1)
    return [_weighed(heights[r], weights[r]) for r in runs if weights[r].sum() > 0.0]


def _weighed(heights: Array, weights: Array) -> tuple[float, float]:
    share = np.cumsum(weights)
    return float(heights[np.searchsorted(share, 0.5 * share[-1])]), float(share[-1])


def changes(mesh: Mesh, span: Span) -> list[float]:
    """Heights from floor to ceiling, both included, between which walls do not change."""
    ends = mesh.vertices[mesh.faces[:, [[0, 1], [1, 2], [2, 0]]]].reshape(-1, 2, 3)
    run = ends[:, 1] - ends[:, 0]
    length = np.linalg.norm(run, axis=1)
    level = (np.abs(run[:, 2]) < 1e-3) & (length >= EDGE)
    z = ends[level, :, 2].mean(axis=1)
    found = _clusters(z, length[level], 0.01)
    strong = sorted(((w, h) for h, w in found if w >= TOTAL), reverse=True)
    kept = [span.z_floor, span.z_ceiling]
    for _, height in strong[: 4 * MOST_LEVELS]:
        inside = span.z_floor < height < span.z_ceiling
        if inside and len(kept) < MOST_LEVELS and min(abs(height - k) for k in kept) > APART:
            kept.append(height)
    return _no_gap(sorted(kept))


def _no_gap(heights: list[float]) -> list[float]:
    found = heights[:1]
    tallest = max(TALLEST_SLICE, 2.0 * (heights[-1] - heights[0]) / MOST_LEVELS)
    for low, high in pairwise(heights):
        parts = int(np.ceil((high - low) / tallest))
        found += [low + (high - low) * k / parts for k in range(1, parts + 1)]
    return found


def clear_of(mesh: Mesh, low: float, high: float) -> float:
    """A height between two others, near their middle, at which no vertex lies."""
    z: NDArray[np.float64] = np.unique(mesh.vertices[:, 2])
    z = z[(z > low) & (z < high)]
    borders = np.concatenate([[low], z, [high]])
    middle = (low + high) / 2.0
    centres, widths = (borders[1:] + borders[:-1]) / 2.0, np.diff(borders)
    return float(centres[np.argmax(widths - 1e-3 * np.abs(centres - middle))])
