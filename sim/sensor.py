"""A spinning LiDAR as data: what fires when, how far it sees, and how far it is off."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from slam.core import Array, InputError


@dataclass(frozen=True)
class Sensor:
    """A unit. Tables run parallel, one entry a beam, counted from the lowest (the ring).

    elevations [rad], rising; firing_offsets [s] within a column; azimuth_offsets [rad] of each beam
    beside its column; range_offsets [m], fixed for this unit; range_noise [m], sigma from shot to
    shot; dropout, the probability that a shot at a wall met head-on gives no return; columns per
    sweep; rate [Hz]; min_range and max_range [m]; range_step [m], what ranges are rounded to (0:
    not at all); grazing, the cosine of incidence at which 1/e of the shots is lost (0: none is);
    divergence [rad], the width within which a shot across a depth edge returns from in between (0:
    never); glass and glass_mirror, the probabilities that a pane itself returns a shot at any
    incidence, and beyond that one that meets it head-on; random_phase, whether sweeps begin at a
    random fraction of a column; clockwise, as seen from above. A sweep begins and ends behind the
    sensor.
    """

    name: str
    elevations: tuple[float, ...]
    firing_offsets: tuple[float, ...]
    azimuth_offsets: tuple[float, ...]
    range_offsets: tuple[float, ...]
    range_noise: tuple[float, ...]
    dropout: tuple[float, ...]
    columns: int = 1800
    rate: float = 10.0
    min_range: float = 0.4
    max_range: float = 100.0
    range_step: float = 0.0
    grazing: float = 0.0
    divergence: float = 0.0
    glass: float = 0.0
    glass_mirror: float = 0.0
    random_phase: bool = False
    clockwise: bool = True

    def __post_init__(self) -> None:
        _check_tables(self)
        _check_scalars(self)

    @property
    def beams(self) -> int:
        """Number of beams."""
        return len(self.elevations)

    @property
    def period(self) -> float:
        """Duration of one sweep [s]."""
        return 1.0 / self.rate

    @property
    def column_step(self) -> float:
        """Turn between two columns [rad], signed by the sense of rotation."""
        return (-2.0 if self.clockwise else 2.0) * np.pi / self.columns

    @cached_property
    def firing_order(self) -> NDArray[np.int16]:
        """(B,) rings in the order in which they fire."""
        return np.argsort(np.asarray(self.firing_offsets), kind="stable").astype(np.int16)

    @cached_property
    def column_times(self) -> Array:
        """(C + 1,) when each column begins, seconds before the sweep's end; the last is the end."""
        return (np.arange(self.columns + 1) / self.columns - 1.0) * self.period

    @cached_property
    def shot_times(self) -> Array:
        """(C, B) firing instants, seconds before the sweep's end, beams in firing order."""
        offsets = np.asarray(self.firing_offsets)[self.firing_order]
        return self.column_times[:-1, None] + offsets

    @cached_property
    def shot_directions(self) -> Array:
        """(C, B, 3) unit directions, lidar frame at phase 0, beams in firing order.

        The head turns on while a column fires, so the beams of one column stand aslant.
        """
        turned = (self.shot_times + self.period) * self.rate * 2.0 * np.pi
        sign = -1.0 if self.clockwise else 1.0
        azimuth = np.pi + sign * turned + np.asarray(self.azimuth_offsets)[self.firing_order]
        elevation = np.asarray(self.elevations)[self.firing_order]
        level = np.cos(elevation)
        z = np.broadcast_to(np.sin(elevation), azimuth.shape)
        return np.stack([level * np.cos(azimuth), level * np.sin(azimuth), z], axis=-1)


def _check_tables(sensor: Sensor) -> None:
    if not sensor.elevations:
        raise InputError(f"sensor {sensor.name}: elevations is empty, expected one entry a beam")
    for field in (
        "elevations",
        "firing_offsets",
        "azimuth_offsets",
        "range_offsets",
        "range_noise",
        "dropout",
    ):
        table = np.asarray(getattr(sensor, field), dtype=np.float64)
        if table.shape != (sensor.beams,):
            raise InputError(
                f"sensor {sensor.name}: {field} has {table.size} entries, "
                f"expected {sensor.beams}, one a beam"
            )
        if not np.isfinite(table).all():
            raise InputError(f"sensor {sensor.name}: {field} holds a value that is not finite")
    _check_table_values(sensor)


def _check_table_values(sensor: Sensor) -> None:
    column = 1.0 / (sensor.rate * sensor.columns) if sensor.rate > 0 < sensor.columns else np.inf
    rising = bool(np.all(np.diff(sensor.elevations) > 0.0))
    checks = {
        "elevations: expected to rise from beam to beam": rising,
        "elevations: expected within +-90 degrees": max(map(abs, sensor.elevations)) < np.pi / 2,
        "firing_offsets: expected within one column": min(sensor.firing_offsets) >= 0.0
        and max(sensor.firing_offsets) < column,
        "range_noise: expected no negative sigma": min(sensor.range_noise) >= 0.0,
        "dropout: expected probabilities in [0, 1]": min(sensor.dropout) >= 0.0
        and max(sensor.dropout) <= 1.0,
    }
    _refuse(sensor, checks)


def _check_scalars(sensor: Sensor) -> None:
    ranges = (sensor.min_range, sensor.max_range, sensor.range_step)
    optics = (sensor.grazing, sensor.divergence, sensor.glass, sensor.glass_mirror)
    step = 2.0 * np.pi / max(sensor.columns, 1)
    checks = {
        "expected finite numbers": bool(np.isfinite((sensor.rate, *ranges, *optics)).all()),
        "rate: expected more than 0 Hz": sensor.rate > 0.0,
        "columns: expected at least 1": sensor.columns >= 1,
        "min_range, max_range: expected 0 <= min < max": 0.0 <= sensor.min_range < sensor.max_range,
        "range_step: expected 0 or more": sensor.range_step >= 0.0,
        "grazing: expected 0 or more": sensor.grazing >= 0.0,
        "divergence: expected 0 to the step between two columns": 0.0 <= sensor.divergence <= step,
        "glass, glass_mirror: expected probabilities with a sum of at most 1": min(optics[2:])
        >= 0.0
        and sum(optics[2:]) <= 1.0,
    }
    _refuse(sensor, checks)


def _refuse(sensor: Sensor, checks: Mapping[str, bool]) -> None:
    for what, good in checks.items():
        if not good:
            raise InputError(f"sensor {sensor.name}: {what}")
