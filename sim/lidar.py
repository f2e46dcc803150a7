"""One sweep of a spinning LiDAR on a moving base."""

from __future__ import annotations

from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from sim.caster import Hits
from sim.motion import Motion
from sim.sensor import Sensor
from sim.truth import ScanTruth
from slam.core import Array, IntArray, Scan

HALF_INTENSITY_RANGE = 20.0
"""Range [m] at which a head-on return is half as bright as a near one."""


class Caster(Protocol):
    """Whatever answers rays (N, 3), (N, 3), world frame."""

    def cast(self, origins: Array, directions: Array, fractions: Array) -> Hits:
        """First hits of the rays, each shot at a fraction (N,) of the sweep."""
        ...


class Lidar:
    """A ``sensor`` mounted at ``T_base_lidar``; ``rng`` draws its noise and nothing else.

    The same number of draws is made for every sweep, whatever it hits.
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
        self._times = sensor.shot_times.ravel()
        self._fractions = 1.0 + self._times / sensor.period
        self._heads = sensor.shot_directions.reshape(-1, 3)
        self._ring = np.broadcast_to(order, shape).ravel()
        self._offset = _per_shot(sensor.range_offsets, order, shape)
        self._sigma = _per_shot(sensor.range_noise, order, shape)
        self._kept = 1.0 - _per_shot(sensor.dropout, order, shape)

    def sweep(self, index: int, stamp: float, motion: Motion) -> tuple[Scan, ScanTruth]:
        """The sweep that ends at ``stamp``; ``motion`` of the base covers its period.

        Shots without a return are left out.
        """
        phase = self._rng.uniform() * self.sensor.column_step if self.sensor.random_phase else 0.0
        T_lidar_head = _turn_about_z(phase)
        lidar_motion = motion.seen_from(self.T_base_lidar)
        origins, directions = self._rays(lidar_motion.seen_from(T_lidar_head), stamp)
        hits = self._caster.cast(origins, directions, self._fractions)
        ranges, returned = self._measure(hits)
        r = ranges.take(returned)[:, None]
        heads = self._heads.take(returned, axis=0)
        scan = Scan(
            index=index,
            stamp=stamp,
            points=r * (heads @ T_lidar_head[:3, :3].T),
            times=self._times.take(returned),
            ring=self._ring.take(returned),
            intensity=_intensity(r[:, 0], hits.cosine.take(returned)),
            T_base_lidar=self.T_base_lidar,
        )
        away = r * directions.take(returned, axis=0)
        truth = ScanTruth(
            T_world_base=motion.poses[-1],
            face=hits.face.take(returned),
            geom=hits.geom.take(returned),
            points_world=(origins.take(returned, axis=0) + away).astype(np.float32),
        )
        return scan, truth

    def _rays(self, motion: Motion, stamp: float) -> tuple[Array, Array]:
        """World origins and directions (C * B, 3), each shot from the pose of its own instant.

        Poses are found for the columns; between two columns, 56 us apart, they are blended.
        """
        sensor = self.sensor
        rotations, translations = motion.at(stamp + sensor.column_times)
        offsets = np.asarray(sensor.firing_offsets)[sensor.firing_order]
        blend = (offsets * sensor.rate * sensor.columns)[None, :, None]
        heads = sensor.shot_directions
        now = heads @ np.swapaxes(rotations[:-1], 1, 2)
        change = heads @ np.swapaxes(rotations[1:] - rotations[:-1], 1, 2)
        step = (translations[1:] - translations[:-1])[:, None]
        origins = translations[:-1, None] + blend * step
        return origins.reshape(-1, 3), (now + blend * change).reshape(-1, 3)

    def _measure(self, hits: Hits) -> tuple[Array, IntArray]:
        """Measured ranges (N,), and which shots (M,) gave a return."""
        sensor = self.sensor
        n = len(self._times)
        ranges = hits.distance + self._offset
        ranges += self._sigma * self._rng.standard_normal(n, dtype=np.float32)
        if sensor.range_step > 0.0:
            ranges = np.round(ranges / sensor.range_step) * sensor.range_step
        kept = self._kept
        if sensor.grazing > 0.0:
            kept = kept * (1.0 - np.exp(-hits.cosine / sensor.grazing))
        returned = self._rng.random(n, dtype=np.float32) < kept
        returned &= (ranges >= sensor.min_range) & (ranges <= sensor.max_range)
        return ranges, np.flatnonzero(returned)


def _per_shot(table: tuple[float, ...], order: NDArray[np.int16], shape: tuple[int, int]) -> Array:
    """A beam table, repeated for every column in firing order: (C * B,)."""
    return np.broadcast_to(np.asarray(table)[order], shape).ravel()


def _turn_about_z(angle: float) -> Array:
    """(4, 4) rotation about z."""
    T = np.eye(4)
    T[:2, :2] = [[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]]
    return T


def _intensity(ranges: Array, cosine: Array) -> Array:
    """Brightness in [0, 1]: Lambert's cosine, halved at ``HALF_INTENSITY_RANGE``."""
    return cosine / (1.0 + (ranges / HALF_INTENSITY_RANGE) ** 2)
