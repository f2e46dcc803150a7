"""What every real recording looks like to a run, and the truth that may come with it."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from eval.outputs import read_tum
from eval.score.trajectory import Trajectory
from slam.core import Array, Scan, interpolate, pose


@dataclass(frozen=True)
class RecordingOptions:
    """How to read a recording.

    topic: of the point clouds in a bag (None: the only one). truth: a .tum file, or a topic of the
    bag (None: a .tum file beside the recording, else the one pose topic whose name says truth).
    T_base_lidar: (4, 4), where the sensor sat on its base (None: where the bag's static transforms
    say, else the base is the sensor).
    """

    topic: str | None = None
    truth: str | None = None
    T_base_lidar: Array | None = None


class Recording(Protocol):
    """Scans in the order of their stamps; every iteration reads anew from the start.

    count: number of scans, None where only reading tells; duration [s]: about how long it is;
    skipped: bad scans left out so far by the iteration under way; truth: poses as recorded, at
    stamps of their own (``poses_at``), or None. Iterating raises InputError when there was not a
    single good scan.
    """

    path: Path
    count: int | None
    duration: float | None
    skipped: int
    truth: Trajectory | None

    def __iter__(self) -> Iterator[Scan]:
        """The good scans."""
        ...


def truth_beside(path: Path, options: RecordingOptions) -> Trajectory | None:
    """The .tum file that the options name, or the one beside the recording: ``NAME.tum``, or
    ``truth.tum`` inside a folder."""
    if options.truth is not None:
        return read_tum(Path(options.truth)) if is_tum(options.truth) else None
    name = path / "truth.tum" if path.is_dir() else path.with_suffix(".tum")
    return read_tum(name) if name.is_file() else None


def is_tum(name: str) -> bool:
    """Whether a truth option names a file rather than a topic."""
    return name.endswith((".tum", ".txt"))


def poses_at(
    truth: Trajectory, stamps: Array, longest_gap: float = 0.5
) -> tuple[Array, NDArray[np.bool_]]:
    """Poses (N, 4, 4) of a recorded truth at other stamps (N,), and which of them are known.

    Unknown (identity) are those outside the truth and those between two of its poses that are more
    than ``longest_gap`` [s] apart.
    """
    k = np.clip(np.searchsorted(truth.stamps, stamps, "right") - 1, 0, max(len(truth) - 2, 0))
    poses = np.tile(np.eye(4), (len(stamps), 1, 1))
    known = np.zeros(len(stamps), dtype=bool)
    for i in range(len(stamps) if len(truth) > 1 else 0):
        gap = truth.stamps[k[i] + 1] - truth.stamps[k[i]]
        fraction = (stamps[i] - truth.stamps[k[i]]) / gap
        if -1e-9 <= fraction <= 1.0 + 1e-9 and gap <= longest_gap:
            known[i] = True
            rotation, translation = interpolate(
                truth.poses[k[i]], truth.poses[k[i] + 1], np.array([fraction])
            )
            poses[i] = pose(rotation[0], translation[0])
    return poses, known
