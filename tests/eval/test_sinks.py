"""The recording is written, read back, and holds the scene graph."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from shapely.geometry import box

from eval.config import RunConfig
from eval.recording import RecordingSink
from eval.sinks import NullSink, Sinks, make_sink
from slam.core import (
    Frame,
    Keyframe,
    KeyframeScan,
    MapPlane,
    MapView,
    PlanePiece,
    Proposals,
    RoomProposal,
    Scan,
    WallProposal,
    pose,
)
from worlds.truth import Face, Floor, Room, Truth, Wall

CONFIG = RunConfig("hand-made", save=True)


def truth() -> Truth:
    """One room of 4 m x 3 m, and the outer face of nothing else."""
    corners = np.array([[0.0, 0.0], [4.0, 0.0], [4.0, 3.0], [0.0, 3.0]])
    inward = [(0.0, 1.0), (-1.0, 0.0), (0.0, -1.0), (1.0, 0.0)]
    faces = []
    for i, (x, y) in enumerate(inward):
        segment = np.array([corners[i], corners[(i + 1) % 4]])
        normal = np.array([x, y, 0.0])
        d = -float(normal[:2] @ segment[0])
        faces.append(Face(i, 0, normal, d, segment, segment[None], (0.0, 2.7), i))
    room = Room(0, "office", "room", 0, box(0, 0, 4, 3), (0, 1, 2, 3))
    return Truth(tuple(faces), (Wall(0, (0, 2), 3.0),), (room,), (), (Floor(0, 0.0, 2.7),))


def plane(identity: int, normal: tuple[float, float, float], d: float, points: object) -> MapPlane:
    cloud = np.asarray(points, dtype=float)
    ids = np.arange(len(cloud))
    return MapPlane(identity, np.array(normal), d, cloud, ids, np.array([0]))


def view() -> MapView:
    rng = np.random.default_rng(0)
    along, up = rng.uniform(-2, 2, 200), rng.uniform(0, 2, 200)
    south = np.column_stack([along, np.full(200, -1.5), up])
    north = np.column_stack([along, np.full(200, 1.5), up])
    floor = np.column_stack([along, up, np.zeros(200)])
    planes = (
        plane(0, (0.0, 1.0, 0.0), 1.5, south),
        plane(1, (0.0, -1.0, 0.0), 1.5, north),
        plane(2, (0.0, 0.0, 1.0), 0.0, floor),
    )
    scan = KeyframeScan((), np.zeros((0, 3)), np.zeros(3))
    return MapView(0.1, planes, (Keyframe(0, 0, 0.1, np.eye(4), scan),))


def proposals() -> Proposals:
    pieces = (
        PlanePiece(0, np.array([[-2.0, -1.5], [2.0, -1.5]])),
        PlanePiece(1, np.array([[2.0, 1.5], [-2.0, 1.5]])),
    )
    polygon = np.array([[-2.0, -1.5], [2.0, -1.5], [2.0, 1.5], [-2.0, 1.5]])
    room = RoomProposal(7, pieces, polygon, np.zeros(2), 0.9)
    without_planes = RoomProposal(8, (), None, np.ones(2), 0.5)
    return Proposals((room, without_planes), (WallProposal(0, pieces, 0.8),))


def scan(index: int) -> Scan:
    points = np.random.default_rng(index).normal(size=(400, 3))
    flat = np.zeros(400)
    return Scan(index, 0.1 * (index + 1), points, flat, flat.astype(np.int16), flat)


def play(sink: Sinks | RecordingSink | NullSink) -> None:
    T_world_base = pose(np.eye(3), np.array([2.0, 1.5, 0.0]))
    sink.started(CONFIG, truth())
    for index in range(4):
        frame = Frame(index, 0.1 * (index + 1), np.eye(4), np.eye(4), None)
        sink.frame(frame, scan(index), np.eye(4), T_world_base)
    sink.updated(view(), proposals())
    sink.updated(view(), Proposals())
    sink.finished()


def printed(path: Path) -> str:
    command = [str(Path(sys.executable).with_name("rerun")), "rrd", "print", "-vvv", str(path)]
    return subprocess.run(command, capture_output=True, text=True, check=True).stdout


def test_a_recording_holds_the_scene_graph(tmp_path: Path) -> None:
    path = tmp_path / "recording.rrd"
    play(RecordingSink(path))
    text = printed(path)
    for entity in (
        "truth/walls",
        "truth/rooms",
        "truth/robot",
        "map/robot",
        "map/robot/scan",
        "map/path",
        "map/planes",
        "map/rooms",
        "map/rooms/outlines",
        "map/rooms/pieces",
        "map/walls",
    ):
        assert f"/world/{entity}" in text
    assert "index_name: sim_time" in text
    assert "index_name: keyframe" in text
    assert "room 7 (0.90)" in text
    assert "room 8 (0.50)" in text
    assert "office" in text


def test_a_recording_appears_only_when_it_is_complete(tmp_path: Path) -> None:
    path = tmp_path / "recording.rrd"
    sink = RecordingSink(path)
    sink.started(CONFIG, None)
    assert not path.exists()
    sink.finished()
    assert path.stat().st_size > 0
    assert [entry.name for entry in tmp_path.iterdir()] == ["recording.rrd"]


def test_a_recording_of_a_real_robot_has_no_truth(tmp_path: Path) -> None:
    path = tmp_path / "recording.rrd"
    sink = RecordingSink(path)
    sink.started(CONFIG, None)
    sink.frame(Frame(0, 0.1, np.eye(4), np.eye(4), None), scan(0), np.eye(4))
    sink.updated(view(), proposals())
    sink.finished()
    text = printed(path)
    assert "/world/map/planes" in text
    assert "/world/truth" not in text


def test_finishing_twice_or_before_the_start_is_harmless(tmp_path: Path) -> None:
    sink = RecordingSink(tmp_path / "recording.rrd")
    sink.finished()
    assert not any(tmp_path.iterdir())
    play(sink)
    sink.finished()
    assert (tmp_path / "recording.rrd").stat().st_size > 0


def test_the_fan_out_tells_everyone_everything(tmp_path: Path) -> None:
    class Listener(NullSink):
        def __init__(self) -> None:
            self.heard: list[str] = []

        def started(self, *_: object) -> None:
            self.heard.append("started")

        def frame(self, *_: object) -> None:
            self.heard.append("frame")

        def updated(self, *_: object) -> None:
            self.heard.append("updated")

        def finished(self) -> None:
            self.heard.append("finished")

    first, second = Listener(), Listener()
    play(Sinks([first, NullSink(), second]))
    assert first.heard == second.heard == ["started", *["frame"] * 4, *["updated"] * 2, "finished"]


@pytest.mark.parametrize(("save", "kind"), [(True, RecordingSink), (False, NullSink)])
def test_the_sink_follows_the_configuration(tmp_path: Path, save: bool, kind: type) -> None:
    assert isinstance(make_sink(RunConfig("SE1", save=save), tmp_path), kind)
