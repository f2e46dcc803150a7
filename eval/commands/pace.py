"""``roomloop bench pace``: simulator and odometry together, and beside KISS-ICP alone."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated

import typer

from eval.detectors import ODOMETRIES

if TYPE_CHECKING:
    from eval.studies.odometry import Factory, StudyCase

Option = typer.Option


def pace(
    scene: Annotated[str, typer.Argument(help="A scene, a plan file, or generated-N.")],
    odometry: Annotated[str, Option(help=f"One of {', '.join(ODOMETRIES)}.")] = "kiss",
    sensor: Annotated[str, Option(help="A preset.")] = "vlp16",
    seed: Annotated[int, Option(help="Of everything random.")] = 0,
    duration: Annotated[float, Option(help="Simulated seconds.")] = 30.0,
) -> None:
    """Simulator and odometry, against real time; the odometry stage beside KISS-ICP alone."""
    from functools import partial

    from eval.detectors import check_name, make_odometry
    from eval.studies.odometry import StudyCase

    check_name("odometry", odometry, ODOMETRIES)
    case = StudyCase(scene, seed, sensor, duration=duration)
    _show(case, partial(make_odometry, odometry))
    _show_stage(case, odometry, "kiss-published")


def _show(case: StudyCase, make: Factory) -> None:
    from rich.box import SIMPLE_HEAD
    from rich.console import Console
    from rich.table import Table

    from eval.bench.pace import pace as measure

    table = Table("simulated", box=SIMPLE_HEAD)
    for name in ("ms a scan", "waiting", "odometry", "times real time"):
        table.add_column(name, justify="right")
    for ahead, where in ((False, "in between"), (True, "ahead, in its own process")):
        found = measure(case, make, ahead)
        numbers = (found.wall, found.waiting, found.odometry, found.factor)
        table.add_row(where, *(f"{number:.1f}" for number in numbers))
    Console().print(table)


def _show_stage(case: StudyCase, name: str, other: str) -> None:
    from functools import partial

    from rich.box import SIMPLE_HEAD
    from rich.console import Console
    from rich.table import Table

    from eval.bench.pace import stage_times
    from eval.detectors import make_odometry

    found = stage_times(case, partial(make_odometry, name), partial(make_odometry, other))
    table = Table("on the same scans", "ms a scan", box=SIMPLE_HEAD)
    table.add_row(f"our odometry stage ({name}, tracking)", f"{found.stage:.1f}")
    table.add_row(f"KISS-ICP alone ({other})", f"{found.other:.1f}")
    table.add_row("ratio", f"{found.ratio:.2f}")
    Console().print(table)
