"""Worker processes of this machine. One that dies takes nothing but its current job with it."""

from __future__ import annotations

import multiprocessing
import os
import signal
import threading
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from multiprocessing import connection
from multiprocessing.connection import Connection
from multiprocessing.process import BaseProcess
from pathlib import Path

from eval.sweep.job import Job
from eval.sweep.work import Done, runner_named, work
from slam.core import RunError, cores, thread_limit

THREAD_VARIABLES = (
    *("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"),
    *("NUMEXPR_NUM_THREADS", "VECLIB_MAXIMUM_THREADS"),
)
"""What OpenMP (torch, open3d), the BLAS libraries and our own stages (``thread_limit``) obey."""

FALSE_STARTS = 3
"""Workers in a row that may die before they are ready."""


class _Worker:
    """A process, our end of the pipe to it, and the job that it has."""

    def __init__(self, runner: str, scratch: Path, environment: Mapping[str, str]):
        # Spawned, not forked: a fork copies locked locks of the libraries' threads.
        context = multiprocessing.get_context("spawn")
        self.pipe, theirs = context.Pipe()
        self.process: BaseProcess = context.Process(
            target=_serve, args=(theirs, runner, scratch), daemon=True
        )
        with _environment(environment):
            self.process.start()
        theirs.close()
        self.ready = False
        self.job: Job | None = None

    def give(self, job: Job) -> None:
        self.job = job
        # If it is dead, ``take`` will find so.
        with suppress(OSError):
            self.pipe.send(job)

    def take(self) -> Done | None:
        """What the worker sent; None if that was only that it is ready. EOFError if it died."""
        try:
            message = self.pipe.recv()
        except OSError as error:
            raise EOFError from error
        if message is None:
            self.ready = True
            return None
        assert isinstance(message, Done)
        self.job = None
        return message

    def end(self) -> None:
        self.process.kill()
        self.process.join()
        self.pipe.close()


class LocalWorkers:
    """So many processes, each with its share of the cores' threads."""

    def __init__(self, size: int, runner: str, scratch: Path):
        threads = str(thread_limit(cores() // size))
        self._make = (runner, scratch, dict.fromkeys(THREAD_VARIABLES, threads))
        self._false_starts = 0
        scratch.mkdir(exist_ok=True)
        self._workers = [_Worker(*self._make) for _ in range(size)]

    @property
    def size(self) -> int:
        """Runs that go on at once."""
        return len(self._workers)

    @property
    def idle(self) -> int:
        """Jobs that could be given now."""
        return sum(worker.job is None for worker in self._workers)

    def give(self, job: Job) -> None:
        """Starts a job; there must be an idle worker."""
        next(worker for worker in self._workers if worker.job is None).give(job)

    def wait(self) -> Sequence[Done]:
        """Answers, as soon as there are some. Raises RunError if no worker can be started."""
        while True:
            pipes = {worker.pipe: place for place, worker in enumerate(self._workers)}
            found = [self._answer(pipes[pipe]) for pipe in connection.wait(list(pipes))]  # type: ignore[index]
            answers = [done for done in found if done is not None]
            if answers:
                return answers

    def _answer(self, place: int) -> Done | None:
        worker = self._workers[place]
        try:
            done = worker.take()
        except EOFError:
            return self._replace(place)
        self._false_starts = 0
        return done

    def _replace(self, place: int) -> Done | None:
        """A new worker for one that died; the job that is lost, if it had one."""
        worker = self._workers[place]
        worker.end()
        self._false_starts += not worker.ready
        if self._false_starts >= FALSE_STARTS:
            raise RunError(f"workers die as they start (exit code {worker.process.exitcode})")
        self._workers[place] = _Worker(*self._make)
        if not worker.ready and worker.job is not None:
            self._workers[place].give(worker.job)
            return None
        return None if worker.job is None else Done(worker.job, None)

    def close(self) -> None:
        """Ends all processes, whatever they do."""
        for worker in self._workers:
            worker.end()


@contextmanager
def _environment(variables: Mapping[str, str]) -> Iterator[None]:
    """Variables that a process started now begins with."""
    before = {name: os.environ.get(name) for name in variables}
    os.environ.update(variables)
    try:
        yield
    finally:
        for name, value in before.items():
            if value is None:
                del os.environ[name]
            else:
                os.environ[name] = value


# --- in the worker's process ----------------------------------------------------------------------


def _serve(pipe: Connection, runner: str, scratch: Path) -> None:
    """Does jobs until the pipe closes."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    _die_with_the_parent()
    runner_named(runner)
    try:
        pipe.send(None)
        while True:
            pipe.send(work(pipe.recv(), runner, scratch))
    except (EOFError, OSError):
        return


def _die_with_the_parent() -> None:
    """Ends this process, in the midst of a run if need be, when the sweep's own is gone."""
    parent = multiprocessing.parent_process()
    assert parent is not None

    def watch() -> None:
        connection.wait([parent.sentinel])
        os._exit(1)

    threading.Thread(target=watch, daemon=True).start()
