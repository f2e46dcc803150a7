"""The scene of a recording, so that a preset can be put where the real sensor stood."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from sim.calibration.shots import Shots, shots_of_scans
from sim.caster import Hits, Rays
from sim.lidar import Lidar
from sim.motion import Motion
from sim.sensor import Sensor
from slam.core import Array, InputError

CELL = np.radians(0.6)
"""Width of a direction whose ranges are taken together: several shots a turn."""
SOLID = 0.5
"""Share of a direction's shots that must have returned for there to be a surface."""
SAME_SURFACE = 0.3
"""Step in range [m] up to which two neighbouring directions see one surface."""


class Twin:
    """Answers rays from a sensor at the origin by what each beam of a recording saw there.

    A direction's range is the median of what returned from it over all turns, without the beam's
    own offset; where hardly anything returned there is no surface. So what comes back from a
    simulated sensor has the recording's walls, things and holes, and errors of its own.
    offsets: (B,) of the recorded beams [m], NaN where they are not known.
    """

    def __init__(self, shots: Shots, offsets: Array) -> None:
        elevations = np.arcsin(shots.directions[0, :, 2])
        self._sines = np.sin(0.5 * (elevations[1:] + elevations[:-1]))
        self._ranges = _median_ranges(shots) - np.nan_to_num(offsets)[:, None]

    def cast(self, rays: Rays, fractions: NDArray[np.float32] | None = None) -> Hits:
        """What rays (N, 6) from the origin meet; everything is met head-on."""
        directions = rays[:, 3:].astype(np.float64)
        beam = np.searchsorted(self._sines, directions[:, 2])
        azimuth = np.arctan2(directions[:, 1], directions[:, 0])
        place = (azimuth + np.pi) / (2.0 * np.pi) * self._ranges.shape[1] - 0.5
        left = np.floor(place).astype(np.int64)
        share = place - left
        near, far = (self._ranges[beam, (left + i) % self._ranges.shape[1]] for i in (0, 1))
        with np.errstate(invalid="ignore"):  # two holes side by side
            one_surface = np.abs(far - near) < SAME_SURFACE
            between = (1.0 - share) * near + share * far
        nearest = np.where(share < 0.5, near, far)
        nothing = np.zeros(len(beam), dtype=np.int32)
        distance = np.where(one_surface, between, nearest).astype(np.float32)
        head_on = np.ones(len(beam), dtype=np.float32)
        return Hits(distance, head_on, nothing, nothing, nothing)


def simulated_twin(shots: Shots, offsets: Array, sensor: Sensor, rng: np.random.Generator) -> Shots:
    """What ``sensor`` would have recorded in the place and the time of a recording.

    Raises InputError for a sensor with other beams.
    """
    if shots.ranges.shape[1] != sensor.beams:
        raise InputError(
            f"sensor {sensor.name} has {sensor.beams} beams, the recording {shots.ranges.shape[1]}"
        )
    lidar = Lidar(sensor, Twin(shots, offsets), rng, np.eye(4))
    turns = max(round(float(np.ptp(shots.times)) * sensor.rate), 1)
    ends = sensor.period * (1.0 + np.arange(turns))
    still = np.stack([np.eye(4)] * 2)
    scans = (
        lidar.sweep(i, end, Motion(np.array([end - sensor.period, end]), still))[0]
        for i, end in enumerate(ends)
    )
    return shots_of_scans(scans, sensor)


def _median_ranges(shots: Shots) -> Array:
    """(B, cells) [m], inf for holes."""
    cells = round(2.0 * np.pi / CELL)
    place = np.minimum(shots.cells(2.0 * np.pi / cells), cells - 1)
    table = np.full((shots.ranges.shape[1], cells), np.inf)
    for beam, (ranges, cell) in enumerate(zip(shots.ranges.T, place.T, strict=True)):
        order = np.lexsort((ranges, cell))
        starts = np.searchsorted(cell[order], np.arange(cells + 1))
        tried = np.diff(starts)
        returned = np.bincount(cell, ranges > 0.0, cells).astype(np.int64)
        solid = np.flatnonzero(returned > SOLID * tried)
        # Shots without a return come first among the sorted ones: their range is 0.
        middle = starts[solid] + tried[solid] - returned[solid] + returned[solid] // 2
        table[beam, solid] = ranges[order][middle]
    return table
