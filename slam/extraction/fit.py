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
class FittedPlane:
    """normal: (3,), centroid: (3,) on the plane, covariance: (3, 3) as ``PlaneObservation``."""

    normal: Array
    centroid: Array
    covariance: Array


def fit_plane(
    xyz: Array,
    ring: NDArray[np.int16],
    frame: Array,
    origin: Array,
    noise: float,
    beam_sigma: Array,
    prior: Prior,
    config: ExtractionConfig,
) -> FittedPlane:
    """A plane through points (N, 3), as a mixed model.

    frame: rows u, v, w with w near the normal; the plane is w = w0 + a u + b v. What is noisy is
    the range: every point has its own error, and every beam one that its points share. So
    residuals are taken along the rays, with a random intercept per beam. noise: of a range,
    beam_sigma: (B,) of what is common to a beam's ranges [m].
    """
    base = xyz.mean(axis=0)
    local = (xyz - base) @ frame.T
    rays = xyz - origin
    reach = np.linalg.norm(rays, axis=1)
    along = np.hypot(rays @ frame[2] / reach, reach * config.motion_sigma / noise)
    design = np.column_stack([local[:, :2], np.ones(len(xyz))]) / along[:, None]
    target = local[:, 2] / along
    beams, member = np.unique(ring, return_inverse=True)
    count = np.bincount(member).astype(np.float64)
    sums = np.stack([np.bincount(member, weights=column) for column in design.T], axis=1)
    between = np.maximum(beam_sigma[beams], config.rest_sigma) ** 2
    shared = between / (noise**2 + count * between)
    right = design.T @ target - sums.T @ (shared * np.bincount(member, weights=target))
    information = design.T @ design - (sums * shared[:, None]).T @ sums
    information, right = information / noise**2, right / noise**2
    information[:2, :2] += np.diag(prior.information)
    right[:2] += prior.information * prior.slopes
    information += 1e-6 * np.eye(3)
    a, b, w0 = np.linalg.solve(information, right)
    normal = np.array([-a, -b, 1.0]) @ frame
    covariance = _known_at_best(np.linalg.inv(information))
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
