"""Metrics of which a test says only what it is about, and runs that only pretend."""

from __future__ import annotations

import errno
import os
import time
from dataclasses import fields, replace

import numpy as np

from eval.config import RunConfig
from eval.metrics import SCHEMA, Latency, Loops, Metrics, Planes, Rooms, Stages, Walls
from eval.score.consistency import Consistency
from eval.score.failures import Failures
from eval.sweep.work import FailedRun


def metrics(**known: object) -> Metrics:
    """Metrics of which only some are known."""
    values: dict[str, object] = {item.name: None for item in fields(Metrics)}
    groups = {"planes": Planes(), "rooms": Rooms(), "walls": Walls(), "loops": Loops()}
    groups |= {"failures": Failures(), "consistency": Consistency()}
    timing = {"room_latency_s": Latency(), "stages": Stages(), "status": "complete"}
    return Metrics(**(values | groups | timing | known))  # type: ignore[arg-type]


def metrics_of(config: RunConfig, **known: object) -> Metrics:
    """Metrics as a run of that configuration would write them."""
    names = ("scene", "seed", "sensor", "conditions", "detector", "layers", "factors", "odometry")
    said = {name: getattr(config, name) for name in names}
    return replace(metrics(schema=SCHEMA, scene_sha256="0", versions={}, **said), **known)  # type: ignore[arg-type]


def run_stub(config: RunConfig) -> Metrics:
    """A run that takes no time, with metrics that follow from its configuration alone.

    ``start`` says what goes wrong: "crash" ends the process, "crash once" does so the first time
    (a file beside the cache remembers), "full disk" and "bug" raise, "fail" is a failed run, and
    "sleep N" takes its time.
    """
    start, layers = config.start or "", ("planes", "rooms", "rooms+walls").index(config.layers)
    if start == "crash once" and config.cache is not None:
        memory = config.cache.parent / f"crashed-{config.seed}"
        if not memory.exists():
            memory.touch()
            os._exit(9)
    if start == "crash":
        os._exit(9)
    if start == "full disk":
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC), "somewhere")
    if start == "bug":
        raise ZeroDivisionError("by\nnothing")
    if start == "fail":
        raise FailedRun("the base hit a wall", metrics_of(config, status="failed"))
    if start.startswith("sleep "):
        time.sleep(float(start.removeprefix("sleep ")))
    rng = np.random.default_rng([config.seed, layers])
    shared = np.random.default_rng([config.seed, 99])
    ate = 0.03 - 0.004 * layers + 0.01 * shared.random() + 0.001 * rng.random()
    return metrics_of(
        config,
        ate_m=float(ate),
        mma_m=0.015,
        rooms=Rooms(precision=1.0, recall=0.5 + 0.25 * layers),
    )
