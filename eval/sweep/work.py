"""What a worker does with a job, wherever it is."""

from __future__ import annotations

import errno
import importlib
import tempfile
import time
import traceback
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from pathlib import Path

from eval.config import RunConfig
from eval.metrics import Metrics
from eval.outputs import read_metrics
from eval.sweep.job import Job, Row
from slam.core import RoomloopError

RUN_ONE = "eval.sweep.work:run_one"
"""The function that a worker calls for each run, as ``module:name``."""

OF_THE_MACHINE = (errno.ENOSPC, errno.EDQUOT, errno.EROFS, errno.EIO, errno.EMFILE, errno.ENFILE)
"""Errors that say nothing of the run: another try, with room on the disk, may go well."""


@dataclass(frozen=True)
class Done:
    """A worker's answer. row: None if the worker died, or if the machine failed it (``halt``)."""

    job: Job
    row: Row | None
    halt: str | None = None


class FailedRun(Exception):
    """A run that failed, with what could be scored of it."""

    def __init__(self, error: str, metrics: Metrics | None):
        super().__init__(error)
        self.metrics = metrics


def run_one(config: RunConfig) -> Metrics:
    """The metrics of a run, of which nothing else is kept. Raises FailedRun."""
    from eval.run import run

    try:
        return run(config).metrics
    except RoomloopError as error:
        if _machine_error(error) is not None:
            raise
        file = config.folder / "metrics.json"
        metrics = read_metrics(file) if file.exists() else None
        raise FailedRun(" ".join(str(error).split()), metrics) from error


def runner_named(name: str) -> Callable[[RunConfig], Metrics]:
    """The function behind ``module:name``."""
    module, _, function = name.partition(":")
    made: Callable[[RunConfig], Metrics] = getattr(importlib.import_module(module), function)
    return made


def work(job: Job, runner: str = RUN_ONE, scratch: Path | None = None) -> Done:
    """Does a job. Never raises: whatever goes wrong is in the row, or halts the sweep.

    scratch: where the run's files go until they are deleted; None: the system's place.
    """
    started = time.perf_counter()

    def row(status: str, error: str | None, metrics: Metrics | None) -> Done:
        return Done(job, Row(job.config, status, error, time.perf_counter() - started, metrics))

    try:
        with tempfile.TemporaryDirectory(prefix="roomloop-", dir=scratch) as place:
            config = replace(job.config, out=Path(place) / "run", save=False)
            return row("complete", None, runner_named(runner)(config))
    except FailedRun as failed:
        return row("failed", str(failed), failed.metrics)
    except Exception as error:
        cause = _machine_error(error)
        if cause is not None:
            return Done(job, None, f"{cause.filename or scratch}: {cause.strerror or cause}")
        return row("failed", _one_line(error), None)


def _machine_error(error: BaseException) -> OSError | None:
    """The error of the machine that is behind an error, if there is one."""
    found = (cause for cause in _causes(error) if isinstance(cause, OSError))
    return next((cause for cause in found if cause.errno in OF_THE_MACHINE), None)


def _causes(error: BaseException | None) -> Iterator[BaseException]:
    while error is not None:
        yield error
        error = error.__cause__ or error.__context__


def _one_line(error: Exception) -> str:
    """An error that nobody foresaw: its kind, its text, and where it came from."""
    last = traceback.extract_tb(error.__traceback__)[-1]
    text = " ".join(f"{type(error).__name__}: {error}".split())
    return f"{text} ({Path(last.filename).name}, line {last.lineno})"
