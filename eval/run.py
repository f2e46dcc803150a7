"""One run: a world is built, driven through, mapped, understood, and scored."""

from __future__ import annotations

import resource
import sys
import time
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path

import numpy as np

from eval.artefact import Replay, artefact_path, recorded
from eval.config import RunConfig
from eval.detectors import make_detector, make_odometry
from eval.folder import check_folder, claim_folder
from eval.graphfile import write_graph
from eval.guard import Guard
from eval.labels import TruthKeeper
from eval.metrics import Loops, Metrics, RunFacts, Stages, StageTime, assemble
from eval.outputs import write_metrics, write_ply, write_tum
from eval.picture import plan_png
from eval.registered import RegisteredAhead
from eval.report.run import write_report
from eval.roomtable import ROOMS_FILE, room_rows, write_rooms
from eval.scenegraph import scene_graph
from eval.score_consistency import score_consistency
from eval.score_loops import score_loops
from eval.score_map import SurfaceDistance
from eval.scores import RunRecord, graph_truth, score_run
from eval.sinks import Sink, make_sink
from eval.source import UNKNOWN, Place, make_place
from eval.steps import Step, TruthFilter, live_steps
from eval.trajectory import Trajectory
from slam.backend import BackEnd, BackEndConfig
from slam.core import Linking, Proposals, RunError
from slam.frontend import FrontEnd
from slam.loops import LoopConfig

Progress = Callable[[float, float], None]
"""Told after each scan: simulated seconds so far, and how many the whole run will have."""

PACKAGES = (
    "roomloop",
    "mujoco",
    "kiss-icp",
    "open3d",
    "torch",
    "gtsam",
    "numpy",
    "rerun-sdk",
)


@dataclass(frozen=True)
class RunResult:
    """What a run leaves: its scores, and the folder that holds its files."""

    metrics: Metrics
    folder: Path


@dataclass
class _Clock:
    """Wall time by stage [s], one entry a call."""

    seconds: dict[str, list[float]] = field(default_factory=dict)

    def add(self, stage: str, seconds: float) -> None:
        self.seconds.setdefault(stage, []).append(seconds)

    @contextmanager
    def measure(self, stage: str) -> Iterator[None]:
        started = time.perf_counter()
        yield
        self.add(stage, time.perf_counter() - started)

    def last(self) -> dict[str, float]:
        """What each stage took when it last ran."""
        return {stage: seconds[-1] for stage, seconds in self.seconds.items()}

    def stages(self) -> Stages:
        return Stages(**{name: StageTime.of(seconds) for name, seconds in self.seconds.items()})


@dataclass
class _Parts:
    """Everything that one run is wired from."""

    place: Place
    steps: Iterable[Step]
    replay: bool
    duration: float
    backend: BackEnd
    guard: Guard
    keeper: TruthKeeper
    sink: Sink


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
    parts = _wire(config, truth_filter, watchers)
    folder = claim_folder(config)
    clock = _Clock()
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
    facts = replace(_facts(config, parts.place, failure), stages=clock.stages())
    if not parts.replay:
        facts = replace(facts, startup_s=startup_s, wall_s=wall_s)
    metrics = _finish(parts, proposals, facts, folder)
    if failure is not None:
        raise failure
    return RunResult(metrics, folder)


def _wire(config: RunConfig, truth_filter: TruthFilter | None, watchers: Sequence[Sink]) -> _Parts:
    """Builds the place and makes every part. Raises InputError."""
    place = make_place(config)
    keeper = TruthKeeper(UNKNOWN if place.truth is None else place.truth)
    steps, duration, replay = front_end(config, place, keeper, truth_filter)
    return _Parts(
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
        factors=config.factors,
        loops=LoopConfig() if config.loops == "on" else None,
    )


def front_end(
    config: RunConfig,
    place: Place,
    keeper: TruthKeeper,
    truth_filter: TruthFilter | None = None,
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


def _loop(parts: _Parts, clock: _Clock, progress: Progress | None) -> None:
    """One scan after the other on its way through the house."""
    for step in parts.steps:
        for stage, seconds in step.seconds.items():
            clock.add(stage, seconds)
        started = time.perf_counter()
        loops = len(parts.backend.loops)
        changed = parts.backend.add(step.frame)
        graph_s = time.perf_counter() - started
        parts.keeper.add(step.truth)
        if changed:
            proposals = _detect(parts, step.frame.stamp, clock)
            started = time.perf_counter()
            parts.backend.accept(proposals)
            clock.add("graph", graph_s + time.perf_counter() - started)
            parts.sink.timed(step.frame.stamp, clock.last())
            for loop in parts.backend.loops[loops:]:
                text = f"loop closed: keyframe {loop.later} at {loop.earlier}"
                parts.sink.event(step.frame.stamp, text)
        if step.scan is not None:
            known = bool(np.isfinite(step.truth.T_world_base).all())
            T_world_base = step.truth.T_world_base if known else None
            parts.sink.frame(step.frame, step.scan, parts.backend.latest(), T_world_base)
        if progress is not None:
            progress(step.frame.stamp - parts.keeper.start, parts.duration)


def _detect(parts: _Parts, stamp: float, clock: _Clock) -> Proposals:
    """Asks the detector, and has the truth's word on its answer stored."""
    view = parts.backend.view()
    started = time.perf_counter()
    proposals = parts.guard.ask(view)
    latency = time.perf_counter() - started
    clock.add("semantics", latency)
    parts.keeper.snapshot(stamp, latency, view, proposals)
    parts.sink.updated(view, proposals)
    return proposals


# --- afterwards ----------------------------------------------------------------------------------


def _last_word(parts: _Parts) -> tuple[Proposals, RunError | None]:
    """Last optimisation, and the detector's word on what came of it; why there is none."""
    parts.backend.finish()
    try:
        return parts.guard.ask(parts.backend.view()), None
    except RunError as failure:
        return Proposals(), failure


def _finish(parts: _Parts, proposals: Proposals, facts: RunFacts, folder: Path) -> Metrics:
    """Scores and files."""
    backend, detector = parts.backend, parts.guard.detector
    record = RunRecord(
        keeper=parts.keeper,
        estimate=Trajectory(backend.stamps(), backend.trajectory()),
        odometry=Trajectory(backend.stamps(), backend.odometry()),
        online=Trajectory(backend.stamps(), backend.online()),
        view=backend.dense_view(),
        proposals=proposals,
        links=detector.links() if isinstance(detector, Linking) else None,
    )
    scores = score_run(record, _surface(parts.place))
    simulated_s = float(backend.stamps()[-1]) - parts.keeper.start
    facts = replace(facts, simulated_s=simulated_s, loops=_loops(parts))
    if facts.status != "failed":
        consistency = score_consistency(record, scores.planes.votes, backend.graph())
        facts = replace(facts, consistency=consistency)
    metrics = assemble(facts, scores)
    write_tum(record.estimate, folder / "trajectory.tum")
    write_tum(record.odometry, folder / "odometry.tum")
    if len(scores.truth_trajectory):
        write_tum(scores.truth_trajectory, folder / "truth.tum")
    write_ply(scores.cloud.points, scores.cloud.plane_id, folder / "map.ply")
    labels = graph_truth(scores, parts.keeper.truth, record)
    write_graph(scene_graph(record.view, proposals, labels), folder / "graph.json")
    plan_png(record, scores, folder / "plan.png")
    entered = parts.keeper.visits.entered
    if rows := room_rows(scores.fates, parts.keeper.truth, entered):
        write_rooms(rows, folder / ROOMS_FILE)
    write_metrics(metrics, folder / "metrics.json")
    write_report(folder)
    return metrics


def _loops(parts: _Parts) -> Loops:
    """Loop closures against the truth, where it is known at every keyframe."""
    stamps = np.array([keyframe.stamp for keyframe in parts.backend.keyframes()])
    poses = parts.keeper.poses_at(stamps)
    if not np.isfinite(poses).all():
        return Loops()
    found = score_loops(parts.backend.loops, poses)
    return Loops(found.true, found.false, found.missed)


def _surface(place: Place) -> SurfaceDistance | None:
    if place.mesh is None:
        return None
    return SurfaceDistance(place.mesh.vertices, place.mesh.triangles, place.mesh.face)


def _facts(config: RunConfig, place: Place, failure: BaseException | None) -> RunFacts:
    return RunFacts(
        status=_status(failure),
        error=str(failure) if isinstance(failure, RunError) else None,
        scene=config.scene,
        scene_sha256=place.sha256,
        seed=config.seed,
        sensor=config.sensor if place.simulated else None,
        conditions=place.conditions,
        detector=config.detector,
        layers=config.layers,
        factors=config.factors,
        odometry=config.odometry,
        versions=_versions(),
        peak_rss_mb=_peak_rss_mb(),
    )


def _status(failure: BaseException | None) -> str:
    if failure is None:
        return "complete"
    return "failed" if isinstance(failure, RunError) else "cut_off"


def _versions() -> Mapping[str, str]:
    """What was installed, as far as it is known by name."""
    found = {"python": ".".join(map(str, sys.version_info[:3]))}
    for package in PACKAGES:
        try:
            found[package] = version(package)
        except PackageNotFoundError:
            continue
    return found


def _peak_rss_mb() -> float:
    """Largest memory of this process so far and of the simulator's, if it had one [MB]."""
    both = (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN)
    return sum(resource.getrusage(which).ru_maxrss for which in both) / 1024.0
