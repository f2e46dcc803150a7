"""Planes through returns, and how well they are known."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from slam.core import Array, IntArray
from slam.extraction.config import ExtractionConfig


@dataclass(frozen=True)
class Prior:
    """Of a plane's two slopes: (2,) expected values, and (2,) information [1/rad^2]."""

    slopes: Array
    information: Array


@dataclass(frozen=True)
class Noise:
    """Standard deviations [m]: point: of a range; beam: (B,) of what is common to a beam's ranges.
    stretch: how long a wall is straight [m]."""

    point: float
    beam: Array
    stretch: float


@dataclass(frozen=True)
class FittedPlane:
    """normal: (3,), centroid: (3,) on the plane, covariance: (3, 3) as ``PlaneObservation``."""

    normal: Array
    centroid: Array
    covariance: Array


MOST = 2000
"""So many of the points are fitted to, evenly; they stand for the others."""


def fit_plane(
    xyz: Array,
    ring: NDArray[np.int16],
    frame: Array,
    origin: Array,
    noise: Noise,
    prior: Prior,
    config: ExtractionConfig,
) -> FittedPlane:
    """A plane through points (N, 3), as a mixed model.

    frame: rows u, v, w with w near the normal; the plane is w = w0 + a u + b v. Every point has its
    own error along its ray and across it; every beam has one of its range that its points share;
    and the wall itself is off by some millimetres from stretch to stretch, for all beams alike.
    Without the last, what is farther up on the wall where a beam meets it farther away would lean.
    """
    share = max(1, len(xyz) // MOST)
    base = xyz.mean(axis=0)
    xyz, ring = xyz[::share], ring[::share]
    u, v, w = frame @ (xyz - base).T
    rays = xyz - origin
    reach = np.linalg.norm(rays, axis=1)
    facing = rays @ frame[2] / reach
    beams, beam = np.unique(ring, return_inverse=True)
    stretches, stretch = np.unique(np.floor(u / noise.stretch), return_inverse=True)
    row = np.arange(len(xyz))
    design = np.zeros((len(xyz), 3 + len(beams) + len(stretches)))
    design[:, 0], design[:, 1], design[:, 2] = u, v, 1.0
    design[row, 3 + beam] = facing
    design[row, 3 + len(beams) + stretch] = 1.0
    variance = (noise.point * facing) ** 2 + (reach * config.motion_sigma) ** 2
    weighted = design * (share / variance)[:, None]
    information = weighted.T @ design
    right = weighted.T @ w
    common = np.full(len(stretches), config.wave_sigma**-2.0)
    information += np.diag([*prior.information, 1e-6, *noise.beam[beams] ** -2.0, *common])
    right[:2] += prior.information * prior.slopes
    a, b, w0 = np.linalg.solve(information, right)[:3]
    normal = np.array([-a, -b, 1.0]) @ frame
    covariance = _known_at_best(np.linalg.inv(information)[:3, :3])
    return FittedPlane(normal / np.linalg.norm(normal), base + w0 * frame[2], covariance)


def _known_at_best(covariance: Array) -> Array:
    """Adds what no count of points averages away: 6 mm of offset, 0.1 degrees of direction, most
    of it what is left of the motion within the sweep."""
    floor = np.diag([np.radians(0.1) ** 2, np.radians(0.1) ** 2, 0.006**2])
    return np.asarray(covariance + floor)


def thin(xyz: Array, first: Array, second: Array, voxel: float) -> IntArray:
    """Places of one point per cell of a grid laid on the plane of two axes."""
    u = np.floor((xyz @ first) / voxel).astype(np.int64)
    v = np.floor((xyz @ second) / voxel).astype(np.int64)
    _, places = np.unique((u - u.min()) * (1 << 24) + (v - v.min()), return_index=True)
    return np.sort(places)
