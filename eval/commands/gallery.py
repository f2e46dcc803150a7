"""``roomloop gallery``: the README's pictures, made by the program from one of its runs."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Annotated

import typer


def gallery(
    run: Annotated[Path, typer.Argument(help="The folder of a run with --save.")],
    out: Annotated[Path, typer.Option(help="Where the pictures go.")] = Path("eval/pictures"),
) -> None:
    """Make the README's pictures from a run: its scene graph, its plan, its page."""
    from rich.console import Console

    from eval.files import read_bytes, write_bytes
    from eval.report.photo import photograph, small
    from eval.report.run import write_report
    from eval.view.recordings import check_recording, recording_of
    from eval.view.shots import Shot, take
    from slam.core import RoomloopError

    recording = recording_of(run)
    check_recording(recording)
    page = write_report(run).resolve().as_uri()
    pictures: dict[str, Callable[[], bytes]] = {
        "graph.png": lambda: take(recording, [Shot(), Shot()])[1],  # by then its notices are gone
        "plan.png": lambda: read_bytes(run / "plan.png"),
        "report.png": lambda: photograph(page, (900, 1300)),
    }
    console = Console()
    out.mkdir(parents=True, exist_ok=True)
    for name, make in pictures.items():
        try:
            write_bytes(out / name, small(make()))
        except RoomloopError as error:  # one that cannot be made here does not stop the others
            console.print(f"{name}: left out: {error}", markup=False, highlight=False)
            continue
        console.print(str(out / name), markup=False, highlight=False, soft_wrap=True)
