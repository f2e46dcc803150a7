"""How long the sensor takes: a whole sweep, its casting, and Embree alone on the same rays."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np
from numpy.typing import NDArray

from sim.base import base_poses
from sim.caster import THREADS, Hits, RayCaster, Rays
from sim.lidar import Lidar
from sim.motion import Motion
from sim.sensor import Sensor
from slam.core import pose
from worlds.world import World

HEIGHT = 0.5
"""Of the LiDAR above the floor [m]."""
SPEED, TURNING = 0.6, 0.6
"""Of the base in a sweep [m/s, rad/s]."""


@dataclass(frozen=True)
class SweepTimes:
    """Medians over sweeps [ms], wall and CPU time of all threads: of whole sweeps with their noise,
    of their casting, and of Embree alone on the same rays and with the same threads.
    """

    scene: str
    rays: int
    triangles: int
    threads: int
    sweep_ms: float
    sweep_p95_ms: float
    sweep_cpu_ms: float
    cast_ms: float
    cast_cpu_ms: float
    embree_ms: float
    embree_cpu_ms: float

    @property
    def ratio(self) -> float:
        """Casting over Embree, by wall time."""
        return self.cast_ms / self.embree_ms


def time_sweeps(
    scene: str, world: World, sensor: Sensor, sweeps: int = 60, threads: int = THREADS
) -> SweepTimes:
    """Sweeps from rooms all over a building; the three are timed by turns on the same rays."""
    rng = np.random.default_rng(0)
    caster = RayCaster(world.mesh, threads=threads)
    lidar = Lidar(sensor, caster, rng, pose(np.eye(3), np.array([0.0, 0.0, HEIGHT])))
    keep = _Keep(caster)
    rays_of = Lidar(sensor, keep, rng, lidar.T_base_lidar)
    table = []
    for index, motion in enumerate(motions(world, sensor, sweeps + 5, rng)):
        rays_of.sweep(index, sensor.period, motion)
        table.append(
            [
                *_timed(partial(lidar.sweep, index, sensor.period, motion)),
                *_timed(partial(caster.cast, keep.rays)),
                *_timed(partial(caster.embree, keep.rays)),
            ]
        )
    times = 1e3 * np.array(table[5:])  # the first ones warm up
    sweep, sweep_cpu, cast, cast_cpu, embree, embree_cpu = np.median(times, axis=0).tolist()
    return SweepTimes(
        scene=scene,
        rays=sensor.beams * sensor.columns,
        triangles=len(world.mesh.triangles),
        threads=threads,
        sweep_ms=sweep,
        sweep_p95_ms=float(np.percentile(times[:, 0], 95.0)),
        sweep_cpu_ms=sweep_cpu,
        cast_ms=cast,
        cast_cpu_ms=cast_cpu,
        embree_ms=embree,
        embree_cpu_ms=embree_cpu,
    )


class _Keep:
    """Keeps the rays that it is asked for."""

    def __init__(self, caster: RayCaster) -> None:
        self._caster = caster
        self.rays: Rays = np.empty((0, 6), dtype=np.float32)

    def cast(self, rays: Rays, fractions: NDArray[np.float32]) -> Hits:
        self.rays = rays
        return self._caster.cast(rays)


def _timed(call: Callable[[], object]) -> tuple[float, float]:
    """Wall and CPU seconds."""
    wall, cpu = time.perf_counter(), time.process_time()
    call()
    return time.perf_counter() - wall, time.process_time() - cpu


def motions(world: World, sensor: Sensor, count: int, rng: np.random.Generator) -> Sequence[Motion]:
    """Arcs of a tenth of a second in the middle of rooms, the largest rooms left to chance."""
    rooms = world.truth.rooms
    chosen = (rooms[i] for i in rng.integers(len(rooms), size=count))
    motions = []
    steps = np.linspace(0.0, 1.0, 51)
    for room in chosen:
        middle = room.polygon.representative_point()
        yaw = rng.uniform(-np.pi, np.pi) + TURNING * sensor.period * steps
        way = SPEED * sensor.period * steps
        x, y = middle.x + way * np.cos(yaw), middle.y + way * np.sin(yaw)
        level = np.zeros_like(steps)
        coordinates = np.column_stack([x, y, yaw, level, level, level])
        z_floor = world.truth.floors[room.storey].z_floor
        motions.append(Motion(sensor.period * steps, base_poses(coordinates, z_floor)))
    return motions
