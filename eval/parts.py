"""The parts of a run, made from its configuration: place, front end, back end, detector, truth."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

from eval.artefact import Replay, artefact_path, recorded
from eval.config import RunConfig
from eval.detectors import make_detector, make_odometry
from eval.guard import Guard
from eval.labels import TruthKeeper
from eval.registered import RegisteredAhead
from eval.sinks import Sink, make_sink
from eval.source import UNKNOWN, Place, make_place
from eval.steps import Step, TruthFilter, live_steps
from slam.backend import BackEnd, BackEndConfig
from slam.frontend import FrontEnd
from slam.loops import LoopConfig
from slam.relations import relations_named


@dataclass
class Parts:
    """Everything that one run is wired from. steps: of the front end, one a scan; replay: whether
    they come from a file; duration: about how long they go on [s]; scans: taken so far, with those
    that had no return."""

    place: Place
    steps: Iterable[Step]
    replay: bool
    duration: float
    backend: BackEnd
    guard: Guard
    keeper: TruthKeeper
    sink: Sink
    scans: int = 0


def wire(config: RunConfig, truth_filter: TruthFilter | None, watchers: Sequence[Sink]) -> Parts:
    """Builds the place and makes every part of a run of it. Raises InputError."""
    place = make_place(config)
    keeper = TruthKeeper(UNKNOWN if place.truth is None else place.truth)
    steps, duration, replay = front_end(config, place, keeper, truth_filter)
    return Parts(
        place=place,
        steps=steps,
        replay=replay,
        duration=duration,
        backend=BackEnd(back_end_config(config)),
        guard=Guard(make_detector(config.detector, keeper)),
        keeper=keeper,
        sink=make_sink(config, config.folder, watchers),
    )


def back_end_config(config: RunConfig) -> BackEndConfig:
    """What a run's options ask of the back end."""
    return BackEndConfig(
        layers=config.layers,
        relations=relations_named(config.factors),
        loops=LoopConfig() if config.loops == "on" else None,
    )


def front_end(
    config: RunConfig, place: Place, keeper: TruthKeeper, truth_filter: TruthFilter | None = None
) -> tuple[Iterable[Step], float, bool]:
    """The steps of a run, about how long they go on [s], and whether they are replayed."""
    path = artefact_path(config)
    if path is not None and path.exists():
        replay = Replay(path)
        return replay, replay.duration, True
    odometry = make_odometry(config.odometry)
    source = place.source()
    if isinstance(source, RegisteredAhead):
        odometry = source
    steps = live_steps(source, FrontEnd(odometry), keeper, truth_filter)
    return (steps if path is None else recorded(steps, path)), source.duration, False
