"""``roomloop gallery``: the README's pictures, made by the program from its runs."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Annotated

import typer

MOMENTS = (0.1, 0.45, 1.0)
"""Of a run, by its length: little is known, half is, all is."""


def gallery(
    runs: Annotated[list[Path], typer.Argument(help="Folders of runs with --save.")],
    out: Annotated[Path, typer.Option(help="Where the pictures go.")] = Path("eval/pictures"),
) -> None:
    """Make the README's pictures from runs."""
    from rich.console import Console

    from eval.files import make_folder, write_bytes
    from eval.report.photo import small
    from eval.screen import line
    from slam.core import RoomloopError

    made = [make for run in runs for make in _makers(run)]
    make_folder(out)
    console = Console()
    for make in made:
        try:
            pictures = make()
        except RoomloopError as error:  # those that cannot be made here do not stop the others
            line(console, f"left out: {error}")
            continue
        for name, png in pictures.items():
            write_bytes(out / name, small(png))
            line(console, str(out / name))


def _makers(run: Path) -> list[Callable[[], Mapping[str, bytes]]]:
    """What there is to see of a run, each with how to make it: file name -> PNG. Raises
    InputError."""
    from eval.files import read_bytes
    from eval.folder import read_config
    from eval.outputs import read_tum
    from eval.report.photo import photograph
    from eval.report.run import write_report
    from eval.view.recordings import check_recording, recording_of
    from eval.view.shots import Shot, take

    recording = recording_of(run)
    check_recording(recording)
    page = write_report(run).resolve().as_uri()
    name = Path(read_config(run).scene).stem
    stamps = read_tum(run / "trajectory.tum").stamps

    def graphs() -> Mapping[str, bytes]:
        """The first picture still has the viewer's notices on it."""
        moments = [float(stamps[0] + share * (stamps[-1] - stamps[0])) for share in MOMENTS]
        shots = [Shot(moment, "Scene graph") for moment in moments]
        _, whole, *parts = take(recording, [Shot(), Shot(), *shots])
        numbered = {f"{name}-graph-{i}.png": png for i, png in enumerate(parts, start=1)}
        return numbered | {f"{name}-view.png": whole}

    return [
        graphs,
        lambda: {f"{name}-plan.png": read_bytes(run / "plan.png")},
        lambda: {f"{name}-report.png": photograph(page, (900, 1300))},
    ]
