"""Where the scans of a run come from: the world that is built, and the drive through it."""

from __future__ import annotations

import logging

import numpy as np

from eval.config import RunConfig
from eval.steps import Source
from sim.drive import Drive
from sim.route import RouteConfig, named_route, plan_route
from sim.sensor import sensor_named
from slam.core import InputError
from worlds.catalogue import load_scene
from worlds.conditions import conditions_named
from worlds.plan import NamedRoute, Plan
from worlds.readers import ReaderOptions
from worlds.world import World, build_world

SPEED = 0.6
"""Of the base where nothing else is asked for [m/s]."""

_log = logging.getLogger(__name__)


def plan_of(config: RunConfig) -> Plan:
    """The plan of a run's scene. Raises InputError."""
    return load_scene(config.scene, ReaderOptions(config.unit, config.up))


def make_world(config: RunConfig) -> World:
    """The world of a run: the storey that is driven, or all that ramps join. Raises InputError."""
    plan = plan_of(config)
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
    if route.unreachable:
        _log.warning("%s: no way leads to %s", config.scene, ", ".join(route.unreachable))
    speed = SPEED if config.speed is None else config.speed
    _, seed = _seeds(config)
    return Drive(world, sensor_named(config.sensor), route, speed, seed, config.duration)


def _part(config: RunConfig, plan: Plan) -> NamedRoute | None:
    """The route that was asked for by its name. Raises InputError."""
    if config.route is None:
        return None
    part = named_route(plan, config.route)
    if config.storey not in (None, part.storey):
        raise InputError(f"storey {config.storey}: route '{part.name}' is on {part.storey}")
    return part


def _seeds(config: RunConfig) -> list[np.random.SeedSequence]:
    """Of the world and of the drive."""
    return np.random.SeedSequence(config.seed).spawn(2)
