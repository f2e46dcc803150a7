"""``roomloop bench sensor``: sweeps beside Embree alone."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated

import typer

if TYPE_CHECKING:
    from collections.abc import Sequence

    from rich.table import Table

    from eval.bench.sensor import SweepTimes

Option = typer.Option


def sensor(
    scenes: Annotated[
        list[str] | None,
        typer.Argument(help="Scenes or plan files (default: SE3 and a building of 1,000 rooms)."),
    ] = None,
    unit: Annotated[
        str, Option("--sensor", help="Preset of the LiDAR, or a .toml file.")
    ] = "vlp16",
    sweeps: Annotated[int, Option(help="Timed in each scene.", min=1)] = 60,
    threads: Annotated[int, Option(help="Of the casting.", min=1)] = 2,
) -> None:
    """Whole sweeps with their noise, their casting, and Embree alone on the same rays."""
    from rich.console import Console

    from eval.bench.sensor import time_sweeps
    from eval.config import RunConfig
    from eval.source import make_world
    from sim.sensorfile import sensor_named

    named = sensor_named(unit)
    found = [
        time_sweeps(scene, make_world(RunConfig(scene)), named, sweeps, threads)
        for scene in scenes or ("SE3", "rooms-1000-1")
    ]
    Console().print(_table(found))


def _table(found: Sequence[SweepTimes]) -> Table:
    from rich.box import SIMPLE_HEAD
    from rich.table import Table

    table = Table(
        "scene",
        box=SIMPLE_HEAD,
        padding=(0, 0, 0, 1),
        caption="medians in ms, wall (CPU of all threads); ratio: cast / Embree",
    )
    for column in ("triangles", "sweep", "p95", "cast", "Embree", "ratio"):
        table.add_column(column, justify="right")
    for times in found:
        table.add_row(
            times.scene,
            f"{times.triangles:,}",
            f"{times.sweep_ms:.1f} ({times.sweep_cpu_ms:.1f})",
            f"{times.sweep_p95_ms:.1f}",
            f"{times.cast_ms:.1f} ({times.cast_cpu_ms:.1f})",
            f"{times.embree_ms:.1f} ({times.embree_cpu_ms:.1f})",
            f"{times.ratio:.2f}",
        )
    return table
