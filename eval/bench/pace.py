"""How many times real time the simulator and an odometry make together, and the odometry stage
beside KISS-ICP's own pipeline."""

from __future__ import annotations

import time
from collections.abc import Generator, Iterable
from contextlib import closing
from dataclasses import dataclass
from functools import partial

import numpy as np

from eval.studies.odometry import Factory, StudyCase, drive
from sim.ahead import Ahead, Pair
from sim.sensorfile import sensor_named
from slam.core import InputError, Odometry, Scan
from slam.frontend import FrontEnd


@dataclass(frozen=True)
class Pace:
    """ahead: whether the drive was simulated ahead, in a process of its own; wall, waiting (for the
    simulator) and odometry: milliseconds a scan; factor: simulated time by wall time."""

    ahead: bool
    scans: int
    wall: float
    waiting: float
    odometry: float
    factor: float


def pace(case: StudyCase, make: Factory, ahead: bool) -> Pace:
    """Drives a case through an odometry, from the second scan on: the first one waits for what is
    built only once. Raises InputError if there is none."""
    source = Ahead(partial(drive, case)) if ahead else drive(case)
    odometry, waited, registered, scans = make(), 0.0, 0.0, 0
    with closing(_generator(source)) as pairs:
        next(pairs, None)
        started = time.perf_counter()
        while True:
            before = time.perf_counter()
            pair = next(pairs, None)
            between = time.perf_counter()
            if pair is None:
                break
            odometry.register(pair[0])
            waited += between - before
            registered += time.perf_counter() - between
            scans += 1
        wall = time.perf_counter() - started
    if not scans:
        raise InputError("duration: expected at least two sweeps")
    each = 1e3 / scans
    simulated = scans * sensor_named(case.sensor).period
    return Pace(ahead, scans, each * wall, each * waited, each * registered, simulated / wall)


@dataclass(frozen=True)
class StageTimes:
    """Medians over the same scans [ms]: of our odometry stage, an odometry and the tracking
    of planes behind it, and of another odometry alone."""

    scans: int
    stage: float
    other: float

    @property
    def ratio(self) -> float:
        """The stage over the other."""
        return self.stage / self.other


def stage_times(case: StudyCase, make: Factory, other: Factory) -> StageTimes:
    """Both by turns on each scan of a case. Raises InputError if there is none."""
    frontend, alone = FrontEnd(make()), other()
    times = [_both(frontend, alone, scan) for scan, _ in drive(case)]
    if not times:
        raise InputError("duration: expected at least one sweep")
    stage, single = (1e3 * np.median(times, axis=0)).tolist()
    return StageTimes(len(times), stage, single)


def _both(frontend: FrontEnd, other: Odometry, scan: Scan) -> tuple[float, float]:
    """Seconds of our stage and of the other on a scan."""
    frontend.process(scan)
    started = time.perf_counter()
    other.register(scan)
    return frontend.seconds["odometry"], time.perf_counter() - started


def _generator(source: Iterable[Pair]) -> Generator[Pair, None, None]:
    yield from source
