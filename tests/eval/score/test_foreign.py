"""Foreign results: scored by hand-made errors of known size, and every file that cannot be read."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import open3d as o3d
import pytest
from shapely.geometry import Polygon

from eval.cli import main
from eval.config import RunConfig
from eval.foreign import read_dsg, read_rooms
from eval.outputs import read_metrics, write_ply, write_tum
from eval.pointfile import read_cloud, thinned
from eval.score.foreign import Foreign, at_stamps, base_poses, score_foreign
from eval.score.trajectory import Trajectory
from eval.source import make_world
from sim.base import BaseConfig
from slam.core import Array, InputError, inverse, pose, so3_exp, transform_points
from worlds.world import World

CONFIG = RunConfig("SE1", conditions="ideal")


@pytest.fixture(scope="module")
def world() -> World:
    return make_world(CONFIG)


@pytest.fixture(scope="module")
def drive(world: World) -> Trajectory:
    """True poses: some seconds in the middle of each of three rooms, and what lies between."""
    centres = [np.array(r.polygon.representative_point().coords[0]) for r in world.truth.rooms[:3]]
    corners = np.repeat(centres, 2, axis=0)
    stamps = np.arange(0.0, 50.0, 0.1)
    along = np.interp(stamps, np.arange(6) * 10.0, np.arange(6.0))
    poses = np.tile(np.eye(4), (len(stamps), 1, 1))
    for axis in range(2):
        poses[:, axis, 3] = np.interp(along, np.arange(6.0), corners[:, axis])
    turns = so3_exp(np.outer(np.sin(0.2 * stamps), [0.0, 0.0, 1.0]))
    poses[:, :3, :3] = turns
    return Trajectory(stamps, poses)


T_MAP_WORLD = pose(so3_exp(np.array([0.0, 0.0, 0.7])), np.array([3.0, -2.0, 0.4]))


def moved(trajectory: Trajectory) -> Trajectory:
    return Trajectory(trajectory.stamps, T_MAP_WORLD @ trajectory.poses)


# --- trajectory -----------------------------------------------------------------------------------


def test_a_trajectory_in_any_frame_is_aligned(drive: Trajectory) -> None:
    metrics = score_foreign(CONFIG, drive, Foreign(estimate=moved(drive)))
    assert metrics.ate_m == pytest.approx(0.0, abs=1e-6)
    assert metrics.yaw_deg == pytest.approx(0.0, abs=1e-4)
    assert np.allclose(metrics.T_world_map, inverse(T_MAP_WORLD), atol=1e-6)
    assert metrics.mma_m is None
    assert metrics.rooms.entered is None


def test_errors_are_those_that_were_made(drive: Trajectory) -> None:
    bent = moved(drive)
    poses = bent.poses.copy()
    poses[:, 2, 3] += np.where(np.arange(len(poses)) % 2, 0.03, -0.03)
    metrics = score_foreign(CONFIG, drive, Foreign(Trajectory(bent.stamps, poses)))
    assert metrics.ate_m == pytest.approx(0.03, abs=1e-4)
    assert metrics.ate_z_m == pytest.approx(0.03, abs=1e-4)
    assert metrics.ate_xy_m == pytest.approx(0.0, abs=1e-4)


def test_truth_is_taken_at_the_estimates_own_instants(drive: Trajectory) -> None:
    stamps = np.arange(3.03, 45.0, 0.37)
    good, there = at_stamps(drive, stamps)
    assert good.all()
    x = np.interp(stamps, drive.stamps, drive.positions[:, 0])
    assert np.allclose(there.positions[:, 0], x)
    metrics = score_foreign(CONFIG, drive, Foreign(estimate=moved(there)))
    assert metrics.ate_m == pytest.approx(0.0, abs=1e-6)
    good, _ = at_stamps(drive, np.array([-5.0, 3.0, 4.0, 5.0, 900.0]))
    assert good.tolist() == [False, True, True, True, False]


def test_the_lidars_poses_become_the_bases(drive: Trajectory) -> None:
    T = BaseConfig().T_base_lidar
    lidar = Trajectory(drive.stamps, drive.poses @ T)
    assert np.allclose(base_poses(lidar, T).poses, drive.poses)


def test_what_cannot_be_aligned_is_said(drive: Trajectory) -> None:
    late = Trajectory(drive.stamps + 1.7e9, drive.poses)
    with pytest.raises(InputError, match=r"no stamp of its 500 \(17000.* within the true ones"):
        score_foreign(CONFIG, drive, Foreign(estimate=late))
    with pytest.raises(InputError, match="do not lie on a line"):
        score_foreign(CONFIG, drive, Foreign(Trajectory(drive.stamps[:9], drive.poses[:9])))
    with pytest.raises(InputError, match="expected true poses"):
        score_foreign(CONFIG, None, Foreign(estimate=drive))


# --- map ------------------------------------------------------------------------------------------


def off_the_floor(world: World, height: float) -> Array:
    """Points above the middle of the first room's floor."""
    x, y = world.truth.rooms[0].polygon.representative_point().coords[0]
    grid = np.stack(np.meshgrid(np.arange(-0.5, 0.5, 0.06), np.arange(-0.5, 0.5, 0.06)), axis=-1)
    return np.column_stack(
        [grid.reshape(-1, 2) + np.array([x, y]), np.full(grid[..., 0].size, height)]
    )


def test_a_map_is_as_far_off_as_it_was_put(world: World, drive: Trajectory) -> None:
    points = off_the_floor(world, 0.07)
    metrics = score_foreign(CONFIG, None, Foreign(points=points))
    assert metrics.mma_m == pytest.approx(0.07, abs=1e-4)
    both = Foreign(estimate=moved(drive), points=transform_points(T_MAP_WORLD, points))
    assert score_foreign(CONFIG, drive, both).mma_m == pytest.approx(0.07, abs=1e-4)


def test_thinning_keeps_one_point_as_it_is_in_each_voxel() -> None:
    points = np.array([[0.0, 0, 0], [0.01, 0, 0], [0.06, 0, 0], [0.06, 0.2, 0]])
    assert thinned(points, 0.05).tolist() == points[[0, 2, 3]].tolist()


def test_clouds_of_both_kinds_are_read(tmp_path: Path) -> None:
    points = np.array([[1.0, 2.0, 3.0], [4.0, 5.0, 6.0]])
    write_ply(points, np.zeros(2, np.int64), tmp_path / "a.ply")
    (tmp_path / "a.pcd").write_text(
        "VERSION .7\nFIELDS x y z\nSIZE 4 4 4\nTYPE F F F\nCOUNT 1 1 1\nWIDTH 3\nHEIGHT 1\n"
        "VIEWPOINT 0 0 0 1 0 0 0\nPOINTS 3\nDATA ascii\n1 2 3\nnan nan nan\n4 5 6\n"
    )
    for name in ("a.ply", "a.pcd"):
        assert np.allclose(read_cloud(tmp_path / name), points)


@pytest.mark.parametrize("binary", [True, False])
@pytest.mark.parametrize(("suffix", "packed"), [("ply", False), ("pcd", False), ("pcd", True)])
def test_a_cloud_that_is_cut_off_is_refused(
    tmp_path: Path, suffix: str, packed: bool, binary: bool
) -> None:
    """As Open3D writes it; it reads one that is cut off as noise or zeros."""
    points = np.random.default_rng(0).normal(size=(100, 3))
    path = tmp_path / f"cloud.{suffix}"
    cloud = o3d.geometry.PointCloud(o3d.utility.Vector3dVector(points))
    o3d.io.write_point_cloud(path, cloud, write_ascii=not binary, compressed=packed)
    assert np.allclose(read_cloud(path), points, atol=1e-4)
    whole = path.read_bytes()
    for length in (len(whole) * 2 // 3, len(whole) - 60):
        path.write_bytes(whole[:length])
        with pytest.raises(InputError, match=r"cloud\.\w+: body: "):
            read_cloud(path)
    path.write_bytes(whole.replace(b" 100\n", b" 99999999\n"))
    with pytest.raises(InputError, match=r"cloud\.\w+: body: "):
        read_cloud(path)


@pytest.mark.parametrize(
    ("name", "content"), [("a.ply", "no"), ("a.pcd", ""), ("a.xyz", "1 2 3"), ("absent.ply", None)]
)
def test_a_cloud_that_is_none_is_named(tmp_path: Path, name: str, content: str | None) -> None:
    if content is not None:
        (tmp_path / name).write_text(content)
    with pytest.raises(InputError, match=name):
        read_cloud(tmp_path / name)


# --- rooms ----------------------------------------------------------------------------------------


def test_rooms_are_scored_by_their_centres(world: World, drive: Trajectory, tmp_path: Path) -> None:
    truth = world.truth
    outlines = [list(truth.rooms[i].polygon.exterior.coords)[:-1] for i in (0, 1)]
    centre = truth.rooms[2].polygon.representative_point().coords[0]
    rooms = [{"polygon": outline, "name": "a"} for outline in outlines]
    rooms += [{"centre": centre}, {"center": centre}, {"centre": [500.0, 500.0]}]  # type: ignore[dict-item]
    path = tmp_path / "rooms.json"
    path.write_text(json.dumps({"rooms": rooms}))
    found = read_rooms(path)
    score = score_foreign(CONFIG, drive, Foreign(rooms=found)).rooms
    assert score.entered is not None
    assert score.centre_precision == pytest.approx(3 / 5)
    assert score.centre_recall == pytest.approx(3 / score.entered)
    assert score.mean_iou == pytest.approx(1.0)
    assert score.precision is None
    everywhere = score_foreign(CONFIG, None, Foreign(rooms=found)).rooms
    assert everywhere.centre_recall == pytest.approx(3 / len(truth.rooms))


@pytest.mark.parametrize(
    ("tree", "said"),
    [
        ({}, "rooms: a list"),
        ({"rooms": 3}, "rooms: a list"),
        ({"rooms": [3]}, r"rooms\[0\]: an object"),
        ({"rooms": [{}]}, r"rooms\[0\]: a polygon or a centre"),
        ({"rooms": [{"centre": [1]}]}, r"rooms\[0\].centre: 2 finite numbers"),
        ({"rooms": [{"polygon": [[0, 0], [1, 1]]}]}, r"rooms\[0\].polygon: three corners"),
        ({"rooms": [{"polygn": []}]}, r"rooms\[0\].polygn: polygon, centre"),
    ],
)
def test_rooms_that_are_none_are_named(tmp_path: Path, tree: object, said: str) -> None:
    path = tmp_path / "rooms.json"
    path.write_text(json.dumps(tree))
    with pytest.raises(InputError, match=said):
        read_rooms(path)


# --- Spark-DSG ------------------------------------------------------------------------------------


def symbol(letter: str, index: int) -> int:
    return (ord(letter) << 56) | index


def dsg(world: World, drive: Trajectory) -> dict[str, object]:
    """Two rooms, one with an outline and one with places, and the poses of a robot."""

    def node(letter: str, index: int, layer: int, **attributes: object) -> dict[str, object]:
        partition = ord(letter) if letter == "a" else 0
        id = symbol(letter, index)
        return {"id": id, "layer": layer, "partition": partition, "attributes": attributes}

    nodes, edges = [], []
    for index in range(2):
        polygon = world.truth.rooms[index].polygon
        x, y = polygon.representative_point().coords[0]
        outline = {"polygon": list(polygon.exterior.coords)[:-1]} if index == 0 else {}
        nodes.append(
            node("R", index, 4, type="RoomNodeAttributes", position=[x, y, 1.0], metadata=outline)
        )
        place = {"type": "PlaceNodeAttributes", "position": [x, y, 1.0], "distance": 1.0}
        nodes.append(node("p", index, 3, **place))
        edges.append({"source": symbol("R", index), "target": symbol("p", index)})
    for index in range(0, len(drive), 10):
        T = drive.poses[index]
        w, z = (
            np.cos(np.sin(0.2 * drive.stamps[index]) / 2),
            np.sin(np.sin(0.2 * drive.stamps[index]) / 2),
        )
        turn = {"w": w, "x": 0.0, "y": 0.0, "z": z}
        stamp = round(drive.stamps[index] * 1e9)
        pose_of = {"position": T[:3, 3].tolist(), "world_R_body": turn, "timestamp": stamp}
        nodes.append(node("a", index, 2, type="AgentNodeAttributes", **pose_of))
    names = {"ROOMS": {"layer": 4, "partition": 0}}
    return {"layer_names": names, "nodes": nodes, "edges": edges}


def test_a_hydra_graph_is_scored(world: World, drive: Trajectory, tmp_path: Path) -> None:
    path = tmp_path / "dsg.json"
    path.write_text(json.dumps(dsg(world, drive)))
    graph = read_dsg(path)
    assert len(graph.rooms) == 2
    outline = Polygon(graph.rooms[1].polygon)
    assert outline.area == pytest.approx(np.pi, rel=0.02)
    metrics = score_foreign(CONFIG, drive, Foreign(estimate=graph.trajectory, rooms=graph.rooms))
    assert metrics.ate_m == pytest.approx(0.0, abs=1e-6)
    assert metrics.yaw_deg == pytest.approx(0.0, abs=1e-3)
    assert metrics.rooms.centre_precision == 1.0


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ({"nodes": None}, "nodes: a Spark-DSG"),
        ({"edges": 3}, "edges: a Spark-DSG"),
        ({"nodes": [{"id": 1}]}, r"nodes\[0\]: an object with id"),
        ({"edges": [{"source": 1, "target": 2}]}, r"edges\[0\]: ids of two nodes"),
    ],
)
def test_a_graph_that_is_none_is_named(
    world: World, drive: Trajectory, tmp_path: Path, change: dict[str, object], said: str
) -> None:
    path = tmp_path / "dsg.json"
    path.write_text(json.dumps(dsg(world, drive) | change))
    with pytest.raises(InputError, match=said):
        read_dsg(path)
    path.write_bytes(b"\x00SPARK_DSG\x01")
    with pytest.raises(InputError, match="JSON, not binary"):
        read_dsg(path)


# --- the command ----------------------------------------------------------------------------------


def test_the_command_scores_files(
    world: World, drive: Trajectory, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    write_tum(drive, tmp_path / "truth.tum")
    write_tum(moved(drive), tmp_path / "theirs.tum")
    points = transform_points(T_MAP_WORLD, off_the_floor(world, 0.07))
    write_ply(points, np.zeros(len(points), np.int64), tmp_path / "theirs.ply")
    options = ["--conditions", "ideal", "--truth", str(tmp_path / "truth.tum")]
    options += ["--trajectory", str(tmp_path / "theirs.tum"), "--map", str(tmp_path / "theirs.ply")]
    assert main(["score", "SE1", *options, "--out", str(tmp_path / "out")]) == 0
    metrics = read_metrics(tmp_path / "out" / "metrics.json")
    assert metrics.ate_m == pytest.approx(0.0, abs=1e-5)
    assert metrics.mma_m == pytest.approx(0.07, abs=1e-4)
    assert "mma_m" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        ([], "expected at least one of --trajectory"),
        (["--rooms", "a.json", "--dsg", "b.json"], "--rooms or --dsg"),
        (["--map", "absent.ply"], "absent.ply: cannot be read"),
        (["--rooms", "a.json", "--frame", "odom"], "frame"),
        (["--rooms", "a.json", "--truth", "absent.tum"], "absent.tum"),
    ],
)
def test_bad_usage_is_one_line(
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
    arguments: list[str],
    said: str,
) -> None:
    monkeypatch.chdir(tmp_path)
    assert main(["score", "SE1", *arguments]) == 2
    err = capsys.readouterr().err
    assert said in err
    assert err.count("\n") == 1
