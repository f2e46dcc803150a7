"""A simulated drive, recorded for others."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import ExitStack
from pathlib import Path

from eval.config import RunConfig
from eval.recordings.labels import LabelsWriter
from eval.recordings.writer import BagWriter
from eval.source import make_source, make_world

LABELS = "labels.npz"


def record(
    config: RunConfig,
    folder: Path,
    labels: bool = False,
    progress: Callable[[float, float], None] | None = None,
) -> int:
    """Drives through a scene as a run of ``config`` would, into a new bag in ``folder``.

    labels: write the whole truth beside it, too. Gives the number of scans. Raises InputError, and
    RunError when the base touches a wall; the bag then ends there.
    """
    world = make_world(config)
    source = make_source(config, world)
    count = 0
    with ExitStack() as files:
        bag = files.enter_context(BagWriter(folder))
        table = None
        if labels:
            table = files.enter_context(LabelsWriter(folder / LABELS, config, world.truth))
        for scan, truth in source:
            bag.write(scan, truth.T_world_base)
            if table is not None:
                table.write(scan.stamp, truth)
            count += 1
            if progress is not None:
                progress(scan.stamp, source.duration)
    return count
