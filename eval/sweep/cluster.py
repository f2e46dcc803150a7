"""Workers of a Dask cluster that somebody has started: ``dask scheduler``, ``dask worker``."""

from __future__ import annotations

import logging
from collections.abc import Sequence
from contextlib import suppress
from typing import Any

from eval.names import refuse
from eval.sweep.job import Job, Row, fingerprint
from eval.sweep.work import Done, work
from slam.core import InputError, RunError

TIMEOUT = 10.0
"""How long a scheduler may take to answer [s]."""


class DaskWorkers:
    """The workers behind a scheduler's address. Raises InputError if they cannot be used.

    A job whose worker dies is given to another by Dask itself; after its ``allowed-failures``
    (3 unless configured) it has failed.
    """

    def __init__(self, address: str, runner: str):
        self._runner = runner
        self._client = _connect(address)
        try:
            _check_workers(self._client, address)
        except BaseException:
            self._client.close()
            raise
        self._jobs: dict[Any, Job] = {}

    @property
    def size(self) -> int:
        """Runs that go on at once: one a thread of each worker."""
        return max(1, sum(self._client.nthreads().values()))

    @property
    def idle(self) -> int:
        """Jobs that could be given now; some wait at the scheduler, so that no worker does."""
        return 2 * self.size - len(self._jobs)

    def give(self, job: Job) -> None:
        """Hands a job to the scheduler."""
        self._jobs[self._client.submit(work, job, self._runner, pure=False)] = job

    def wait(self) -> Sequence[Done]:
        """Answers, as soon as there are some. Raises RunError if the cluster is gone."""
        from distributed import CancelledError, wait

        with self._client.as_current(), suppress(CancelledError):
            wait(list(self._jobs), return_when="FIRST_COMPLETED")
        ended = [future for future in self._jobs if future.status != "pending"]
        return [self._answer(future) for future in ended]

    def _answer(self, future: Any) -> Done:
        job = self._jobs.pop(future)
        if future.status == "finished":
            done = future.result()
            assert isinstance(done, Done)
            return done
        if future.status == "error":
            error = " ".join(str(future.exception()).split())
            return Done(job, Row(job.config, "failed", f"its worker died: {error}", 0.0, None))
        if self._client.status == "running":  # the scheduler lost it with the worker that held it
            return Done(job, None)
        raise RunError("cluster: the connection to the scheduler is lost; what was done is kept")

    def close(self) -> None:
        """Lets go of the cluster, which goes on for others."""
        self._client.close()


def _connect(address: str) -> Any:
    try:
        from distributed import Client
    except ImportError:
        refuse("cluster: Dask is not installed: pip install 'roomloop[cluster]'")
    # It tells of every lost connection, with a trace; what matters is said by us.
    logging.getLogger("distributed").setLevel(logging.CRITICAL)
    try:
        return Client(address, timeout=TIMEOUT, set_as_default=False)
    except (OSError, ValueError, TimeoutError) as error:
        raise InputError(
            f"cluster: {address} cannot be reached, expected the address of a Dask scheduler as "
            f"tcp://HOST:8786 ({type(error).__name__}: {' '.join(str(error).split())})"
        ) from error


def _check_workers(client: Any, address: str) -> None:
    """InputError unless there are workers, all with the code and the libraries that are here."""
    if not client.nthreads():
        refuse(f"cluster: {address} has no workers, start one with: dask worker {address}")
    try:
        found = client.run(fingerprint)
    except Exception as error:
        refuse(f"cluster: roomloop cannot be used on its workers: {type(error).__name__}: {error}")
    for worker, theirs in found.items():
        if theirs != fingerprint():
            refuse(f"cluster: worker {worker} has another version of roomloop or of its libraries")
