"""The rays of a sweep, each from where the sensor was when it was shot."""

from __future__ import annotations

import numpy as np

from sim.caster import Rays
from sim.motion import Motion
from sim.sensor import Sensor
from slam.core import Array

COLUMNS = 8
"""A sector has at most so many columns: over 0.5 ms, rotation vectors add up to 1e-7 rad."""


class Sectors:
    """Cuts sweeps of a sensor into sectors; each begins at a pose of its own and is blended into
    the pose of the next, shot by shot.

    A shot's direction splits into the turn of the head at its sector's beginning and a small one
    since, so that all rays are one product: the sectors' axes and origins and how they change, and
    the shots' weights on those, which are the same in every sector.
    """

    def __init__(self, sensor: Sensor) -> None:
        within = max(n for n in range(1, COLUMNS + 1) if sensor.columns % n == 0)
        count = sensor.columns // within
        self._sensor = sensor
        self._starts = sensor.column_times[::within]
        self._azimuth = np.pi + within * sensor.column_step * np.arange(count, dtype=np.float64)
        order = sensor.firing_order
        columns = np.arange(within)[:, None]
        offsets = np.asarray(sensor.firing_offsets)[order] * sensor.rate * sensor.columns
        passed = columns + offsets
        azimuth = passed * sensor.column_step + np.asarray(sensor.azimuth_offsets)[order]
        elevation = np.broadcast_to(np.asarray(sensor.elevations)[order], azimuth.shape)
        level = np.cos(elevation)
        axes = np.stack([level * np.cos(azimuth), level * np.sin(azimuth), np.sin(elevation)])
        weights, blend = axes.reshape(3, -1), (passed / within).ravel()
        table = np.concatenate([weights, blend * weights, [np.ones_like(blend), blend]])
        self._weights = np.ascontiguousarray(table.T, dtype=np.float32)

    def rays(self, motion: Motion, stamp: float, phase: float) -> Rays:
        """(C * B, 6) world frame, in the order of firing; ``motion`` of the sensor covers the sweep
        that ends at ``stamp``, whose head is ``phase`` [rad] ahead."""
        rotations, translations = motion.at(stamp + self._starts)
        axes = _head_axes(rotations[:-1], self._azimuth + phase)
        frames = np.zeros((len(axes), 8, 6), dtype=np.float32)
        frames[:, :3, 3:] = axes
        frames[:, 3:6, 3:] = _head_axes(rotations[1:], self._azimuth + phase) - axes
        frames[:, 6, :3] = translations[:-1]
        frames[:, 7, :3] = translations[1:] - translations[:-1]
        return (self._weights @ frames).reshape(-1, 6)


def _head_axes(rotations: Array, azimuth: Array) -> Array:
    """(S, 3, 3) axes (rows) of a head turned by ``azimuth`` (S,) within rotations (S, 3, 3)."""
    c, s = np.cos(azimuth)[:, None], np.sin(azimuth)[:, None]
    x, y = rotations[:, :, 0], rotations[:, :, 1]
    return np.stack([c * x + s * y, c * y - s * x, rotations[:, :, 2]], axis=1)
