"""Runs all that has not been run yet, on the workers that there are, and keeps every result."""

from __future__ import annotations

import shutil
import time
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from functools import cache
from pathlib import Path
from typing import Protocol

from eval.artefact import artefact_path
from eval.config import RunConfig
from eval.names import refuse
from eval.source import SPEED
from eval.sweep.forecast import ROOM_S, Cost, Forecast
from eval.sweep.job import Job, Row
from eval.sweep.pool import LocalWorkers
from eval.sweep.store import Store, open_store
from eval.sweep.work import RUN_ONE, Done
from slam.core import InputError, cores
from worlds.catalogue import load_scene

TRIES = 3
"""How often a run is tried whose worker dies."""


@dataclass(frozen=True)
class SweepConfig:
    """folder: of the results; workers: processes of this machine (None: one a core); cluster:
    address of a Dask scheduler to use instead; runner: what a worker calls for each run."""

    folder: Path
    workers: int | None = None
    cluster: str | None = None
    runner: str = RUN_ONE

    def __post_init__(self) -> None:
        if self.workers is not None and self.workers < 1:
            refuse(f"workers: expected 1 or more, got {self.workers}")
        if self.workers is not None and self.cluster is not None:
            refuse("workers: expected --workers or --cluster, got both")


@dataclass(frozen=True)
class State:
    """How far a sweep is. done, total: runs; failed: of those done; remaining_s: about how much
    longer it takes; taken_s: since it was started; settled: every kind of run has been timed."""

    done: int
    total: int
    failed: int
    remaining_s: float
    taken_s: float
    settled: bool


class Workers(Protocol):
    """Whoever does jobs."""

    @property
    def size(self) -> int:
        """Runs that go on at once."""
        ...

    @property
    def idle(self) -> int:
        """Jobs that could be given now."""
        ...

    def give(self, job: Job) -> None:
        """Starts a job."""
        ...

    def wait(self) -> Sequence[Done]:
        """Blocks until there are answers."""
        ...

    def close(self) -> None:
        """Ends everything."""
        ...


@dataclass
class _Queue:
    """Jobs in the order in which they may start. Of those that share a front end one goes first
    and records it; the others wait for it and replay it."""

    jobs: list[Job]
    front_ends: dict[str, Path | None]
    recording: set[Path] = field(default_factory=set)

    def take(self) -> Job | None:
        """The next job that may start now."""
        for place, job in enumerate(self.jobs):
            path = self.front_ends[job.key]
            if path is None or path not in self.recording:
                if path is not None and not path.exists():
                    self.recording.add(path)
                return self.jobs.pop(place)
        return None

    def ended(self, job: Job) -> None:
        """A job is done, or lost: who waited for its front end may start."""
        path = self.front_ends[job.key]
        if path is not None:
            self.recording.discard(path)


def sweep(
    configs: Sequence[RunConfig],
    settings: SweepConfig,
    watch: Callable[[State], None] | None = None,
) -> tuple[Row, ...]:
    """A row for each configuration, in their order; those that the folder has are not run again.

    A run that fails is a row with its error. Raises InputError for what can be refused at once,
    for a folder that is in use, and when the disk is full: what has been done is kept, and the same
    call goes on from there.
    """
    if not configs:
        refuse("sweep: no runs: expected at least one scene, seed and variant")
    asked = [Job(config) for config in configs]
    jobs = list({job.key: job for job in asked}.values())
    with open_store(settings.folder) as store:
        store.plan(jobs)
        rows = store.load(jobs)
        todo = [job for job in jobs if job.key not in rows]
        if todo:
            with _workers(settings, store, len(todo)) as workers:
                rows |= _Sweep(jobs, rows, store, workers, watch).run(todo)
        store.write_table([rows[job.key] for job in jobs])
    return tuple(replace(rows[job.key], config=job.config) for job in asked)


@contextmanager
def _workers(settings: SweepConfig, store: Store, jobs: int) -> Iterator[Workers]:
    workers: Workers
    if settings.cluster is not None:
        from eval.sweep.cluster import DaskWorkers

        workers = DaskWorkers(settings.cluster, settings.runner)
    else:
        size = min(settings.workers or cores(), jobs)
        workers = LocalWorkers(size, settings.runner, store.scratch)
    try:
        yield workers
    finally:
        workers.close()
        shutil.rmtree(store.scratch, ignore_errors=True)


class _Sweep:
    """One go at the runs that are missing."""

    def __init__(
        self,
        jobs: Sequence[Job],
        rows: dict[str, Row],
        store: Store,
        workers: Workers,
        watch: Callable[[State], None] | None,
    ):
        self._total, self._rows = len(jobs), dict(rows)
        self._store, self._workers, self._watch = store, workers, watch
        self._front_ends = {job.key: artefact_path(job.config) for job in jobs}
        self._simulated = {job.key: simulated_seconds(job.config) for job in jobs}
        self._forecast = Forecast()
        self._tries: Counter[str] = Counter()
        self._running: dict[str, tuple[Job, Cost]] = {}
        self._started = time.monotonic()

    def run(self, todo: Sequence[Job]) -> dict[str, Row]:
        """All rows, old and new."""
        queue = _Queue(_spread(todo), self._front_ends)
        self._tell(queue)
        while queue.jobs or self._running:
            while self._workers.idle > 0 and (job := queue.take()) is not None:
                self._running[job.key] = (job, self._cost(job))
                self._workers.give(job)
            for done in self._workers.wait():
                self._take(done, queue)
            self._tell(queue)
        return self._rows

    def _take(self, done: Done, queue: _Queue) -> None:
        """Keeps a result, or sees to it that a lost run is tried again."""
        job, cost = self._running.pop(done.job.key)
        queue.ended(job)
        if done.halt is not None:
            raise InputError(f"{done.halt}: {len(self._rows)} of {self._total} runs are kept")
        row = done.row
        if row is None:
            self._tries[job.key] += 1
            if self._tries[job.key] < TRIES:
                queue.jobs.append(job)
                return
            row = Row(job.config, "failed", f"its worker died {TRIES} times", 0.0, None)
        self._forecast.add(cost, row.seconds)
        self._store.add(job, row)
        self._rows[job.key] = row

    def _cost(self, job: Job, others: Sequence[Job] = ()) -> Cost:
        """others: jobs that come first; one of them may record this one's front end."""
        config, path = job.config, self._front_ends[job.key]
        replay = path is not None and (
            path.exists() or any(self._front_ends[other.key] == path for other in others)
        )
        variant = f"{config.detector} {config.layers} {config.factors} {config.loops}"
        return Cost(config.scene, variant, replay, self._simulated[job.key])

    def _tell(self, queue: _Queue) -> None:
        if self._watch is None:
            return
        running = [job for job, _ in self._running.values()]
        waiting = [
            self._cost(job, running + queue.jobs[:place]) for place, job in enumerate(queue.jobs)
        ]
        costs = waiting + [cost for _, cost in self._running.values()]
        state = State(
            done=len(self._rows),
            total=self._total,
            failed=sum(row.status == "failed" for row in self._rows.values()),
            remaining_s=self._forecast.all(costs, self._workers.size),
            taken_s=time.monotonic() - self._started,
            settled=self._forecast.knows(costs),
        )
        self._watch(state)


def _spread(jobs: Sequence[Job]) -> list[Job]:
    """One job of every scene first, so that the forecast soon knows them all; else in order."""
    first = list({job.config.scene: job for job in reversed(jobs)}.values())[::-1]
    return first + [job for job in jobs if job not in first]


def simulated_seconds(config: RunConfig) -> float:
    """About how long a run drives [s]. Raises InputError for a scene that there is not."""
    tour = ROOM_S * _rooms(config.scene) * SPEED / (config.speed or SPEED)
    return tour if config.duration is None else min(tour, config.duration)


@cache
def _rooms(scene: str) -> int:
    """Rooms of a scene's largest storey."""
    return max(1, *(len(storey.rooms) for storey in load_scene(scene).storeys))
