"""``roomloop bench watching``: a run headless, recorded, served and looked at."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated

import typer

if TYPE_CHECKING:
    from rich.table import Table

    from eval.bench.watching import RunCost

Option = typer.Option


def watching(
    scene: Annotated[str, typer.Argument(help="A scene or plan file.")] = "SE1",
    duration: Annotated[float, Option(help="Simulated seconds.", min=1.0)] = 140.0,
    rounds: Annotated[int, Option(help="Runs of each kind, by turns.", min=1)] = 2,
    seed: Annotated[int, Option(help="Of everything random.")] = 0,
) -> None:
    """What --save and --serve cost, and a page that is open: the same run without and with them, by
    turns."""
    from pathlib import Path
    from tempfile import TemporaryDirectory

    from rich.console import Console

    from eval.bench.watching import by_turns

    arguments = [scene, "--duration", str(duration), "--seed", str(seed)]
    with TemporaryDirectory() as folder:
        Console().print(_table(by_turns(arguments, rounds, Path(folder))))


def _table(costs: dict[str, list[RunCost]]) -> Table:
    from rich.box import SIMPLE_HEAD
    from rich.table import Table

    from eval.bench.watching import middle

    table = Table("run", box=SIMPLE_HEAD, caption="medians; processor with start-up and all files")
    for column in ("loop, s", "of headless", "processor, s", "of headless", "recording, MB"):
        table.add_column(column, justify="right")
    base = middle(next(iter(costs.values())))
    for way, runs in costs.items():
        cost = middle(runs)
        table.add_row(
            way,
            f"{cost.wall:.1f}",
            f"{cost.wall / base.wall:.2f}",
            f"{cost.processor:.1f}",
            f"{cost.processor / base.processor:.2f}",
            f"{cost.recording:.1f}" if cost.recording else "-",
        )
    return table
