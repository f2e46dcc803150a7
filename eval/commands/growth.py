"""``roomloop bench semantics`` and ``roomloop bench growth``: what a larger map costs."""

from __future__ import annotations

from typing import Annotated

import typer

Option = typer.Option


def semantics(
    sizes: Annotated[str, Option(help="Planes in the map, one or several as a,b.")] = "150,2000",
    detector: Annotated[str, Option(help="A learned detector.")] = "gnn",
) -> None:
    """One answer of the learned detector: milliseconds by the size of the map."""
    from rich.box import SIMPLE_HEAD
    from rich.console import Console
    from rich.table import Table

    from eval.bench_semantics import bench_semantics

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
    """Back end and learned detector over many rooms: does an update cost more in a large map?"""
    from rich.console import Console

    from eval.growth import growth as measure
    from eval.screen import RunProgress
    from semantics.detector import make_detector

    if rooms < 50:
        raise typer.BadParameter(f"rooms: expected 50 or more, got {rooms}")
    with RunProgress("growth", Console(stderr=True), "rooms") as progress:
        found = measure(rooms, seed, detector=make_detector("gnn"), progress=progress)
    console = Console()
    for name, ms in (("back end", found.graph_ms), ("detector", found.detector_ms)):
        console.print(
            f"{name}: median {sorted(ms)[len(ms) // 2]:.1f} ms of processor an update; the last "
            f"5 % take {found.ratio(ms):.2f} times those about room 25",
            highlight=False,
        )
    console.print(f"{found.planes[-1]:.0f} planes, {found.rss_mb[-1]:.0f} MB", highlight=False)


def _counts(name: str, text: str) -> list[int]:
    parts = [part.strip() for part in text.split(",")]
    if not all(part.isdigit() and int(part) > 0 for part in parts):
        raise typer.BadParameter(f"{name}: expected numbers such as 150,2000, got {text!r}")
    return [int(part) for part in parts]
