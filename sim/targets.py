"""Where to go in a room, so that all of it has been seen."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import shapely
from shapely.geometry import Polygon

from sim.levels import Levels
from slam.core import Array, IntArray

if TYPE_CHECKING:
    from worlds.truth import Room


def targets_in(levels: Levels, room: Room, cells: IntArray, view: float) -> IntArray:
    """Cells to visit in a room: its middle, then whatever is far from all chosen or hidden."""
    if not len(cells):
        return cells
    points = levels.places(cells)
    clearance = levels.space.clearance[tuple(levels.space.cells[cells].T)]
    outline = shapely.buffer(room.polygon, -0.05)
    shapely.prepare(outline)
    chosen = [_middle(points, clearance, room)]
    unseen = points[:: max(1, len(points) // 400)]
    few = 0.03 * len(unseen)
    unseen = _hidden(unseen, points[chosen[0]], outline, view)
    while len(unseen) > few:
        midst = unseen[np.argmin(np.linalg.norm(unseen - np.median(unseen, axis=0), axis=1))]
        chosen.append(_roomy_near(points, clearance, midst))
        unseen = unseen[np.linalg.norm(unseen - midst, axis=1) > 1.0]
        unseen = _hidden(unseen, points[chosen[-1]], outline, view)
    return np.unique(cells[chosen])


def _middle(points: Array, clearance: Array, room: Room) -> int:
    """The roomy cell nearest to the middle of the outline."""
    off_middle = np.linalg.norm(points - np.asarray(room.polygon.centroid.coords[0]), axis=1)
    return int(np.argmin(np.where(clearance >= 0.7 * clearance.max(), off_middle, np.inf)))


def _hidden(samples: Array, eye: Array, outline: Polygon, view: float) -> Array:
    """The samples (N, 2) that are farther than ``view`` from ``eye`` or behind a corner."""
    lines = np.stack([np.broadcast_to(eye, samples.shape), samples], axis=1)
    near = np.linalg.norm(samples - eye, axis=1) <= view
    return samples[~(near & shapely.covers(outline, shapely.linestrings(lines)))]


def _roomy_near(points: Array, clearance: Array, place: Array) -> int:
    """The cell with most room about it within 1 m of a place."""
    distances = np.linalg.norm(points - place, axis=1)
    liked = np.where(distances <= distances.min() + 1.0, clearance - 0.1 * distances, -np.inf)
    return int(np.argmax(liked))
