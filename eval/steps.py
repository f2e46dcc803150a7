"""The steps of a run: what the front end makes of each scan, and what of its truth is kept."""

from __future__ import annotations

import logging
import time
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from typing import Protocol

import numpy as np

from eval.labels import TruthKeeper, TruthStep
from eval.registered import RegisteredAhead
from sim.truth import ScanTruth
from slam.core import Frame, IntArray, Scan
from slam.frontend import FrontEnd

TruthFilter = Callable[[ScanTruth], ScanTruth]

_log = logging.getLogger(__name__)


@dataclass(frozen=True)
class Step:
    """One scan's way to the back end. scan: None where the front end is replayed; seconds: wall
    time by stage, of those stages that ran."""

    frame: Frame
    truth: TruthStep
    scan: Scan | None = None
    seconds: Mapping[str, float] = field(default_factory=dict)


class Source(Protocol):
    """Gives the scans of a run in order, each with its truth; duration: about how long [s]."""

    duration: float

    def __iter__(self) -> Iterator[tuple[Scan, ScanTruth]]: ...


def live_steps(
    scans: Iterable[tuple[Scan, ScanTruth]],
    frontend: FrontEnd,
    keeper: TruthKeeper,
    truth_filter: TruthFilter | None = None,
) -> Iterator[Step]:
    """Runs the front end over scans. The keeper digests; whoever takes a step hands it over to the
    keeper before the next. Sweeps without a single return are skipped, and their number is said.
    Raises what the scans and the front end raise."""
    pairs, empty = iter(scans), 0
    while True:
        started = time.perf_counter()
        pair = next(pairs, None)
        seconds = {"lidar": time.perf_counter() - started}
        if pair is None:
            break
        scan, truth = pair
        if not len(scan):
            empty += 1
            continue
        if truth_filter is not None:
            truth = truth_filter(truth)
        frame = frontend.process(scan)
        seconds |= frontend.seconds
        if isinstance(scans, RegisteredAhead):
            seconds["odometry"] += scans.seconds
        digest = keeper.digest(scan, truth, frame.keyframe is not None, _used(frame))
        yield Step(frame, digest, scan, seconds)
    if empty:
        _log.warning("sweeps without a single return, skipped: %d", empty)


def _used(frame: Frame) -> IntArray:
    """Places in the scan of those returns that planes were built from."""
    planes = () if frame.keyframe is None else frame.keyframe.planes
    return np.concatenate([np.empty(0, np.int64), *(plane.point_index for plane in planes)])
