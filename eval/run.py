"""One run: a world is built, driven through, mapped, understood, and scored.

``eval/parts.py`` makes what is wired here, ``eval/finish.py`` the scores and the files.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from eval.clock import Clock
from eval.config import RunConfig
from eval.facts import run_facts
from eval.finish import finish
from eval.folder import check_folder, claim_folder
from eval.metrics import Metrics
from eval.parts import Parts, wire
from eval.sinks import Sink
from eval.steps import Step, TruthFilter
from slam.core import Proposals, RunError

Progress = Callable[[float, float], None]
"""Told after each scan: simulated seconds so far, and how many the whole run will have."""


@dataclass(frozen=True)
class RunResult:
    """What a run leaves: its scores, and the folder that holds its files."""

    metrics: Metrics
    folder: Path


def run(
    config: RunConfig,
    progress: Progress | None = None,
    truth_filter: TruthFilter | None = None,
    watchers: Sequence[Sink] = (),
) -> RunResult:
    """Runs a configuration and writes its folder; watchers are told what happens.

    truth_filter replaces every scan's truth on its way to the scoring (for the test that nothing
    else depends on it). Raises InputError before anything is written, and when what there was has
    been scored and written: RunError if the run failed, KeyboardInterrupt if it was stopped.
    """
    check_folder(config.folder)
    started = time.perf_counter()
    parts = wire(config, truth_filter, watchers)
    folder = claim_folder(config)
    clock = Clock()
    startup_s = time.perf_counter() - started
    started = time.perf_counter()
    failure: RunError | KeyboardInterrupt | None = None
    parts.sink.started(config, parts.place.truth)
    try:
        _loop(parts, clock, progress)
    except (RunError, KeyboardInterrupt) as stopped:
        failure = stopped
    wall_s = time.perf_counter() - started
    parts.sink.finished()
    if not len(parts.backend.stamps()):
        raise failure or RunError("no sweep had a single return")
    proposals, fault = _last_word(parts)
    failure = failure or fault
    facts = replace(run_facts(config, parts.place, failure), stages=clock.stages())
    if not parts.replay:
        facts = replace(facts, startup_s=startup_s, wall_s=wall_s)
    metrics = finish(parts, proposals, facts, folder)
    if failure is not None:
        raise failure
    return RunResult(metrics, folder)


def _loop(parts: Parts, clock: Clock, progress: Progress | None) -> None:
    """One scan after the other on its way through the house."""
    for step in parts.steps:
        for stage, seconds in step.seconds.items():
            clock.add(stage, seconds)
        parts.scans = step.frame.index + 1
        _map(parts, step, clock)
        if step.scan is not None:
            known = bool(np.isfinite(step.truth.T_world_base).all())
            T_world_base = step.truth.T_world_base if known else None
            parts.sink.frame(step.frame, step.scan, parts.backend.latest(), T_world_base)
        if progress is not None:
            progress(step.frame.stamp - parts.keeper.start, parts.duration)


def _map(parts: Parts, step: Step, clock: Clock) -> None:
    """A frame on its way into the graph and, if it was a keyframe, to the detector and back."""
    started = time.perf_counter()
    loops = len(parts.backend.loops)
    changed = parts.backend.add(step.frame)
    graph_s = time.perf_counter() - started
    parts.keeper.add(step.truth)
    if not changed:
        return
    proposals = _detect(parts, step.frame.stamp, clock)
    started = time.perf_counter()
    parts.backend.accept(proposals)
    clock.add("graph", graph_s + time.perf_counter() - started)
    parts.sink.timed(step.frame.stamp, clock.last())
    for loop in parts.backend.loops[loops:]:
        text = f"loop closed: keyframe {loop.later} at {loop.earlier}"
        parts.sink.event(step.frame.stamp, text)


def _detect(parts: Parts, stamp: float, clock: Clock) -> Proposals:
    """Asks the detector, and has the truth's word on its answer stored."""
    view = parts.backend.view()
    started = time.perf_counter()
    proposals = parts.guard.ask(view)
    latency = time.perf_counter() - started
    clock.add("semantics", latency)
    parts.keeper.snapshot(stamp, latency, view, proposals)
    parts.sink.updated(view, proposals)
    return proposals


def _last_word(parts: Parts) -> tuple[Proposals, RunError | None]:
    """Last optimisation, and the detector's word on what came of it; why there is none."""
    parts.backend.finish()
    try:
        return parts.guard.ask(parts.backend.view()), None
    except RunError as failure:
        return Proposals(), failure
