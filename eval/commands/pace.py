"""``roomloop bench pace``: simulator and odometry together, against real time."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated

import typer

from eval.detectors import ODOMETRIES

if TYPE_CHECKING:
    from eval.odometry_study import Factory, StudyCase

Option = typer.Option


def pace(
    scene: Annotated[str, typer.Argument(help="A scene, a plan file, or generated-N.")],
    odometry: Annotated[str, Option(help=f"One of {', '.join(ODOMETRIES)}.")] = "kiss",
    sensor: Annotated[str, Option(help="A preset.")] = "vlp16",
    seed: Annotated[int, Option(help="Of everything random.")] = 0,
    duration: Annotated[float, Option(help="Simulated seconds.")] = 30.0,
) -> None:
    """Simulator and odometry together: milliseconds a scan, and times real time."""
    from functools import partial

    from eval.detectors import check_name, make_odometry
    from eval.odometry_study import StudyCase

    check_name("odometry", odometry, ODOMETRIES)
    _show(
        StudyCase(scene, seed, sensor, duration=duration),
        partial(make_odometry, odometry),
    )


def _show(case: StudyCase, make: Factory) -> None:
    from rich.box import SIMPLE_HEAD
    from rich.console import Console
    from rich.table import Table

    from eval.pace import pace as measure

    table = Table("simulated", box=SIMPLE_HEAD)
    for name in ("ms a scan", "waiting", "odometry", "times real time"):
        table.add_column(name, justify="right")
    for ahead, where in ((False, "in between"), (True, "ahead, in its own process")):
        found = measure(case, make, ahead)
        numbers = (found.wall, found.waiting, found.odometry, found.factor)
        table.add_row(where, *(f"{number:.1f}" for number in numbers))
    Console().print(table)
