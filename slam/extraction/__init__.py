"""Plane extraction from one sweep of a spinning multi-beam LiDAR.

Walls: the returns of one beam on a plane lie on a straight run, whose direction in plan view is
known to a fraction of a degree from a few decimetres of it, while neighbouring beams are too far
apart (and too differently offset) for local normals. So each beam is cut into straight runs
(``runs``); where beams run along one wall they tell each other's range offsets (``offsets``); the
runs that lie on one line are gathered (``groups``), and the plane is fitted to all of them at once
(``fit``), as a mixed model: what is left of a beam's offset is common to its returns. Floor and
ceiling: the returns whose neighbour in the next beam is level with them (``levels``).
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from slam.core import Array, PlaneObservation
from slam.extraction.config import ExtractionConfig
from slam.extraction.levels import find_levels, level_planes
from slam.extraction.offsets import beam_offsets
from slam.extraction.runs import straight_runs
from slam.extraction.sweep import Sweep
from slam.extraction.walls import wall_planes

__all__ = ["Extracted", "ExtractionConfig", "extract", "extract_planes"]


class Extracted(NamedTuple):
    """plumb: (3,) unit, base frame, up along walls that are plumb, if the sweep tells that."""

    planes: tuple[PlaneObservation, ...]
    plumb: Array | None


def extract_planes(
    points: Array, ring: NDArray[np.int16], origin: Array, config: ExtractionConfig
) -> tuple[PlaneObservation, ...]:
    """The planes alone of ``extract``."""
    return extract(points, ring, origin, config).planes


def extract(
    points: Array, ring: NDArray[np.int16], origin: Array, config: ExtractionConfig
) -> Extracted:
    """Planes in a deskewed sweep, and the direction of plumb walls.

    points: (N, 3) base frame, z roughly up; ring: (N,) beam; origin: (3,) the sensor in that frame.
    """
    sweep = Sweep.of(points, ring, origin, config.max_range)
    if len(sweep) < config.min_points:
        return Extracted((), None)
    levels = find_levels(sweep, config)
    upright = sweep.part(~levels.on)
    runs = straight_runs(upright, config)
    offsets = beam_offsets(runs, int(ring.max()) + 1, config)
    floors = level_planes(sweep, levels, offsets, runs.noise, config)
    planes = (*floors, *wall_planes(upright, runs, offsets, config))
    return Extracted(planes, offsets.plumb(config.plumb_surely))
