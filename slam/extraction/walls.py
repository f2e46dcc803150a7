"""Walls: upright planes through the runs of several beams."""

from __future__ import annotations

import numpy as np

from slam.core import IntArray, PlaneObservation, plane_axes
from slam.extraction.config import ExtractionConfig
from slam.extraction.fit import Noise, Prior, fit_plane, thin
from slam.extraction.groups import wall_groups
from slam.extraction.moments import Lines
from slam.extraction.offsets import BeamOffsets
from slam.extraction.runs import Runs
from slam.extraction.sweep import Sweep


def wall_planes(
    sweep: Sweep, runs: Runs, offsets: BeamOffsets, config: ExtractionConfig
) -> list[PlaneObservation]:
    """Of a sweep without floor and ceiling, and its runs."""
    runs = offsets.taken_off(runs)
    planes = []
    for members in wall_groups(runs, config):
        if runs.count[members].sum() >= config.min_points:
            wall = _wall(sweep, runs, members, offsets, config)
            planes += [] if wall is None else [wall]
    return planes


def _wall(
    sweep: Sweep,
    runs: Runs,
    members: IntArray,
    offsets: BeamOffsets,
    config: ExtractionConfig,
) -> PlaneObservation | None:
    """The plane through a group of runs; None where it is too small, or leans like none."""
    line = Lines(runs.moments[members].sum(axis=0, keepdims=True))
    u, mean = line.direction[0], line.mean[0]
    places = np.concatenate([np.arange(runs.start[m], runs.stop[m]) for m in members])
    xyz = offsets.exact(sweep, places)
    if np.ptp(xyz[:, :2] @ u) < config.min_length:
        return None
    n = np.array([u[1], -u[0]])
    n = -n if n @ mean > 0.0 else n
    frame = np.array([[-n[1], n[0], 0.0], [0.0, 0.0, 1.0], [n[0], n[1], 0.0]])
    lean = float(n @ offsets.tilt)
    prior = Prior(np.array([0.0, lean]), np.array([0.0, config.plumb_sigma**-2.0]))
    noise = Noise(runs.noise, np.maximum(offsets.sigma, config.rest_sigma), config.stretch)
    plane = fit_plane(xyz, sweep.ring[places], frame, sweep.origin, noise, prior, config)
    if abs(plane.normal[2] + lean) > np.sin(config.max_lean):
        return None
    off = (xyz - plane.centroid) @ plane.normal
    places = places[np.abs(off) < 3.0 * runs.noise + 2.0 * config.rest_sigma]
    if len(places) < config.min_points:
        return None
    keep = places[thin(sweep.xyz[places], *plane_axes(plane.normal), config.thin)]
    return PlaneObservation(
        normal=plane.normal,
        d=float(-plane.normal @ plane.centroid),
        centroid=plane.centroid,
        covariance=plane.covariance,
        points=sweep.xyz[keep],
        point_index=sweep.place[keep],
    )
