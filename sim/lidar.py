"""One sweep of a spinning LiDAR on a moving base."""

from __future__ import annotations

from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from sim.caster import Hits, Rays
from sim.motion import Motion
from sim.sectors import Sectors
from sim.sensor import Sensor
from sim.truth import ScanTruth
from slam.core import Array, IntArray, Scan

Floats32 = NDArray[np.float32]

HALF_INTENSITY_RANGE = 20.0
"""Range [m] at which a head-on return is half as bright as a near one."""
EDGE = 0.1
"""Step in range between two neighbouring shots of a beam from which on it is an edge [m]."""
MIRROR_POWER = 40
"""What a pane mirrors back falls with this power of the cosine: to a half at 10 degrees."""
PANE_SURFACES = 8
"""Surfaces of glass that a shot passes; one that meets more is lost."""
PASSED = 1e-3
"""How far behind a pane's surface a shot goes on [m]."""


class Caster(Protocol):
    """Whatever answers rays (N, 6), world frame."""

    def cast(self, rays: Rays, fractions: NDArray[np.float32]) -> Hits:
        """First hits of the rays, each shot at a fraction (N,) of the sweep."""
        ...


class Lidar:
    """A ``sensor`` mounted at ``T_base_lidar``; ``rng`` draws its noise and nothing else.

    The same number of draws is made for every sweep, whatever it hits. Poses are in double
    precision, what a single shot measures in single: a micrometre at 10 m.
    """

    def __init__(
        self, sensor: Sensor, caster: Caster, rng: np.random.Generator, T_base_lidar: Array
    ) -> None:
        self.sensor = sensor
        self.T_base_lidar = T_base_lidar
        self._caster = caster
        self._rng = rng
        order = sensor.firing_order
        shape = (sensor.columns, sensor.beams)
        self._times = sensor.shot_times.ravel().astype(np.float32)
        self._fractions = (1.0 + self._times / sensor.period).astype(np.float32)
        directions = sensor.shot_directions.reshape(-1, 3).astype(np.float32)
        self._heads = np.hstack([np.zeros_like(directions), directions])
        self._scratch = np.empty_like(self._heads)
        self._ring = np.broadcast_to(order, shape).ravel()
        self._offset = _per_shot(sensor.range_offsets, order, shape)
        self._sigma = _per_shot(sensor.range_noise, order, shape)
        self._kept = np.float32(1.0) - _per_shot(sensor.dropout, order, shape)
        self._sectors = Sectors(sensor)

    def sweep(self, index: int, stamp: float, motion: Motion) -> tuple[Scan, ScanTruth]:
        """The sweep that ends at ``stamp``; ``motion`` of the base covers its period.

        Shots without a return are left out. The stamp is rounded to nanoseconds, points, times and
        intensities to single precision, as a driver delivers them: a recording holds the same scan.
        """
        phase = self._rng.uniform() * self.sensor.column_step if self.sensor.random_phase else 0.0
        rays = self._sectors.rays(motion.seen_from(self.T_base_lidar), stamp, phase)
        hits = self._caster.cast(rays, self._fractions)
        if hits.glass is not None:
            hits = self._through_glass(hits, hits.glass, rays)
        ranges, returned = self._measure(hits)
        ranges = ranges.take(returned)
        points = self._ends(self._heads, returned, ranges)
        scan = Scan(
            index=index,
            stamp=round(stamp, 9),
            points=(points @ _turn_about_z(phase).T).astype(np.float64),
            times=self._times.take(returned).astype(np.float64),
            ring=self._ring.take(returned),
            intensity=_intensity(ranges, hits.cosine.take(returned)).astype(np.float64),
            T_base_lidar=self.T_base_lidar,
        )
        truth = ScanTruth(
            T_world_base=motion.poses[-1],
            face=hits.face.take(returned),
            geom=hits.geom.take(returned),
            points_world=self._ends(rays, returned, ranges),
        )
        return scan, truth

    def _ends(self, rays: Rays, returned: IntArray, ranges: Floats32) -> Floats32:
        """(M, 3) where the rays that ``returned`` (M,) end, after ``ranges`` (M,).

        Into memory that is there, and one coordinate after the other: what the system must give
        anew, and rows of three in numpy, cost several times as much.
        """
        rays = rays.take(returned, axis=0, out=self._scratch[: len(returned)], mode="clip")
        ends = np.empty((len(rays), 3), dtype=np.float32)
        for axis in range(3):
            np.multiply(rays[:, 3 + axis], ranges, out=ends[:, axis])
            ends[:, axis] += rays[:, axis]
        return ends

    def _through_glass(self, hits: Hits, glass: NDArray[np.bool_], rays: Rays) -> Hits:
        """The hits of a sensor that sees through panes, all but now and then.

        One draw decides for all panes on a shot's way: what is left of it, scaled up, is as good as
        new.
        """
        chance = self._rng.random(len(glass))
        seen = hits.copy()
        on = np.flatnonzero(glass)
        for _ in range(PANE_SURFACES):
            back = self._from_pane(seen.cosine[on])
            passes = chance[on] >= back
            chance[on] = (chance[on] - back) / np.maximum(1.0 - back, 1e-12)
            on = on[passes]
            if not len(on):
                return seen
            way = seen.distance[on] + PASSED
            further = rays[on]
            further[:, :3] += way[:, None] * further[:, 3:]
            behind = self._caster.cast(further, self._fractions[on])
            _put(seen, on, behind, way)
            on = on[behind.glass] if behind.glass is not None else on[:0]
        seen.distance[on] = np.inf
        return seen

    def _from_pane(self, cosine: Floats32) -> Floats32:
        """(N,) probabilities that a surface of glass itself returns a shot."""
        return self.sensor.glass + self.sensor.glass_mirror * cosine**MIRROR_POWER

    def _measure(self, hits: Hits) -> tuple[Floats32, IntArray]:
        """Measured ranges (N,), and which shots (M,) gave a return."""
        sensor, n = self.sensor, len(self._times)
        ranges = hits.distance + self._offset
        if sensor.divergence > 0.0:
            self._mix(ranges)
        ranges += self._sigma * self._rng.standard_normal(n, dtype=np.float32)
        if sensor.range_step > 0.0:
            ranges = np.rint(ranges / sensor.range_step) * np.float32(sensor.range_step)
        kept = self._kept
        if sensor.grazing > 0.0:
            kept = kept * -np.expm1(hits.cosine / -sensor.grazing)
        returned = self._rng.random(n, dtype=np.float32) < kept
        returned &= (ranges >= sensor.min_range) & (ranges <= sensor.max_range)
        return ranges, np.flatnonzero(returned)

    def _mix(self, ranges: Floats32) -> None:
        """Mixed pixels: a shot whose footprint lies across an edge returns from in between.

        An edge lies anywhere between two neighbouring shots of one beam; within half a divergence
        of either it takes its share of that shot.
        """
        beams = self.sensor.beams  # between two shots of one
        place = self._rng.random(len(ranges) - beams, dtype=np.float32)
        with np.errstate(invalid="ignore"):  # no edge between two shots that hit nothing
            step = np.abs(ranges[beams:] - ranges[:-beams])
        edge = np.flatnonzero((step > EDGE) & (step < np.inf))
        half = 0.5 * self.sensor.divergence / abs(self.sensor.column_step)
        place = place[edge]
        first, second = ranges[edge], ranges[edge + beams]
        near, far = place < half, place > 1.0 - half
        share = 0.5 + 0.5 * place[near] / half
        ranges[edge[near]] = share * first[near] + (1.0 - share) * second[near]
        share = 0.5 + 0.5 * (1.0 - place[far]) / half
        ranges[edge[far] + beams] = share * second[far] + (1.0 - share) * first[far]


def _put(hits: Hits, rows: IntArray, behind: Hits, way: Floats32) -> None:
    """Writes what shots met after ``way`` (K,) over what they had met, at ``rows`` (K,)."""
    hits.distance[rows], hits.cosine[rows] = way + behind.distance, behind.cosine
    hits.triangle[rows], hits.face[rows] = behind.triangle, behind.face
    hits.geom[rows] = behind.geom


def _per_shot(
    table: tuple[float, ...], order: NDArray[np.int16], shape: tuple[int, int]
) -> Floats32:
    """A beam table, repeated for every column in firing order: (C * B,)."""
    return np.broadcast_to(np.asarray(table, dtype=np.float32)[order], shape).ravel()


def _turn_about_z(angle: float) -> Floats32:
    """(3, 3) rotation about z."""
    c, s = np.cos(angle), np.sin(angle)
    return np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]], dtype=np.float32)


def _intensity(ranges: Floats32, cosine: Floats32) -> Floats32:
    """Brightness in [0, 1]: Lambert's cosine, halved at ``HALF_INTENSITY_RANGE``."""
    return cosine / (1.0 + (ranges / HALF_INTENSITY_RANGE) ** 2)
