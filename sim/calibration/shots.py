"""Every shot of a sensor at rest, returned or not: recorded or simulated."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, fields
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from sim.sensor import Sensor
from slam.core import Array, IntArray, Scan

Mask = NDArray[np.bool_]


@dataclass(frozen=True)
class Shots:
    """F firings of B beams, in the order of time, returned or not; tables are (F, B), by ring.

    directions: (F, B, 3), lidar frame; heights: (B,) of the beams' origins above the sensor's [m];
    ranges [m], 0 without a return; times [s]; intensity in [0, 1].
    """

    directions: Array
    ranges: Array
    times: Array
    intensity: Array
    heights: Array

    @property
    def returned(self) -> Mask:
        """(F, B)"""
        return self.ranges > 0.0

    @cached_property
    def azimuth(self) -> Array:
        """(F, B), counter-clockwise from x, in [-pi, pi]."""
        return np.arctan2(self.directions[..., 1], self.directions[..., 0])

    @property
    def points(self) -> Array:
        """(N, 3) of the returns, lidar frame [m]."""
        points = self.ranges[..., None] * self.directions
        points[..., 2] += self.heights
        return points[self.returned]

    def cells(self, width: float) -> IntArray:
        """(F, B) azimuths counted in steps of ``width`` [rad] from -pi."""
        return np.floor((self.azimuth + np.pi) / width).astype(np.int64)


def shots_of_scans(scans: Iterable[Scan], sensor: Sensor) -> Shots:
    """Simulated scans with the shots that gave no return put back where they were fired."""
    parts = [_shots_of_scan(scan, sensor) for scan in scans]
    names = [item.name for item in fields(Shots) if item.name != "heights"]
    tables = {name: np.concatenate([getattr(part, name) for part in parts]) for name in names}
    return Shots(heights=np.zeros(sensor.beams), **tables)


def _shots_of_scan(scan: Scan, sensor: Sensor) -> Shots:
    by_ring = np.argsort(sensor.firing_order)
    firing = np.asarray(sensor.firing_offsets)[scan.ring]
    place = (scan.times + sensor.period - firing) * sensor.rate * sensor.columns
    shot = np.rint(place).astype(np.int64), scan.ring
    directions = sensor.shot_directions[:, by_ring]
    turn = np.angle(np.mean(_bearing(scan.points) / _bearing(directions[shot])))
    turned = _bearing(directions) * np.exp(1j * turn)
    ranges, intensity = np.zeros((2, sensor.columns, sensor.beams))
    ranges[shot], intensity[shot] = np.linalg.norm(scan.points, axis=1), scan.intensity
    return Shots(
        directions=np.stack([turned.real, turned.imag, directions[..., 2]], axis=-1),
        ranges=ranges,
        times=scan.stamp + sensor.shot_times[:, by_ring],
        intensity=intensity,
        heights=np.zeros(sensor.beams),
    )


def _bearing(vectors: Array) -> NDArray[np.complex128]:
    """x + iy of vectors (..., 3)."""
    return vectors[..., 0] + 1j * vectors[..., 1]
