"""A guard against drawings whose lines cross without end: to unite them would take for ever."""

from __future__ import annotations

import numpy as np
import shapely
from numpy.typing import NDArray
from shapely import STRtree

SAMPLE = 50
"""Shapes whose crossings are counted."""
FEW = 700
"""Lines that are fewer cannot cross too often."""
MAX_CROSSINGS = 300_000
"""Most crossings of lines that are worked out: some seconds' work."""


def tangled(shapes: NDArray[np.object_]) -> bool:
    """Whether the lines of some shapes are likely to cross more than ``MAX_CROSSINGS`` times."""
    lines = shapes
    if len(shapes) and shapely.get_dimensions(shapes).max() > 1:
        lines = shapely.get_parts(shapely.boundary(shapes))
    if len(lines) < FEW:
        return False
    chosen = lines[:: max(1, len(lines) // SAMPLE)]
    met = len(STRtree(lines).query(chosen, predicate="intersects")[0])
    return met / len(chosen) * len(lines) / 2.0 > MAX_CROSSINGS
