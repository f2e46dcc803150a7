"""Round trips of every file of a run folder, bad input of every kind, and files whole or absent."""

from __future__ import annotations

import dataclasses
import json
import os
from pathlib import Path

import numpy as np
import pytest

from eval.files import whole_file, write_text
from eval.graphfile import (
    FloorNode,
    GraphEdge,
    KeyframeNode,
    PieceEntry,
    PlaneNode,
    RoomNode,
    SceneGraph,
    WallNode,
    graph_json,
    read_graph,
    write_graph,
)
from eval.metrics import SCHEMA, Latency, Loops, Metrics, Planes, Rooms, Stages, StageTime, Walls
from eval.outputs import (
    ADDED,
    metrics_json,
    read_metrics,
    read_tum,
    write_metrics,
    write_ply,
    write_tum,
)
from eval.pointfile import ply_vertices, read_cloud
from eval.score.consistency import ChiSquares, Consistency, Nees
from eval.score.failures import Failures
from eval.score.trajectory import Trajectory
from slam.core import InputError, pose, so3_exp

SEGMENT = np.array([[0.0, 1.0], [2.5, 1.0]])


def trajectory(count: int = 20) -> Trajectory:
    rng = np.random.default_rng(0)
    turns = so3_exp(rng.normal(0.0, 1.0, (count, 3)))
    poses = [pose(R, t) for R, t in zip(turns, rng.normal(0.0, 30.0, (count, 3)), strict=True)]
    return Trajectory(0.1 * np.arange(1, count + 1), np.array(poses).reshape(-1, 4, 4))


def graph() -> SceneGraph:
    plane = PlaneNode("p0", np.array([0.0, -1.0, 0.0]), 1.0, SEGMENT, (0.0, 2.5))
    piece = PieceEntry("p0", SEGMENT)
    return SceneGraph(
        nodes=(
            KeyframeNode("k0", np.eye(4)),
            plane,
            dataclasses.replace(plane, id="p1"),
            WallNode("w0", ("p0", "p1")),
            RoomNode(
                "r0", (piece,), np.array([[0, 0], [1, 0], [1, 1.0]]), np.array([0.6, 0.3]), 0.9
            ),
            RoomNode("r1", (), None, np.array([5.0, 5.0]), 0.5),
            FloorNode("f0"),
        ),
        edges=(GraphEdge("observes", "k0", "p0"), GraphEdge("room", "r0", "p0")),
        truth={"p0": "surface 3", "r0": "Kitchen", "r1": "false"},
    )


def metrics() -> Metrics:
    time = StageTime(1.0, 2.0, 3.0)
    numbers = {field.name: 0.25 for field in dataclasses.fields(Metrics)}
    texts = ["status", "scene", "scene_sha256", "sensor", "conditions", "detector", "layers"]
    texts += ["factors", "odometry"]
    return Metrics(
        **numbers
        | dict.fromkeys(texts, "text")
        | {
            "schema": SCHEMA,
            "error": None,
            "seed": 3,
            "scans_skipped": 2,
            "versions": {"numpy": "2.0"},
            "T_world_map": tuple(map(tuple, np.eye(4).tolist())),
            "planes": Planes(4, 3, 2, 1),
            "rooms": Rooms(6, 5, 4.5, 4.0, 4.0 / 4.5, 0.8),
            "walls": Walls(),
            "failures": Failures(missed_edges=2),
            "loops": Loops(1, 2, 3),
            "consistency": Consistency(Nees(1.5, 0.9), chi2=ChiSquares(odometry=0.5)),
            "room_latency_s": Latency(0.5, None),
            "stages": Stages(time, time, time, time),
        }
    )


def equal(a: object, b: object) -> bool:
    """Equality of nodes that hold arrays."""
    if dataclasses.is_dataclass(a):
        pairs = [(getattr(a, f.name), getattr(b, f.name)) for f in dataclasses.fields(a)]
        return type(a) is type(b) and all(equal(x, y) for x, y in pairs)
    if isinstance(a, np.ndarray):
        return np.array_equal(a, b)
    if isinstance(a, tuple):
        return len(a) == len(b) and all(map(equal, a, b))
    return a == b


def test_tum_round_trip(tmp_path: Path) -> None:
    path = tmp_path / "trajectory.tum"
    written = trajectory()
    write_tum(written, path)
    back = read_tum(path)
    assert np.allclose(back.stamps, written.stamps, atol=5e-7)
    assert np.allclose(back.positions, written.positions, atol=5e-7)
    assert np.allclose(back.poses, written.poses, atol=3e-6)
    lines = path.read_text().splitlines()
    assert len(lines) == 20
    assert all(len(word.split(".")[1]) == 6 for word in lines[3].split())


def test_tum_is_what_evo_reads(tmp_path: Path) -> None:
    evo = pytest.importorskip("evo.core.trajectory")
    path = tmp_path / "trajectory.tum"
    written = trajectory()
    write_tum(written, path)
    table = np.loadtxt(path)
    theirs = evo.PoseTrajectory3D(table[:, 1:4], table[:, [7, 4, 5, 6]], table[:, 0])
    assert np.allclose(np.array(theirs.poses_se3), written.poses, atol=3e-6)


def test_an_empty_trajectory(tmp_path: Path) -> None:
    path = tmp_path / "trajectory.tum"
    write_tum(trajectory(0), path)
    assert path.read_text() == ""
    assert len(read_tum(path)) == 0


def test_ply_round_trip(tmp_path: Path) -> None:
    rng = np.random.default_rng(0)
    points, ids = rng.normal(0.0, 20.0, (1000, 3)), rng.integers(0, 90, 1000)
    path = tmp_path / "map.ply"
    write_ply(points, ids, path)
    assert np.abs(read_cloud(path) - points).max() < 1e-5
    assert np.array_equal(ply_vertices(path)["plane_id"], ids)
    write_ply(np.empty((0, 3)), np.empty(0, dtype=np.int64), path)
    assert len(ply_vertices(path)) == 0


def test_ply_is_what_others_read(tmp_path: Path) -> None:
    o3d = pytest.importorskip("open3d")
    points = np.random.default_rng(0).normal(0.0, 20.0, (50, 3))
    path = tmp_path / "map.ply"
    write_ply(points, np.arange(50), path)
    theirs = o3d.t.io.read_point_cloud(str(path)).point
    assert np.allclose(theirs.positions.numpy(), points, atol=1e-5)
    assert np.array_equal(theirs.plane_id.numpy().ravel(), np.arange(50))


def test_graph_round_trip(tmp_path: Path) -> None:
    path = tmp_path / "graph.json"
    write_graph(graph(), path)
    assert equal(read_graph(path), graph())
    tree = json.loads(path.read_text())
    assert list(tree) == ["schema", "nodes", "edges", "truth"]
    assert list(tree["nodes"][0]) == ["id", "layer", "T_map_base"]
    assert list(tree["nodes"][1]) == ["id", "layer", "normal", "d", "segment", "z_range"]
    assert list(tree["nodes"][3]) == ["id", "layer", "planes"]
    keys = ["id", "layer", "pieces", "polygon", "centre", "confidence"]
    assert list(tree["nodes"][4]) == keys
    assert tree["edges"][0] == {"type": "observes", "from": "k0", "to": "p0"}
    layers = ["keyframe", "plane", "plane", "wall", "room", "room", "floor"]
    assert [node["layer"] for node in tree["nodes"]] == layers


def test_the_graph_can_be_read_without_its_truth(tmp_path: Path) -> None:
    path = tmp_path / "graph.json"
    tree = json.loads(graph_json(graph()))
    del tree["truth"]
    path.write_text(json.dumps(tree))
    assert equal(read_graph(path), dataclasses.replace(graph(), truth={}))
    start = graph_json(graph()).split('"truth"')[0]
    assert start == graph_json(dataclasses.replace(graph(), truth={})).split('"truth"')[0]


def test_metrics_round_trip(tmp_path: Path) -> None:
    path = tmp_path / "metrics.json"
    write_metrics(metrics(), path)
    assert read_metrics(path) == metrics()


def test_nan_is_never_written() -> None:
    rooms = Rooms(precision=float("nan"), recall=float("inf"))
    broken = dataclasses.replace(metrics(), ate_m=np.float64("nan"), seed=np.int64(4), rooms=rooms)
    tree = json.loads(metrics_json(broken), parse_constant=pytest.fail)
    assert (tree["ate_m"], tree["rooms"]["precision"], tree["rooms"]["recall"]) == (None,) * 3
    assert tree["seed"] == 4


TUM = "0.1 0 0 0 0 0 0 1\n"


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (TUM + "0.2 0 0 0 0 0 1\n", "line 2: 8 finite numbers"),
        (TUM + "0.2 0 0 zero 0 0 0 1\n", "line 2: 8 numbers"),
        (TUM + "0.2 0 0 nan 0 0 0 1\n", "line 2: 8 finite numbers"),
        (TUM + "0.2 0 0 0 0 0 0 0\n", "line 2: a unit quaternion"),
        (TUM + TUM, "stamps: an ascending order"),
    ],
)
def test_broken_tum(tmp_path: Path, text: str, message: str) -> None:
    path = tmp_path / "t.tum"
    path.write_text(text)
    with pytest.raises(InputError, match=message) as caught:
        read_tum(path)
    assert str(path) in str(caught.value)


def test_broken_ply(tmp_path: Path) -> None:
    path = tmp_path / "map.ply"
    write_ply(np.zeros((3, 3)), np.zeros(3, dtype=np.int64), path)
    good = path.read_bytes()
    for data, message in (
        (b"", "a PLY file"),
        (b"\xff\x00" * 40, "a PLY file"),
        (good[:-1], "48 bytes for 3 points"),
        (good.replace(b"vertex 3", b"vertex x"), "element vertex COUNT"),
        (good.replace(b"binary_little", b"ascii"), "format: "),
        (good.replace(b"float y", b"float w"), "properties x, y and z"),
        (good[:-48] + np.full(12, np.nan, "<f4").tobytes(), "finite coordinates"),
    ):
        path.write_bytes(data)
        with pytest.raises(InputError, match=message):
            read_cloud(path)


def change(tree: dict, path: str, value: object) -> dict:
    *parents, last = [int(key) if key.isdigit() else key for key in path.split(".")]
    item = tree
    for key in parents:
        item = item[key]
    if value is KeyError:
        del item[last]
    else:
        item[last] = value
    return tree


@pytest.mark.parametrize(
    ("at", "value", "message"),
    [
        ("schema", "roomloop-0", "schema"),
        ("nodes", {}, "nodes: a list"),
        ("nodes.0", 3, r"nodes\[0\]: an object"),
        ("nodes.0.id", 3, r"nodes\[0\].id: a string"),
        ("nodes.0.layer", "roof", r"nodes\[0\].layer"),
        ("nodes.0.T_map_base", [[1, 2], [3]], r"nodes\[0\].T_map_base: 4 x 4 finite"),
        ("nodes.1.normal", [0, 1], r"nodes\[1\].normal: 3 finite"),
        ("nodes.1.d", "x", r"nodes\[1\].d: a finite number"),
        ("nodes.1.d", None, r"nodes\[1\].d: a finite number"),
        ("nodes.1.id", "p1", "'p1' appears twice"),
        ("nodes.3.planes", ["p0", "p9"], "'p9' is named"),
        ("nodes.3.planes", [1], r"nodes\[3\].planes: ids"),
        ("nodes.4.pieces.0.segment", KeyError, r"pieces\[0\].segment: 2 x 2"),
        ("nodes.4.polygon", [1, 2], r"nodes\[4\].polygon: n x 2"),
        ("nodes.4.centre", [1, float("nan")], r"nodes\[4\].centre: 2 finite"),
        ("edges.0.from", "k7", "'k7' is named"),
        ("edges.0.type", KeyError, r"edges\[0\].type: a string"),
        ("truth.p7", "x", "'p7' is named"),
        ("truth.p0", 3, "truth: labels as strings"),
    ],
)
def test_broken_graph(tmp_path: Path, at: str, value: object, message: str) -> None:
    path = tmp_path / "graph.json"
    path.write_text(json.dumps(change(json.loads(graph_json(graph())), at, value)))
    with pytest.raises(InputError, match=message):
        read_graph(path)


def test_a_graph_that_names_what_it_lacks_is_not_written(tmp_path: Path) -> None:
    broken = dataclasses.replace(graph(), edges=(GraphEdge("x", "k0", "p5"),))
    with pytest.raises(InputError, match="'p5' is named"):
        write_graph(broken, tmp_path / "graph.json")
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    ("at", "value", "message"),
    [
        ("schema", 1, "schema"),
        ("ate_m", "0.1", "ate_m"),
        ("ate_m", True, "ate_m"),
        ("seed", None, "seed: a value"),
        ("seed", 1.5, "seed"),
        ("ate_m", KeyError, "ate_m: this key is missing"),
        ("rooms.precision", KeyError, "rooms.precision: this key is missing"),
        ("rooms.presicion", 1.0, "rooms.presicion: this key is not known"),
        ("stages.lidar", 3, "stages.lidar.: an object"),
        ("T_world_map", [[1]], "T_world_map: 4 x 4"),
        ("versions", [], "versions"),
    ],
)
def test_broken_metrics(tmp_path: Path, at: str, value: object, message: str) -> None:
    path = tmp_path / "metrics.json"
    path.write_text(json.dumps(change(json.loads(metrics_json(metrics())), at, value)))
    with pytest.raises(InputError, match=message):
        read_metrics(path)


def test_results_of_earlier_versions_are_read(tmp_path: Path) -> None:
    path = tmp_path / "metrics.json"
    tree = json.loads(metrics_json(metrics()))
    for name in ADDED:
        change(tree, name, KeyError)
    path.write_text(json.dumps(tree))
    assert read_metrics(path) == metrics()


@pytest.mark.parametrize("read", [read_graph, read_metrics])
@pytest.mark.parametrize(
    ("data", "message"),
    [(b'{"a": ', "expected JSON: .* at line 1"), (b"[]", "a JSON object"), (b"\xff\xfe", "UTF-8")],
)
def test_what_is_not_json(tmp_path: Path, read, data: bytes, message: str) -> None:
    path = tmp_path / "x.json"
    path.write_bytes(data)
    with pytest.raises(InputError, match=message):
        read(path)


@pytest.mark.parametrize("read", [read_graph, read_metrics, ply_vertices, read_tum])
def test_what_is_not_there(tmp_path: Path, read) -> None:
    for path in (tmp_path / "absent", tmp_path):
        with pytest.raises(InputError, match="cannot be read"):
            read(path)


def test_a_folder_that_is_not_there(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="cannot be written"):
        write_tum(trajectory(), tmp_path / "absent" / "trajectory.tum")


def half_written(path: Path) -> None:
    with whole_file(path) as part:
        part.write_text("half of the n")
        raise ZeroDivisionError


def test_a_failed_write_leaves_the_old_file_and_nothing_else(tmp_path: Path) -> None:
    path = tmp_path / "metrics.json"
    write_text(path, "old")
    with pytest.raises(ZeroDivisionError):
        half_written(path)
    assert path.read_text() == "old"
    assert os.listdir(tmp_path) == ["metrics.json"]
    write_text(path, "new")
    assert path.read_text() == "new"
    assert os.listdir(tmp_path) == ["metrics.json"]


def test_the_file_appears_only_when_it_is_whole(tmp_path: Path) -> None:
    path = tmp_path / "map.ply"
    with whole_file(path) as part:
        part.write_bytes(b"half")
        assert not path.exists()
    assert path.read_bytes() == b"half"
