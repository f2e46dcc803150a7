"""A recording as the source of a run's scans, with as much truth as came with it."""

from __future__ import annotations

import logging
from collections.abc import Iterator

import numpy as np

from eval.recordings.labels import LabelsFile
from eval.recordings.recording import Recording, poses_at
from eval.score.trajectory import Trajectory
from sim.truth import ScanTruth
from slam.core import Array, InputError, Scan
from worlds.truth import NO_FACE

logger = logging.getLogger(__name__)


class RecordedDrive:
    """(Scan, ScanTruth) pairs of a recording; ``duration``: seconds of it (None: all).

    From labels comes the whole truth; from poses only T_world_base, and where nobody knows, NaN.
    Raises InputError while iterating where labels and scans do not fit.
    """

    def __init__(
        self, recording: Recording, duration: float | None, labels: LabelsFile | None
    ) -> None:
        self._recording = recording
        self._labels = labels
        self._limit = np.inf if duration is None else duration
        whole = recording.duration
        self.duration = min(self._limit, np.inf if whole is None else whole)

    @property
    def skipped(self) -> int:
        """Bad scans left out so far."""
        return self._recording.skipped

    def __iter__(self) -> Iterator[tuple[Scan, ScanTruth]]:
        start: float | None = None
        for scan in self._recording:
            if start is None:
                start = scan.stamp + float(np.min(scan.times, initial=0.0))
            if scan.stamp - start > self._limit + 1e-9:
                break
            yield scan, self._truth(scan)
        if self.skipped:
            logger.warning("%s: %d bad scans skipped", self._recording.path, self.skipped)

    def _truth(self, scan: Scan) -> ScanTruth:
        if self._labels is None:
            nobody_knows = np.full((len(scan), 3), np.nan, dtype=np.float32)
            nothing = np.full(len(scan), NO_FACE, dtype=np.int32)
            pose = _pose_at(self._recording.truth, scan.stamp)
            return ScanTruth(pose, nothing, nothing, nobody_knows)
        truth = self._labels.at(scan.stamp)
        if len(truth.face) != len(scan):
            raise InputError(
                f"{self._labels.path}: {len(truth.face)} labels for the {len(scan)} points of the "
                f"scan at {scan.stamp:.3f} s"
            )
        return truth


def _pose_at(truth: Trajectory | None, stamp: float) -> Array:
    unknown = np.full((4, 4), np.nan)
    if truth is None:
        return unknown
    poses, known = poses_at(truth, np.array([stamp]))
    return poses[0] if known[0] else unknown
