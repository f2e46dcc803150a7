"""Viewers that cannot be had, or go away, are a line and no more; those that can show something."""

from __future__ import annotations

import io
import socket
import sys
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from eval.commands.view import watchers
from eval.view import viewers
from eval.view.live import LiveSink
from eval.view.recorder import Recorder
from eval.view.shots import Shot, take
from eval.view.targets import FileTarget, ViewerTarget
from eval.view.viewers import ViewerError, free_port, open_page, open_window

Play = Callable[..., None]


@pytest.fixture
def no_display(monkeypatch: pytest.MonkeyPatch) -> None:
    for name in ("DISPLAY", "WAYLAND_DISPLAY"):
        monkeypatch.delenv(name, raising=False)


@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="displays are named on Linux only")
def test_no_display(no_display: None, capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(ViewerError, match="there is no display here; try --serve, or --save"):
        open_window()
    assert watchers(window=True, page=False) == []
    assert capsys.readouterr().err == (
        "view: there is no display here; try --serve, or --save; the run goes on\n"
    )


def test_a_port_that_is_taken_is_not_insisted_on() -> None:
    with socket.socket() as other:
        other.bind(("127.0.0.1", 0))
        taken = other.getsockname()[1]
        assert free_port(taken) != taken


def test_a_viewer_that_does_not_start(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(viewers.sys, "executable", "/bin/false")
    with pytest.raises(ViewerError, match="the viewer did not start"):
        open_page()


def test_nobody_asked_for() -> None:
    assert watchers(window=False, page=False) == []


def drawn(png: bytes) -> float:
    """Share of the picture that is coloured: rooms, planes and paths are, the viewer is grey."""
    from PIL import Image

    pixels = np.asarray(Image.open(io.BytesIO(png)).convert("RGB")).astype(int)
    return float((np.ptp(pixels, axis=2) > 60).mean())


@pytest.mark.slow
def test_the_run_outlives_its_viewer(play: Play) -> None:
    """Nobody looks at the page, and its server goes away before the run has said anything."""
    viewer = open_page()
    assert viewer.page is not None
    assert viewer.page.startswith("http://127.0.0.1:")
    sink = LiveSink(Recorder(ViewerTarget(viewer.address)))
    try:
        play(sink)
    finally:
        viewer.stop()
    with socket.socket() as probe:  # it is gone, and so are the processes that it started
        assert probe.connect_ex(("127.0.0.1", int(viewer.address.split(":")[2].split("/")[0]))) != 0
    play(LiveSink(Recorder(ViewerTarget(viewer.address))))


@pytest.mark.slow
def test_the_native_viewer_shows_rooms(tmp_path: Path, play: Play) -> None:
    path = tmp_path / "recording.rrd"
    play(Recorder(FileTarget(path)))
    try:
        at_start, at_end = take(path, [Shot(0.4), Shot(0.5)], (800, 500))
    except ViewerError as error:
        pytest.skip(f"no headless viewer here: {error}")
    assert drawn(at_start) > 0.01
    assert drawn(at_end) < drawn(at_start)  # all rooms were retracted
