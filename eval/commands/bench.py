"""``roomloop bench``: every stage's speed and growth."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated

import typer

if TYPE_CHECKING:
    from collections.abc import Sequence

    from rich.table import Table

    from eval.sensorbench import SweepTimes

bench = typer.Typer(help="How fast each stage is, and how it grows.")
Option = typer.Option


@bench.callback()
def _bench() -> None:
    """Makes ``bench`` a group of commands even while it has one."""


@bench.command("sensor")
def bench_sensor(
    scenes: Annotated[
        list[str] | None,
        typer.Argument(help="Scenes or plan files (default: SE3 and a building of 1,000 rooms)."),
    ] = None,
    sensor: Annotated[str, Option(help="Preset of the LiDAR, or a .toml file.")] = "vlp16",
    sweeps: Annotated[int, Option(help="Timed in each scene.", min=1)] = 60,
    threads: Annotated[int, Option(help="Of the casting.", min=1)] = 2,
    drive: Annotated[
        float, Option(help="Seconds of the drive with KISS-ICP in the first scene; 0: none.")
    ] = 20.0,
) -> None:
    """Whole sweeps, their casting, Embree alone on the same rays; sensor and KISS-ICP together."""
    from rich.console import Console

    from eval.config import RunConfig
    from eval.sensorbench import odometry_real_time, time_sweeps
    from eval.source import make_world
    from sim.sensorfile import sensor_named

    scenes = scenes or ["SE3", "rooms-1000-1"]
    unit = sensor_named(sensor)
    found = [
        time_sweeps(scene, make_world(RunConfig(scene)), unit, sweeps, threads) for scene in scenes
    ]
    console = Console()
    console.print(_sensor_table(found))
    if drive > 0.0:
        config = RunConfig(scenes[0], sensor=sensor, duration=drive)
        console.print(
            f"{scenes[0]}, {drive:g} s: base, sensor and KISS-ICP together "
            f"{odometry_real_time(config):.1f} times real time",
            highlight=False,
        )


def _sensor_table(found: Sequence[SweepTimes]) -> Table:
    from rich.box import SIMPLE_HEAD
    from rich.table import Table

    table = Table("scene", box=SIMPLE_HEAD, caption="medians in ms, wall (CPU of all threads)")
    for column in ("rays", "triangles", "sweep", "p95", "cast", "Embree", "cast/Embree"):
        table.add_column(column, justify="right")
    for times in found:
        table.add_row(
            times.scene,
            f"{times.rays:,}",
            f"{times.triangles:,}",
            f"{times.sweep_ms:.1f} ({times.sweep_cpu_ms:.1f})",
            f"{times.sweep_p95_ms:.1f}",
            f"{times.cast_ms:.1f} ({times.cast_cpu_ms:.1f})",
            f"{times.embree_ms:.1f} ({times.embree_cpu_ms:.1f})",
            f"{times.ratio:.2f}",
        )
    return table
