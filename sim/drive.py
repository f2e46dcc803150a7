"""A base that drives a route through a world, and what its LiDAR sees on the way."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from sim.base import Base, BaseConfig, base_poses
from sim.caster import THREADS, RayCaster
from sim.crowd import Crowd, make_crowd
from sim.follower import Follower
from sim.ground import Ground
from sim.lidar import Lidar
from sim.motion import Motion
from sim.route import Route
from sim.sensor import Sensor
from sim.truth import ScanTruth
from sim.wheels import Encoders
from slam.core import Array, InputError, Scan

if TYPE_CHECKING:
    from worlds.world import World

STAND = 0.5
"""How long the base stands before it drives off [s]."""


class Drive:
    """An iterable of (Scan, ScanTruth), one pair a sweep, until the route is driven.

    The first sweep ends at 1 / rate seconds. ``duration`` [s] cuts the drive short, or lets the
    base stand at the end of the route no longer than it takes to finish the sweep. Every iteration
    drives anew and gives the same scans to the bit. Raises InputError for a speed or a duration
    that is not positive, and, while iterating, RunError when the base touches a wall.
    """

    def __init__(
        self,
        world: World,
        sensor: Sensor,
        route: Route,
        speed: float = 0.6,
        seed: np.random.SeedSequence | int = 0,
        duration: float | None = None,
        base: BaseConfig = BaseConfig(),  # noqa: B008
        threads: int = THREADS,
    ) -> None:
        _check_positive("speed", speed)
        if duration is not None:
            _check_positive("duration", duration)
        self._world = world
        self._sensor = sensor
        self.route = route
        self._seed = seed
        self._base = replace(base, speed=speed)
        self._threads = threads
        self._steps = _steps_per_sweep(sensor, base)
        estimate = STAND + Follower(route.points, self._base).duration
        self._cut = duration
        self.duration = estimate if duration is None else min(estimate, duration)

    def __iter__(self) -> Iterator[tuple[Scan, ScanTruth]]:
        lidar_rng, base_rng, crowd_rng = _generators(self._seed, 3)
        follower = Follower(self.route.points, self._base)
        ground = Ground(self._world, self.route.storey)
        base = Base(
            self._world.spec,
            ground.height,
            follower.start,
            self._base,
            base_rng,
            None if ground.level else ground,
        )
        ids = base.geom_ids(self._world.mesh.geom_names)
        caster = RayCaster(self._world.mesh, ids, self._threads)
        crowd = self._crowd(base, crowd_rng)
        lidar = Lidar(self._sensor, crowd.before(caster), lidar_rng, self._base.T_base_lidar)
        encoders = Encoders(self._base.wheels, self._base.timestep)
        period = self._sensor.period
        index = 0
        while not follower.finished and (index + 1) * period <= self._limit:
            motion, counts = self._move(base, follower, crowd, index)
            scan, truth = lidar.sweep(index, (index + 1) * period, motion)
            yield replace(scan, wheels=encoders.read(scan.stamp, counts)), truth
            index += 1

    @property
    def _limit(self) -> float:
        """No sweep ends after this [s]."""
        return np.inf if self._cut is None else self._cut + 1e-9

    def _crowd(self, base: Base, rng: np.random.Generator) -> Crowd:
        route, config = self.route, self._base
        return make_crowd(
            self._world, route.storey, route.points, config.radius, config.speed, base.model, rng
        )

    def _move(
        self, base: Base, follower: Follower, crowd: Crowd, index: int
    ) -> tuple[Motion, NDArray[np.int64]]:
        """The base's motion during sweep ``index``, one pose a physics step, and beside it the
        counts (K + 1, 2) of its encoders."""
        coordinates = np.empty((self._steps + 1, 6))
        counts = np.empty((self._steps + 1, 2), dtype=np.int64)
        coordinates[0], counts[0] = base.coordinates, base.wheels.counts
        crowd.advance(self._sensor.period, coordinates[0, :2])
        for step in range(self._steps):
            x, y, yaw = coordinates[step, :3].tolist()
            crowd.put(base.data, step / self._steps)
            standing = base.time < STAND - 1e-9
            base.step(*((0.0, 0.0) if standing else follower.command(x, y, yaw)))
            coordinates[step + 1], counts[step + 1] = base.coordinates, base.wheels.counts
        period = self._sensor.period
        stamps: Array = (index + np.arange(self._steps + 1) / self._steps) * period
        return Motion(stamps, base_poses(coordinates, base.z_floor)), counts


def _check_positive(name: str, value: float) -> None:
    if not (np.isfinite(value) and value > 0.0):
        raise InputError(f"{name} is {value}, expected more than 0")


def _steps_per_sweep(sensor: Sensor, base: BaseConfig) -> int:
    """Physics steps in one sweep. Raises InputError if they do not fill it."""
    steps = round(sensor.period / base.timestep)
    if steps < 1 or abs(steps * base.timestep - sensor.period) > 1e-9:
        raise InputError(
            f"sensor {sensor.name}: rate {sensor.rate:g} Hz, expected a sweep to last a multiple "
            f"of the physics step of {base.timestep:g} s"
        )
    return steps


def _generators(seed: np.random.SeedSequence | int, count: int) -> list[np.random.Generator]:
    """Independent generators, the same ones for every call: spawning counts, so spawn a copy."""
    if isinstance(seed, np.random.SeedSequence):
        seed = np.random.SeedSequence(seed.entropy, spawn_key=seed.spawn_key)
    else:
        seed = np.random.SeedSequence(seed)
    return [np.random.default_rng(child) for child in seed.spawn(count)]
