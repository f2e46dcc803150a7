"""Range offsets of the beams, and the base's tilt, from what the walls of one sweep say.

Every beam of a spinning LiDAR is off in range by a centimetre or more, by its own constant. Where
two beams run along one wall, one over the other, their distance across it is the difference of the
two offsets, and what the wall leans in the base's frame. A sweep has hundreds of such pairs in all
directions; walls a little behind one another are few among them and are outvoted.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from slam.core import Array, IntArray
from slam.extraction.config import ExtractionConfig
from slam.extraction.moments import Lines, moved, turn_between
from slam.extraction.runs import Runs
from slam.extraction.sweep import Sweep

NEIGHBOURS = 3
"""Beams are compared with so many of those above them."""
ITERATIONS = 6
LARGEST = 0.08
"""Pairs that are further apart are two walls [m]."""
ALIKE = np.radians(2.0)
"""Runs that differ more in direction are two walls [rad]."""
LEAN = np.radians(0.3)
"""How far walls are off plumb [rad]."""


@dataclass(frozen=True)
class BeamOffsets:
    """range: (B,) how much too far each beam measures [m], and sigma: (B,) how well that is known
    beside what all have in common; tilt: (2,) x and y of the direction of walls that are plumb,
    base frame, and tilt_sigma: (2,) how well those are known."""

    range: Array
    sigma: Array
    tilt: Array
    tilt_sigma: Array

    def plumb(self, surely: float) -> Array | None:
        """(3,) unit, the direction of walls that are plumb, upwards; None where that is not known
        so surely [rad]."""
        if self.tilt_sigma.max() > surely:
            return None
        up = np.append(self.tilt, 1.0)
        return np.asarray(up / np.linalg.norm(up))

    def exact(self, sweep: Sweep, places: IntArray) -> Array:
        """(M, 3) some of the returns, without their beams' offsets."""
        xyz = sweep.xyz[places]
        rays = xyz - sweep.origin
        reach = np.sqrt(np.einsum("ni,ni->n", rays, rays))
        return np.asarray(xyz - (self.range[sweep.ring[places]] / reach)[:, None] * rays)

    def taken_off(self, runs: Runs) -> Runs:
        """The runs without their beams' offsets, moved as if plumb walls stood upright."""
        mean = runs.moments[:, 1:3] / runs.count[:, None]
        reach = np.sqrt((mean**2).sum(axis=1) + runs.z**2)
        shift = -(self.range[runs.ring] / reach)[:, None] * mean - runs.z[:, None] * self.tilt
        return replace(runs, moments=moved(runs.moments, shift), sigma=self.sigma[runs.ring])


def beam_offsets(runs: Runs, beams: int, config: ExtractionConfig) -> BeamOffsets:
    """The offsets and the tilt that make the runs of a sweep agree best, robustly."""
    lines = Lines(runs.moments)
    first, second, normal = _pairs(runs, lines, config)
    if len(first) == 0:
        nothing = np.full(beams, config.beam_sigma), np.zeros(2), np.full(2, config.tilt_sigma)
        return BeamOffsets(np.zeros(beams), *nothing)
    between = lines.mean[second] - lines.mean[first]
    distance = np.einsum("pi,pi->p", between, normal)
    rise = runs.z[second] - runs.z[first]
    design = np.zeros((len(first), beams + 2))
    row = np.arange(len(first))
    design[row, runs.ring[second]] = across(runs, lines, second, normal)
    design[row, runs.ring[first]] = -across(runs, lines, first, normal)
    design[:, beams:] = normal * rise[:, None]
    variance = runs.noise**2 * (1.0 / runs.count[first] + 1.0 / runs.count[second])
    variance += config.flat_sigma**2 + (LEAN * rise) ** 2
    prior = np.diag([config.beam_sigma**-2.0] * beams + [config.tilt_sigma**-2.0] * 2)
    solution = np.zeros(beams + 2)
    for _ in range(ITERATIONS):
        chi2 = (distance - design @ solution) ** 2 / variance
        weighted = design / (variance * (1.0 + chi2 / 4.0))[:, None]
        information = weighted.T @ design + prior
        solution = np.linalg.solve(information, weighted.T @ distance)
    apart = np.eye(beams, beams + 2) - np.eye(beams + 2)[:beams].mean(axis=0)
    whole = np.linalg.inv(information)
    covariance = apart @ whole @ apart.T
    tilt_sigma = np.sqrt(np.diag(whole)[beams:])
    sigma = np.sqrt(np.diag(covariance))
    return BeamOffsets(solution[:beams], sigma, solution[beams:], tilt_sigma)


def across(runs: Runs, lines: Lines, which: IntArray, normal: Array) -> Array:
    """(P,) cosines between the rays of runs and normals (P, 2) of walls: how far a metre of range
    goes along the normal. Negative, where the normal looks at the sensor."""
    xy, z = lines.mean[which], runs.z[which]
    return np.einsum("pi,pi->p", xy, normal) / np.sqrt((xy**2).sum(axis=1) + z**2)


def _pairs(runs: Runs, lines: Lines, config: ExtractionConfig) -> tuple[IntArray, IntArray, Array]:
    """Runs of neighbouring beams, the second one above the first, that seem to lie on one wall; and
    its normal (P, 2), towards the sensor."""
    order = np.argsort(runs.ring, kind="stable")
    ring = runs.ring[order]
    low = np.searchsorted(ring, ring, side="right")
    many = np.searchsorted(ring, ring + NEIGHBOURS, side="right") - low
    first = np.repeat(np.arange(len(ring)), many)
    nth = np.arange(len(first)) - np.repeat(np.cumsum(many) - many, many)
    first, second = order[first], order[np.repeat(low, many) + nth]
    alike = turn_between(lines.angle[first], lines.angle[second]) < ALIKE
    first, second = first[alike], second[alike]
    half = np.sqrt(3.0 * lines.spread / lines.weight)
    longer = np.where(half[first] > half[second], first, second)
    along = lines.direction[longer]
    normal = np.stack([-along[:, 1], along[:, 0]], axis=1)
    between = lines.mean[second] - lines.mean[first]
    shared = half[first] + half[second] - np.abs(np.einsum("pi,pi->p", between, along))
    near = np.abs(np.einsum("pi,pi->p", between, normal)) < LARGEST
    near &= shared > np.minimum(half[first], half[second])
    first, second, normal = first[near], second[near], normal[near]
    behind = np.einsum("pi,pi->p", normal, lines.mean[first]) > 0.0
    return first, second, np.where(behind[:, None], -normal, normal)
