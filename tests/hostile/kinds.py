"""Every kind of file that a user can hand over: a valid one, small, and how it is read."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import buildings
import drawings
import numpy as np
from bagfiles import Bag, drive
from fakes import metrics_of
from packetfiles import Capture, capture_of, encode, turning, write_packets

from eval.comparing.compare import read_results
from eval.comparing.scenario import read_scenario
from eval.config import RunConfig
from eval.files import write_text
from eval.folder import config_text, read_config
from eval.foreign import read_dsg, read_rooms
from eval.graphfile import (
    FloorNode,
    GraphEdge,
    KeyframeNode,
    PieceEntry,
    PlaneNode,
    RoomNode,
    SceneGraph,
    WallNode,
    read_graph,
    write_graph,
)
from eval.outputs import read_metrics, read_tum, write_metrics, write_ply, write_tum
from eval.pointfile import read_cloud, thinned
from eval.recordings import open_recording
from eval.recordings.labels import LabelsFile, LabelsWriter
from eval.report.ablation import ablation_page
from eval.report.run import read_run, run_page
from eval.roomtable import RoomRow, write_rooms
from eval.roomtable import read_rooms as read_room_table
from eval.score.trajectory import Trajectory
from semantics.network import load
from sim.sensorfile import read_sensor
from sim.truth import ScanTruth
from worlds.planfile import read_plan
from worlds.readers import read_building
from worlds.truth import Truth
from worlds.truthfile import TruthFile, read_truth, write_truth
from worlds.world import build_world

ROOT = Path(__file__).parents[2]


@dataclass(frozen=True)
class Kind:
    """make: writes a valid one into a folder, and says which file is to be spoilt; read: takes it,
    or refuses it; text: is it text that people write?"""

    make: Callable[[Path], Path]
    read: Callable[[Path], object]
    text: bool = True


def _mesh(suffix: str) -> Callable[[Path], Path]:
    def make(folder: Path) -> Path:
        path = folder / f"building.{suffix}"
        buildings.building().export(path)
        return path

    return make


def _saved(name: str, content: str | bytes | object) -> Callable[[Path], Path]:
    def make(folder: Path) -> Path:
        path = folder / name
        text = content if isinstance(content, str | bytes) else json.dumps(content)
        path.write_bytes(text if isinstance(text, bytes) else text.encode())
        return path

    return make


def _bag(kind: str, pattern: str) -> Callable[[Path], Path]:
    def make(folder: Path) -> Path:
        path = Bag(drive(3)).write(folder / "drive", kind)
        return path if path.is_file() else next(path.glob(pattern))

    return make


def _scans(path: Path) -> None:
    for _ in open_recording(path):
        pass


def _run(folder: Path) -> Path:
    """A run's folder with everything that its page is made of."""
    config = RunConfig("SE1", seed=3, duration=5.0)
    write_text(folder / "config.json", config_text(config))
    write_metrics(metrics_of(config), folder / "metrics.json")
    angles = np.linspace(0.0, 6.0, 20)
    poses = np.tile(np.eye(4), (20, 1, 1))
    poses[:, 0, 3], poses[:, 1, 3] = np.cos(angles), np.sin(angles)
    for name in ("trajectory", "odometry", "truth"):
        write_tum(Trajectory(0.1 * np.arange(20), poses), folder / f"{name}.tum")
    square = np.array([[0.0, 0.0], [4.0, 0.0], [4.0, 3.0], [0.0, 3.0]])
    south = PlaneNode("p0", np.array([0.0, 1.0, 0.0]), 0.0, square[:2], (0.0, 2.5))
    north = PlaneNode("p1", np.array([0.0, -1.0, 0.0]), 3.0, square[2:], (0.0, 2.5))
    pieces = (PieceEntry("p0", square[:2]), PieceEntry("p1", square[2:]))
    room = RoomNode("r0", pieces, square, np.array([2.0, 1.5]), 0.9)
    keyframe, wall = KeyframeNode("x0", np.eye(4)), WallNode("w0", ("p0", "p1"))
    edges = (GraphEdge("observes", "x0", "p0"), GraphEdge("room", "r0", "p0"))
    nodes = (keyframe, south, north, wall, room, FloorNode("f0"))
    write_graph(SceneGraph(nodes, edges, {"r0": "hall", "p0": "surface 3"}), folder / "graph.json")
    write_ply(np.ones((50, 3)), np.zeros(50, np.int64), folder / "map.ply")
    rows = [RoomRow("hall", "found", "r0"), RoomRow("caf\u00e9", "missed", cause="edges")]
    write_rooms(rows, folder / "rooms.csv")
    return folder


def _of_run(name: str) -> Callable[[Path], Path]:
    return lambda folder: _run(folder) / name


def _page(path: Path) -> None:
    run_page(read_run(path.parent))


def _truth(path: Path) -> Truth:
    plan = drawings.write(drawings.house(), path.parent)
    return build_world(read_plan(plan), np.random.SeedSequence(1)).truth


def _truth_file(folder: Path) -> Path:
    path = folder / "truth.json"
    write_truth(TruthFile(_truth(path), "house", 1, "as-built"), path)
    return path


def _labels(folder: Path) -> Path:
    path = folder / "labels.npz"
    with LabelsWriter(path, RunConfig("SE1"), _truth(path)) as labels:
        for index in range(3):
            points = np.ones((40, 3), np.float32)
            faces = np.zeros(40, np.int32)
            labels.write(0.1 * index, ScanTruth(np.eye(4), faces, faces, points))
    return path


def _read_labels(path: Path) -> None:
    labels = LabelsFile(path)
    for index in range(3):
        labels.at(0.1 * index)


def _dsg(folder: Path) -> Path:
    def node(id: int, layer: int, kind: str, **more: object) -> dict[str, object]:
        attributes = {"type": f"{kind}NodeAttributes", "position": [1.0, 2.0, 0.5], **more}
        return {"id": id, "layer": layer, "partition": 0, "attributes": attributes}

    turn = {"w": 1.0, "x": 0.0, "y": 0.0, "z": 0.0}
    square = [[0, 0], [4, 0], [4, 3], [0, 3]]
    nodes = [
        node(1, 4, "Room", metadata={"polygon": square}),
        node(2, 4, "Room"),
        node(3, 3, "Place", distance=1.0),
        node(4, 2, "Agent", world_R_body=turn, timestamp=1_000_000_000),
        node(5, 2, "Agent", world_R_body=turn, timestamp=2_000_000_000),
    ]
    tree = {
        "layer_names": {"ROOMS": {"layer": 4, "partition": 0}},
        "nodes": nodes,
        "edges": [{"source": 2, "target": 3}],
    }
    return _saved("dsg.json", tree)(folder)


def _cloud(suffix: str) -> Callable[[Path], Path]:
    def make(folder: Path) -> Path:
        import open3d as o3d

        path = folder / f"cloud.{suffix}"
        points = np.random.default_rng(0).normal(size=(60, 3))
        cloud = o3d.geometry.PointCloud(o3d.utility.Vector3dVector(points))
        o3d.io.write_point_cloud(path, cloud, write_ascii=suffix == "pcd")
        return path

    return make


def _weights(folder: Path) -> Path:
    path = folder / "gnn.npz"
    path.write_bytes((ROOT / "semantics" / "weights" / "gnn.npz").read_bytes())
    return path


def _capture(folder: Path) -> Path:
    return capture_of(encode(*turning(1850)), Capture()).write(folder / "drive.pcap")


def _packets(folder: Path) -> Path:
    return write_packets(folder / "drive.bin", encode(*turning(1850)))


def _score_cloud(path: Path) -> None:
    thinned(read_cloud(path), 0.05)


SCENARIO = """scene = "SE1"
seeds = [0, 1]
duration = 60.0
markers = ["slow"]
[expect]
ate_m = "<= 0.04"
"rooms.precision" = ">= 0.95"
"""
SENSOR = (ROOT / "sim" / "sensors" / "ideal.toml").read_text()
ROOMS = {"rooms": [{"polygon": [[0, 0], [4, 0], [4, 3]]}, {"centre": [1.0, 2.0], "name": "a"}]}

MESHES = ("obj", "stl", "ply", "glb")
PAGE = ("config.json", "metrics.json", "graph.json", "truth.tum")

KINDS: dict[str, Kind] = {
    "plan": Kind(lambda folder: drawings.write(drawings.house(), folder), read_building),
    "floor plan": Kind(_saved("floor.json", buildings.floorplan()), read_building),
    "map": Kind(lambda folder: buildings.rosmap(folder, buildings.drawn_map()), read_building),
    "dae": Kind(lambda folder: buildings.dae(buildings.building(), folder), read_building),
    **{suffix: Kind(_mesh(suffix), read_building, False) for suffix in MESHES},
    "truth": Kind(_truth_file, read_truth),
    "scenario": Kind(_saved("one.toml", SCENARIO), lambda path: read_scenario(str(path))),
    "sensor": Kind(_saved("mine.toml", SENSOR), read_sensor),
    "config": Kind(_of_run("config.json"), read_config),
    "metrics": Kind(_of_run("metrics.json"), read_metrics),
    "graph": Kind(_of_run("graph.json"), read_graph),
    "trajectory": Kind(_of_run("trajectory.tum"), read_tum),
    "map.ply": Kind(_of_run("map.ply"), _score_cloud, False),
    "rooms table": Kind(_of_run("rooms.csv"), read_room_table),
    **{f"page of {name}": Kind(_of_run(name), _page) for name in PAGE},
    "ablation table": Kind(
        _saved("table.csv", "variant,ate_m\nplanes,0.01\n"),
        lambda path: ablation_page(path.parent),
    ),
    "results": Kind(_of_run("metrics.json"), lambda path: read_results(path.parent)),
    "rooms": Kind(_saved("rooms.json", ROOMS), read_rooms),
    "dsg": Kind(_dsg, read_dsg),
    "cloud ply": Kind(_cloud("ply"), _score_cloud, False),
    "cloud pcd": Kind(_cloud("pcd"), _score_cloud),
    "weights": Kind(_weights, load, False),
    "labels": Kind(_labels, _read_labels, False),
    "pcap": Kind(_capture, _scans, False),
    "packets": Kind(_packets, _scans, False),
    "ros1": Kind(_bag("ros1", ""), _scans, False),
    "db3": Kind(_bag("sqlite3", "*.db3"), _scans, False),
    "mcap": Kind(_bag("mcap", "*.mcap"), _scans, False),
}
