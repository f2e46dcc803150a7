"""Where the scans of a run come from: the world that is built, and the drive through it."""

from __future__ import annotations

import numpy as np

from eval.config import RunConfig
from eval.steps import Source
from sim.drive import Drive
from sim.route import RouteConfig, named_route, plan_route
from sim.sensor import sensor_named
from worlds.catalogue import load_scene
from worlds.conditions import conditions_named
from worlds.plan import NamedRoute, Plan
from worlds.world import World, build_world

SPEED = 0.6
"""Of the base where nothing else is asked for [m/s]."""


def make_world(config: RunConfig) -> World:
    """The world of a run: the storey that is driven, or all that ramps join. Raises InputError."""
    plan = load_scene(config.scene)
    conditions = conditions_named(config.conditions or plan.conditions)
    seed, _ = _seeds(config)
    part = _part(config, plan)
    storey = config.storey if part is None else part.storey
    if storey is None and not plan.ramps:
        storey = 0
    return build_world(plan, seed, conditions, storey)


def make_source(config: RunConfig, world: World) -> Source:
    """The drive of a run. Raises InputError."""
    how = RouteConfig(closed=config.closed)
    route = plan_route(world, config.storey, config.start, how, _part(config, world.plan))
    speed = SPEED if config.speed is None else config.speed
    _, seed = _seeds(config)
    return Drive(world, sensor_named(config.sensor), route, speed, seed, config.duration)


def _part(config: RunConfig, plan: Plan) -> NamedRoute | None:
    return None if config.route is None else named_route(plan, config.route)


def _seeds(config: RunConfig) -> list[np.random.SeedSequence]:
    """Of the world and of the drive."""
    return np.random.SeedSequence(config.seed).spawn(2)
