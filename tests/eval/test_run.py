"""The whole loop: what has to hold of every run, and bounds on a short one."""

import dataclasses
import json
from pathlib import Path

import numpy as np
import pytest

from eval.config import RunConfig
from eval.folder import read_config
from eval.graphfile import read_graph
from eval.outputs import read_metrics, read_tum
from eval.pointfile import ply_vertices
from eval.run import run
from sim.truth import ScanTruth
from slam.core import InputError

SECONDS = 12.0
FILES = {
    "config.json",
    "graph.json",
    "map.ply",
    "metrics.json",
    "odometry.tum",
    "plan.png",
    "report.html",
    "rooms.csv",
    "trajectory.tum",
    "truth.tum",
}


@pytest.fixture(scope="module")
def finished(tmp_path_factory):
    folder = tmp_path_factory.mktemp("runs") / "SE1"
    return run(RunConfig("SE1", seed=5, duration=SECONDS, out=folder))


def test_a_run_leaves_its_files_and_each_can_be_read(finished):
    assert {path.name for path in finished.folder.iterdir()} == FILES
    metrics = read_metrics(finished.folder / "metrics.json")
    assert metrics.status == "complete"
    assert metrics.simulated_s == pytest.approx(SECONDS)
    assert metrics.rooms == finished.metrics.rooms
    for name in ("trajectory", "odometry", "truth"):
        assert len(read_tum(finished.folder / f"{name}.tum")) == round(SECONDS * 10)
    graph = read_graph(finished.folder / "graph.json")
    planes = {node.id for node in graph.nodes if node.id.startswith("p")}
    points = ply_vertices(finished.folder / "map.ply")
    assert {f"p{i}" for i in np.unique(points["plane_id"])} <= planes
    assert len(points) > 1000
    assert read_config(finished.folder).scene == "SE1"


def test_a_short_run_is_within_bounds(finished):
    metrics = finished.metrics
    assert metrics.ate_m < 0.06
    assert metrics.ate_odometry_m < 0.3
    assert metrics.mma_m < 0.05
    assert metrics.planes.mixed <= 1
    assert metrics.rooms.true_positive >= 1
    assert metrics.first_room_s is not None


def test_the_graph_is_readable_without_its_truth(finished, tmp_path):
    tree = json.loads((finished.folder / "graph.json").read_text())
    assert tree.pop("truth")
    (tmp_path / "graph.json").write_text(json.dumps(tree))
    assert read_graph(tmp_path / "graph.json").truth == {}


def lies(seed):
    """A truth filter that replaces everything by random values of the right shape."""
    rng = np.random.default_rng(seed)

    def replace(truth: ScanTruth) -> ScanTruth:
        count = len(truth.face)
        pose = np.eye(4)
        pose[:3, 3] = rng.normal(size=3)
        return ScanTruth(
            T_world_base=pose,
            face=rng.integers(-4, 10, count).astype(np.int32),
            geom=rng.integers(0, 5, count).astype(np.int32),
            points_world=rng.normal(size=(count, 3)).astype(np.float32),
        )

    return replace


def estimate_of(folder: Path) -> tuple[bytes, str]:
    tree = json.loads((folder / "graph.json").read_text())
    del tree["truth"]
    return (folder / "trajectory.tum").read_bytes(), json.dumps(tree)


def test_the_estimate_does_not_see_the_truth(tmp_path):
    short = RunConfig("SE1", seed=1, duration=4.0, out=tmp_path / "honest")
    honest = run(short)
    lied = run(dataclasses.replace(short, out=tmp_path / "lied"), truth_filter=lies(0))
    assert estimate_of(honest.folder) == estimate_of(lied.folder)
    assert honest.metrics.ate_origin_m != lied.metrics.ate_origin_m


def test_the_same_seed_gives_the_same_estimate_and_another_one_does_not(tmp_path):
    def trajectory(name, seed):
        config = RunConfig("SE1", seed=seed, duration=3.0, out=tmp_path / name, detector="none")
        return read_tum(run(config).folder / "trajectory.tum").poses

    one, two, other = trajectory("a", 3), trajectory("b", 3), trajectory("c", 4)
    assert np.abs(one - two).max() <= 1e-6
    assert np.abs(one - other).max() > 1e-4


def test_the_oracle_finds_every_room_it_has_entered(tmp_path):
    config = RunConfig("SE1", seed=2, duration=SECONDS, out=tmp_path / "o", detector="oracle")
    rooms = run(config).metrics.rooms
    assert rooms.recall == 1.0
    assert rooms.precision == 1.0


def test_stopping_a_run_keeps_what_there_was(tmp_path):
    def stop(seconds, total):
        if seconds > 2.05:
            raise KeyboardInterrupt

    config = RunConfig("SE1", duration=10.0, out=tmp_path / "run")
    with pytest.raises(KeyboardInterrupt):
        run(config, stop)
    metrics = read_metrics(tmp_path / "run" / "metrics.json")
    assert metrics.status == "cut_off"
    assert metrics.simulated_s == pytest.approx(2.1)
    left = {path.name for path in (tmp_path / "run").iterdir()}
    assert left == FILES - {"rooms.csv"}  # straight on for 2 s: nothing to align rooms by


def test_bad_input_leaves_nothing_behind(tmp_path):
    for config in (
        RunConfig("SE9", out=tmp_path / "run"),
        RunConfig("SE1", sensor="vlp61", out=tmp_path / "run"),
        RunConfig("SE1", conditions="as-bilt", out=tmp_path / "run"),
        RunConfig("SE1", start="ballroom", out=tmp_path / "run"),
        RunConfig("SE1", storey=7, out=tmp_path / "run"),
    ):
        with pytest.raises(InputError):
            run(config)
        assert not (tmp_path / "run").exists()


def test_a_plan_without_a_room_that_can_be_reached_is_refused(tmp_path):
    plan = {
        "format": "roomloop-plan-1",
        "name": "closet",
        "notes": "",
        "storeys": [
            {
                "name": "0",
                "z_floor": 0.0,
                "rooms": [
                    {"name": "a", "kind": "room", "outline": [[0, 0], [0.3, 0], [0.3, 3], [0, 3]]}
                ],
                "walls": [
                    {"from": a, "to": b, "thickness": 0.1}
                    for a, b in (
                        ([0, 0], [0.3, 0]),
                        ([0.3, 0], [0.3, 3]),
                        ([0.3, 3], [0, 3]),
                        ([0, 3], [0, 0]),
                    )
                ],
                "doors": [],
            }
        ],
    }
    (tmp_path / "closet.json").write_text(json.dumps(plan))
    with pytest.raises(InputError, match="not one room"):
        run(RunConfig(str(tmp_path / "closet.json"), out=tmp_path / "run"))
