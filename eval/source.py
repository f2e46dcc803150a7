"""Where the scans of a run come from: the world that is built, and the drive through it."""

from __future__ import annotations

import numpy as np

from eval.config import RunConfig
from eval.steps import Source
from sim.drive import Drive
from sim.route import plan_route
from sim.sensor import sensor_named
from worlds.catalogue import load_scene
from worlds.conditions import conditions_named
from worlds.world import World, build_world

SPEED = 0.6
"""Of the base where nothing else is asked for [m/s]."""


def make_world(config: RunConfig) -> World:
    """The world of a run, the storey that is driven. Raises InputError."""
    conditions = conditions_named(config.conditions)
    seed, _ = _seeds(config)
    return build_world(load_scene(config.scene), seed, conditions, config.storey or 0)


def make_source(config: RunConfig, world: World) -> Source:
    """The drive of a run. Raises InputError."""
    route = plan_route(world, config.storey or 0, config.start)
    speed = SPEED if config.speed is None else config.speed
    _, seed = _seeds(config)
    return Drive(world, sensor_named(config.sensor), route, speed, seed, config.duration)


def _seeds(config: RunConfig) -> list[np.random.SeedSequence]:
    """Of the world and of the drive."""
    return np.random.SeedSequence(config.seed).spawn(2)
