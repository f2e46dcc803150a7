"""``roomloop bench planes``: plane extraction beside Open3D's."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated

import typer

if TYPE_CHECKING:
    from rich.table import Table

    from eval.bench.planes import PlaneBench

Option = typer.Option


def planes(
    scene: Annotated[str, typer.Argument(help="A scene or plan file.")] = "SE3",
    unit: Annotated[
        str, Option("--sensor", help="Preset of the LiDAR, or a .toml file.")
    ] = "vlp16",
    sweeps: Annotated[int, Option(help="From rooms all over it.", min=1)] = 40,
    seed: Annotated[int, Option(help="Of everything random.")] = 0,
) -> None:
    """Planes of single sweeps: true faces found, errors, mixed planes, time; three methods."""
    from rich.console import Console

    from eval.bench.planes import METHODS, bench_planes, looks_at
    from eval.config import RunConfig
    from eval.source import make_world
    from sim.sensorfile import sensor_named

    world = make_world(RunConfig(scene, seed=seed))
    looks = looks_at(world, sensor_named(unit), sweeps, seed)
    Console().print(_table([bench_planes(looks, world.truth, method) for method in METHODS]))


def _table(rows: list[PlaneBench]) -> Table:
    from rich.box import SIMPLE_HEAD
    from rich.table import Table

    table = Table(
        "method", box=SIMPLE_HEAD, caption="errors: median (95th percentile); ms of the processor"
    )
    for column in ("planes", "faces found", "mixed", "tilt, deg", "offset, cm", "ms"):
        table.add_column(column, justify="right")
    for row in rows:
        table.add_row(
            row.method,
            f"{row.planes:.1f}",
            f"{row.found:.3f}",
            f"{row.mixed:.3f}",
            f"{row.tilt[0]:.2f} ({row.tilt[1]:.2f})",
            f"{100.0 * row.offset[0]:.2f} ({100.0 * row.offset[1]:.2f})",
            f"{row.ms:.0f}",
        )
    return table
