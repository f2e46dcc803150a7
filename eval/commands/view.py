"""``roomloop view``, and the viewers that a run is watched in."""

from __future__ import annotations

import atexit
import os
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

if TYPE_CHECKING:
    from eval.sinks import Sink

Option = typer.Option


def view(
    run: Annotated[Path, typer.Argument(help="The folder of a run with --save, or a .rrd file.")],
    serve: Annotated[bool, Option("--serve", help="In a browser instead of a window.")] = False,
) -> None:
    """Open the recording of a finished run."""
    from eval.view.recordings import check_recording, recording_of
    from eval.view.viewers import open_page, open_window

    path = recording_of(run)
    check_recording(path)
    viewer = open_page(path) if serve else open_window(path)
    if viewer.page is None:
        return
    _say(f"{viewer.page} (Ctrl-C ends it)")
    try:
        viewer.process.wait()
    finally:
        viewer.stop()


def watchers(window: bool, page: bool) -> list[Sink]:
    """The viewers of ``--view`` and ``--serve``; one that cannot be had is a warning."""
    # What a viewer's end does is said by LiveSink; rerun reads this when it is imported.
    os.environ.setdefault("RUST_LOG", "off")
    from eval.view.live import LiveSink
    from eval.view.recorder import Recorder
    from eval.view.targets import ViewerTarget
    from eval.view.viewers import ViewerError, open_page, open_window

    found: list[Sink] = []
    for wanted, start in ((window, open_window), (page, open_page)):
        if not wanted:
            continue
        try:
            viewer = start()
        except ViewerError as error:
            _say(f"{error}; the run goes on")
            continue
        if viewer.page is not None:
            _say(f"watch at {viewer.page}")
            atexit.register(viewer.stop)  # a page that is open keeps what it has got
        found.append(LiveSink(Recorder(ViewerTarget(viewer.address)), alive=viewer.alive))
    return found


def _say(line: str) -> None:
    from rich.console import Console

    Console(stderr=True).print(line, markup=False, highlight=False, soft_wrap=True)
