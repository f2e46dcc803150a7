"""Metrics of which a test says only what it is about."""

from __future__ import annotations

from dataclasses import fields, replace

from eval.config import RunConfig
from eval.metrics import SCHEMA, Latency, Loops, Metrics, Planes, Rooms, Stages, Walls


def metrics(**known: object) -> Metrics:
    """Metrics of which only some are known."""
    values: dict[str, object] = {item.name: None for item in fields(Metrics)}
    groups = {"planes": Planes(), "rooms": Rooms(), "walls": Walls(), "loops": Loops()}
    timing = {"room_latency_s": Latency(), "stages": Stages(), "status": "complete"}
    return Metrics(**(values | groups | timing | known))  # type: ignore[arg-type]


def metrics_of(config: RunConfig, **known: object) -> Metrics:
    """Metrics as a run of that configuration would write them."""
    names = ("scene", "seed", "sensor", "conditions", "detector", "layers", "factors", "odometry")
    said = {name: getattr(config, name) for name in names}
    return replace(metrics(schema=SCHEMA, scene_sha256="0", versions={}, **said), **known)  # type: ignore[arg-type]
