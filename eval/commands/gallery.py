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

    made = {name: make for run in runs for name, make in _pictures(run).items()}
    make_folder(out)
    console = Console()
    for name, make in made.items():
        try:
            write_bytes(out / name, small(make()))
        except RoomloopError as error:  # one that cannot be made here does not stop the others
            line(console, f"{name}: left out: {error}")
            continue
        line(console, str(out / name))


def _pictures(run: Path) -> Mapping[str, Callable[[], bytes]]:
    """What there is to see of a run: file name -> how to make it. Raises InputError."""
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

    def graph(share: float) -> Callable[[], bytes]:
        moment = float(stamps[0] + share * (stamps[-1] - stamps[0]))
        return lambda: take(recording, [Shot(moment, "Scene graph")])[0]

    graphs = {f"{name}-graph-{i}.png": graph(share) for i, share in enumerate(MOMENTS, start=1)}
    return graphs | {
        f"{name}-view.png": lambda: take(recording, [Shot(), Shot()])[1],  # its notices are gone
        f"{name}-plan.png": lambda: read_bytes(run / "plan.png"),
        f"{name}-report.png": lambda: photograph(page, (900, 1300)),
    }
