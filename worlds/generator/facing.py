"""Where two rooms face each other across a wall."""

from __future__ import annotations

import itertools

import numpy as np
from shapely.geometry import Polygon

from slam.core import Array

Stretch = tuple[tuple[Array, Array], tuple[Array, Array]]
"""Where two rooms face each other across a wall: a stretch of one (two ends), then of the other."""


def facing(a: Polygon, b: Polygon, least: float) -> list[Stretch]:
    """Every stretch of at least ``least`` where a and b face each other across at most 0.6 m."""
    if a.distance(b) > 0.6:
        return []
    found: list[Stretch] = []
    for p, q in edges(a):
        run = (q - p) / np.linalg.norm(q - p)
        inward = np.array([-run[1], run[0]])
        for r, s in edges(b):
            height = float((r - p) @ inward)
            if abs((s - r) @ inward) > 1e-6 or not -0.6 <= height <= -0.01:
                continue
            low = max(0.0, float(min((r - p) @ run, (s - p) @ run)))
            high = min(float((q - p) @ run), float(max((r - p) @ run, (s - p) @ run)))
            if high - low >= least and (s - r) @ run < 0:
                across = height * inward
                ends = p + low * run, p + high * run
                found.append((ends, (ends[1] + across, ends[0] + across)))
    return found


def edges(polygon: Polygon) -> list[tuple[Array, Array]]:
    """Boundary edges, the room on their left."""
    ring = np.asarray(polygon.exterior.coords)
    ring = ring if polygon.exterior.is_ccw else ring[::-1]
    return list(itertools.pairwise(ring))
