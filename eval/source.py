"""Where the scans of a run come from, and what is known of the place: a world that is built and
driven through, or a recording."""

from __future__ import annotations

import hashlib
import logging
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import numpy as np

from eval.config import RunConfig
from eval.detectors import make_odometry
from eval.recordings import Recording, RecordingOptions, is_recording, open_recording
from eval.recordings.drive import RecordedDrive
from eval.recordings.labels import LabelsFile
from eval.registered import RegisteredAhead
from eval.steps import Source
from sim.ahead import Ahead, Pair
from sim.drive import Drive
from sim.route import RouteConfig, named_route, plan_route
from sim.sensorfile import sensor_named
from slam.core import InputError, thread_limit
from worlds.catalogue import load_scene, scene_sha256
from worlds.conditions import conditions_named
from worlds.plan import NamedRoute, Plan
from worlds.readers import ReaderOptions
from worlds.truth import Floor, Truth
from worlds.world import Mesh, World, build_world

SPEED = 0.6
"""Of the base where nothing else is asked for [m/s]."""

AHEAD_FROM = 45.0
"""Drives that last longer [s] are simulated ahead: a process takes some seconds to start."""

UNKNOWN = Truth((), (), (), (), (Floor(0, 0.0, 0.0),))
"""The truth of a place of which nothing is known."""

SIMULATED_ONLY = ("speed", "storey", "start", "route", "closed", "conditions", "unit", "up")
"""Fields of RunConfig that say something to the simulator only."""

_log = logging.getLogger(__name__)


@dataclass(frozen=True)
class Place:
    """What a run goes through. truth and mesh: None where nobody knows them; recording: None where
    the place is simulated; sha256: of the plan or the recording; conditions: under which it was
    built; source: makes the scans.
    """

    truth: Truth | None
    mesh: Mesh | None
    recording: Recording | None
    sha256: str
    conditions: str | None
    source: Callable[[], Source]


def make_place(config: RunConfig) -> Place:
    """The place of a run. Raises InputError."""
    if is_recording(config.scene):
        return _recorded_place(config)
    for name in ("truth", "topic"):
        if getattr(config, name) is not None:
            raise InputError(f"{name}: is for recordings, {config.scene} is simulated")
    world = make_world(config)
    return Place(
        truth=world.truth,
        mesh=world.mesh,
        recording=None,
        sha256=scene_sha256(config.scene),
        conditions=config.conditions or world.plan.conditions,
        source=lambda: make_source(config, world, registered=True),
    )


def plan_of(config: RunConfig) -> Plan:
    """The plan of a run's scene. Raises InputError."""
    return load_scene(config.scene, ReaderOptions(config.unit, config.up))


def make_world(config: RunConfig) -> World:
    """The world of a run: the storey that is driven, or all that ramps join. Raises InputError."""
    plan = plan_of(config)
    conditions = conditions_named(config.conditions or plan.conditions)
    part = _part(config, plan)
    storey = config.storey if part is None else part.storey
    if storey is None and not plan.ramps:
        storey = 0
    return build_world(plan, seeds(config)[0], conditions, storey)


def make_source(config: RunConfig, world: World, registered: bool = False) -> Source:
    """The drive of a run; a long one is simulated ahead in a process of its own, where there is a
    core for it: that first has to start and to build the world again. registered: and its scans are
    registered there. Raises InputError."""
    drive = make_drive(config, world)
    if drive.route.unreachable:
        _log.warning("%s: no way leads to %s", config.scene, ", ".join(drive.route.unreachable))
    if drive.duration < AHEAD_FROM or thread_limit(2) < 2:
        return drive
    there = partial(_drive_alone, config)
    if registered:
        return RegisteredAhead(there, partial(make_odometry, config.odometry), drive.duration)
    ahead: Ahead[Pair] = Ahead(there, drive.duration)
    return ahead


def _drive_alone(config: RunConfig) -> Drive:
    return make_drive(config, make_world(config))


def make_drive(config: RunConfig, world: World) -> Drive:
    """The drive of a run, simulated where it is iterated. Raises InputError."""
    how = RouteConfig(closed=config.closed)
    route = plan_route(world, config.storey, config.start, how, _part(config, world.plan))
    speed = SPEED if config.speed is None else config.speed
    _, seed = seeds(config)
    return Drive(world, sensor_named(config.sensor), route, speed, seed, config.duration)


def _part(config: RunConfig, plan: Plan) -> NamedRoute | None:
    """The route that was asked for by its name. Raises InputError."""
    if config.route is None:
        return None
    part = named_route(plan, config.route)
    if config.storey not in (None, part.storey):
        raise InputError(f"storey {config.storey}: route '{part.name}' is on {part.storey}")
    return part


def seeds(config: RunConfig) -> list[np.random.SeedSequence]:
    """Of the world and of the drive."""
    return np.random.SeedSequence(config.seed).spawn(2)


def _recorded_place(config: RunConfig) -> Place:
    """With labels, the world that the drive was recorded in is built again."""
    for name in SIMULATED_ONLY:
        value = getattr(config, name)
        if not (value is None or value is False):  # storey 0 was given
            raise InputError(f"{name}: {config.scene} is a recording, it cannot be driven again")
    path = Path(config.scene)
    labels, truth = None, config.truth
    if truth is not None and truth.endswith(".npz"):
        labels, truth = LabelsFile(Path(truth)), None
    recording = open_recording(path, RecordingOptions(config.topic, truth))
    world = None if labels is None else make_world(labels.config)
    return Place(
        truth=None if world is None else world.truth,
        mesh=None if world is None else world.mesh,
        recording=recording,
        sha256=_sha256(path),
        conditions=None,
        source=lambda: RecordedDrive(recording, config.duration, labels),
    )


def _sha256(path: Path) -> str:
    """Of a file, or of all files of a folder by name."""
    digest = hashlib.sha256()
    files = sorted(file for file in path.iterdir() if file.is_file()) if path.is_dir() else [path]
    for file in files:
        with file.open("rb") as opened:
            while block := opened.read(1 << 20):
                digest.update(block)
    return digest.hexdigest()
