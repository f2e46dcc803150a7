"""A drive that is simulated and registered ahead, in a process of its own.

Simulator and odometry together cost about what all the rest of the loop does; neither waits for it.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from functools import partial

from sim.ahead import Ahead
from sim.truth import ScanTruth
from slam.core import Array, Odometry, RoomloopError, RunError, Scan


@dataclass(frozen=True)
class _Registered:
    """A scan's pose by the odometry, or the error that it ended with; None of a scan without
    returns. seconds: wall time that it took."""

    answer: Array | RoomloopError | None
    seconds: float


_Item = tuple[Scan, ScanTruth, _Registered]


class RegisteredAhead:
    """The source of a run's scans, and their odometry: the same poses as by an odometry of its own.

    drive, odometry: make them over there, picklable by the names of their modules; duration: about
    how long it drives [s]. seconds: wall time of the registration that was asked for last.
    """

    def __init__(
        self,
        drive: Callable[[], Iterable[tuple[Scan, ScanTruth]]],
        odometry: Callable[[], Odometry],
        duration: float,
    ) -> None:
        self.duration = duration
        self.seconds = 0.0
        self._ahead: Ahead[_Item] = Ahead(partial(_registered, drive, odometry), duration)
        self._last: tuple[int, _Registered] | None = None

    def __iter__(self) -> Iterator[tuple[Scan, ScanTruth]]:
        for scan, truth, found in self._ahead:
            self._last = (scan.index, found)
            yield scan, truth

    def register(self, scan: Scan) -> Array:
        """T_odom_base (4, 4) of the scan that was given last. Raises what its odometry raised."""
        if self._last is None or self._last[0] != scan.index:
            raise RunError(f"scan {scan.index} is not the one that was registered ahead")
        found = self._last[1]
        self.seconds = found.seconds
        if isinstance(found.answer, RoomloopError):
            raise found.answer
        if found.answer is None:
            raise RunError(f"scan {scan.index}: not a single return")
        return found.answer


def _registered(
    drive: Callable[[], Iterable[tuple[Scan, ScanTruth]]], make: Callable[[], Odometry]
) -> Iterator[_Item]:
    """Over there: each scan of the drive with its pose, up to one that the odometry fails at."""
    odometry = make()
    for scan, truth in drive():
        started = time.perf_counter()
        answer: Array | RoomloopError | None = None
        if len(scan):
            try:
                answer = odometry.register(scan)
            except RoomloopError as error:
                answer = error
        yield scan, truth, _Registered(answer, time.perf_counter() - started)
        if isinstance(answer, RoomloopError):
            return
