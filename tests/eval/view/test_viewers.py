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
from eval.report.photo import BROWSERS, browser, photograph
from eval.view import viewers
from eval.view.live import LiveSink
from eval.view.recorder import Recorder
from eval.view.shapes import colour_of
from eval.view.shots import Shot, take
from eval.view.targets import FileTarget, ViewerTarget
from eval.view.viewers import ViewerError, free_port, open_page, open_window

Play = Callable[..., None]

ROOM = 7
"""The room with planes that the run of ``play`` finds."""

SHARE = 0.002
"""Share of a picture that has the room's hue, at least, where the room is drawn."""


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


def share_of_room(png: bytes) -> float:
    """Share of the picture that has the hue of the room: its node, its edges and its sides have."""
    from PIL import Image

    pixels = np.asarray(Image.open(io.BytesIO(png)).convert("RGB")).astype(float)
    hues, hue = pixels - pixels.min(axis=2, keepdims=True), np.array(colour_of(ROOM), dtype=float)
    hue -= hue.min()
    lengths = np.linalg.norm(hues, axis=2) * np.linalg.norm(hue)
    alike = hues @ hue > 0.98 * np.maximum(lengths, 1.0)
    return float((alike & (np.ptp(pixels, axis=2) > 60)).mean())


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


def test_a_viewer_that_dies_while_it_is_asked_is_one_line(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    class Client:
        def get_state(self) -> None:
            raise ConnectionError("transport error")

    class Dead:
        address = "rerun+http://127.0.0.1:1/proxy"

        def stop(self) -> None:
            stopped.append(self)

    stopped: list[Dead] = []
    monkeypatch.setattr("eval.view.shots.open_unseen", lambda *_: Dead())
    monkeypatch.setattr("rerun.experimental.ViewerClient.connect", lambda _: Client())
    with pytest.raises(ViewerError, match=r"no picture could be taken: .*graphics driver"):
        take(tmp_path / "recording.rrd", [Shot()])
    assert stopped


@pytest.mark.slow
def test_the_native_viewer_shows_rooms(tmp_path: Path, play: Play) -> None:
    path = tmp_path / "recording.rrd"
    play(Recorder(FileTarget(path)))
    try:
        at_start, at_end = take(path, [Shot(0.4), Shot(0.5)], (800, 500))
    except ViewerError as error:
        pytest.skip(f"no headless viewer here: {error}")
    assert share_of_room(at_start) > SHARE
    assert share_of_room(at_end) < 0.1 * SHARE  # all rooms were retracted


@pytest.mark.slow
def test_the_page_shows_rooms(play: Play) -> None:
    """What a browser sees of a stream, as with --serve."""
    if browser() is None:
        pytest.skip(f"no browser here that takes pictures of pages: {', '.join(BROWSERS)}")
    viewer = open_page()
    try:
        assert viewer.page is not None
        play(Recorder(ViewerTarget(viewer.address)), retract=False)
        picture = photograph(viewer.page, (900, 600), lambda png: share_of_room(png) > SHARE)
    finally:
        viewer.stop()
    assert share_of_room(picture) > SHARE
