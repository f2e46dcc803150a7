"""The recording is written, read back, and holds the scene graph."""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest

from eval.config import RunConfig
from eval.sinks import NullSink, Sink, Sinks, make_sink
from eval.view.poses import Poses
from eval.view.recorder import Recorder
from eval.view.targets import FileTarget

Play = Callable[..., None]


def recorder(path: Path) -> Recorder:
    return Recorder(FileTarget(path))


def printed(path: Path) -> str:
    command = [sys.executable, "-m", "rerun", "rrd", "print", "-vvv", str(path)]
    return subprocess.run(command, capture_output=True, text=True, check=True).stdout


def test_a_recording_holds_the_scene_graph(tmp_path: Path, play: Play) -> None:
    path = tmp_path / "recording.rrd"
    play(recorder(path))
    text = printed(path)
    for entity in (
        "truth/walls",
        "truth/rooms",
        "truth/robot",
        "truth/path/0",
        "map/robot",
        "map/robot/scan",
        "map/path/0",
        "map/odometry/0",
        "map/returns",
        "map/planes/0",
        "map/rooms/7/floor",
        "map/walls/0/slab",
        "map/graph/rooms/7/edges",
        "map/graph/rooms/8/node",
        "map/graph/floors/0/node",
        "map/judgement/false",
        "truth/judgement/missed",
    ):
        assert f"/world/{entity}" in text, entity
    for words in ("index_name: sim_time", "index_name: keyframe", "room 7 (0.90)", "office"):
        assert words in text
    for words in (
        "room 7 found",
        "room 8 retracted",
        "loop closed",
        "/plots/found",
        "rooms right",
        "/plots/ms",
    ):
        assert words in text


def test_a_recording_of_a_real_robot_has_no_truth(tmp_path: Path, play: Play) -> None:
    path = tmp_path / "recording.rrd"
    play(recorder(path), with_truth=False)
    text = printed(path)
    assert "/world/map/planes" in text
    assert "/world/truth" not in text
    assert "judgement/false" not in text.replace("- /world/map/judgement", "")


def test_a_recording_appears_only_when_it_is_complete(tmp_path: Path) -> None:
    path = tmp_path / "recording.rrd"
    sink = recorder(path)
    sink.started(RunConfig("hand-made"), None)
    assert not path.exists()
    sink.finished()
    assert path.stat().st_size > 0
    assert [entry.name for entry in tmp_path.iterdir()] == ["recording.rrd"]


def test_no_pose_stays_behind(tmp_path: Path, play: Play, monkeypatch: pytest.MonkeyPatch) -> None:
    waiting: list[Poses] = []

    def send(poses: Poses, _: object) -> None:
        waiting[:] = [other for other in waiting if other is not poses]

    monkeypatch.setattr(Poses, "add", lambda poses, *_: waiting.append(poses))
    monkeypatch.setattr(Poses, "send", send)
    play(recorder(tmp_path / "recording.rrd"))
    assert not waiting


def test_finishing_twice_or_before_the_start_is_harmless(tmp_path: Path, play: Play) -> None:
    sink = recorder(tmp_path / "recording.rrd")
    sink.finished()
    assert not any(tmp_path.iterdir())
    play(sink)
    sink.finished()
    assert (tmp_path / "recording.rrd").stat().st_size > 0


def test_the_fan_out_tells_everyone_everything(play: Play) -> None:
    class Listener(NullSink):
        def __init__(self) -> None:
            self.heard: list[str] = []

        def started(self, *_: object) -> None:
            self.heard.append("started")

        def frame(self, *_: object) -> None:
            self.heard.append("frame")

        def updated(self, *_: object) -> None:
            self.heard.append("updated")

        def timed(self, *_: object) -> None:
            self.heard.append("timed")

        def event(self, *_: object) -> None:
            self.heard.append("event")

        def finished(self) -> None:
            self.heard.append("finished")

    first, second = Listener(), Listener()
    play(Sinks([first, NullSink(), second]))
    told = ["started", "updated", "timed", "event", *["frame"] * 4, *["updated"] * 2, "finished"]
    assert first.heard == second.heard == told


@pytest.mark.parametrize(
    ("save", "watchers", "kind"),
    [(True, (), Sinks), (False, (), NullSink), (False, (NullSink(),), Sinks)],
)
def test_the_sink_follows_the_configuration(
    tmp_path: Path, save: bool, watchers: tuple[Sink, ...], kind: type
) -> None:
    assert isinstance(make_sink(RunConfig("SE1", save=save), tmp_path, watchers), kind)
