"""Where the scans of a run come from: the world that is built, and the drive through it."""

from __future__ import annotations

from functools import partial

import numpy as np

from eval.config import RunConfig
from eval.steps import Source
from sim.ahead import Ahead
from sim.drive import Drive
from sim.route import plan_route
from sim.sensor import sensor_named
from worlds.catalogue import load_scene
from worlds.conditions import conditions_named
from worlds.world import World, build_world

SPEED = 0.6
"""Of the base where nothing else is asked for [m/s]."""

AHEAD_FROM = 45.0
"""Drives that last longer [s] are simulated ahead: a process takes some seconds to start."""


def make_world(config: RunConfig) -> World:
    """The world of a run, the storey that is driven. Raises InputError."""
    conditions = conditions_named(config.conditions)
    seed, _ = _seeds(config)
    return build_world(load_scene(config.scene), seed, conditions, config.storey or 0)


def make_source(config: RunConfig, world: World) -> Source:
    """The drive of a run; a long one is simulated ahead in a process of its own, which first has to
    start and to build the world again. Raises InputError."""
    drive = make_drive(config, world)
    if drive.duration < AHEAD_FROM:
        return drive
    return Ahead(partial(_drive_alone, config), drive.duration)


def _drive_alone(config: RunConfig) -> Drive:
    return make_drive(config, make_world(config))


def make_drive(config: RunConfig, world: World) -> Drive:
    """The drive of a run, simulated where it is iterated. Raises InputError."""
    route = plan_route(world, config.storey or 0, config.start)
    speed = SPEED if config.speed is None else config.speed
    _, seed = _seeds(config)
    return Drive(world, sensor_named(config.sensor), route, speed, seed, config.duration)


def _seeds(config: RunConfig) -> list[np.random.SeedSequence]:
    """Of the world and of the drive."""
    return np.random.SeedSequence(config.seed).spawn(2)
