"""``roomloop bench semantics`` and ``roomloop bench growth``: what a larger map costs."""

from __future__ import annotations

from typing import Annotated

import typer

Option = typer.Option
ROWS = 10
"""Of a table, about."""


def semantics(
    sizes: Annotated[str, Option(help="Planes in the map, one or several as a,b.")] = "150,2000",
    detector: Annotated[str, Option(help="A learned detector.")] = "gnn",
) -> None:
    """One answer of the learned detector: milliseconds by the size of the map."""
    from rich.box import SIMPLE_HEAD
    from rich.console import Console
    from rich.table import Table

    from eval.bench.semantics import bench_semantics

    table = Table("planes", "case", box=SIMPLE_HEAD)
    for name in ("ms", "ms of processor"):
        table.add_column(name, justify="right")
    for row in bench_semantics(_counts("sizes", sizes), detector):
        table.add_row(str(row.planes), row.case, f"{row.wall_ms:.1f}", f"{row.cpu_ms:.1f}")
    Console().print(table)


def growth(
    rooms: Annotated[int, Option(help="Rooms to walk through.")] = 200,
    seed: Annotated[int, Option(help="Of everything random.")] = 0,
) -> None:
    """Back end and learned detector over many rooms: does an update cost more in a large map?

    The same fifty rooms come again and again. Medians, in milliseconds of the processor.
    """
    from rich.box import SIMPLE_HEAD
    from rich.console import Console
    from rich.table import Table

    from eval.bench.growth import GrowthConfig
    from eval.bench.growth import growth as measure
    from eval.screen import RunProgress
    from semantics.detector import make_detector

    of = GrowthConfig.block
    if rooms < 2 * of or rooms % of:
        raise typer.BadParameter(f"rooms: expected {2 * of}, {3 * of} and so on, got {rooms}")
    with RunProgress("growth", Console(stderr=True), "rooms") as progress:
        found = measure(rooms, seed, detector=make_detector("gnn"), progress=progress)
    blocks = found.blocks()
    table = Table("rooms", "planes", "back end, ms", "detector, ms", "memory, MB", box=SIMPLE_HEAD)
    for column in table.columns:
        column.justify = "right"
    every = -(-len(blocks) // ROWS)
    for block in [*blocks[:-1:every], blocks[-1]]:
        ms = f"{block.graph_ms:.1f}", f"{block.detector_ms:.1f}"
        table.add_row(str(block.rooms), str(block.planes), *ms, f"{block.rss_mb:.0f}")
    console = Console()
    console.print(table)
    first, last = blocks[0], blocks[-1]
    console.print(
        f"the last rooms against the same ones at first: back end "
        f"{last.graph_ms / first.graph_ms:.2f}x, detector "
        f"{last.detector_ms / first.detector_ms:.2f}x",
        highlight=False,
    )


def _counts(name: str, text: str) -> list[int]:
    parts = [part.strip() for part in text.split(",")]
    if not all(part.isdigit() and int(part) > 0 for part in parts):
        raise typer.BadParameter(f"{name}: expected numbers such as 150,2000, got {text!r}")
    return [int(part) for part in parts]
