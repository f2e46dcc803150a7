"""A whole run through the hand-drawn house: perfect, moved, disturbed, cut short."""

from __future__ import annotations

import dataclasses
import json
import re

import numpy as np
import pytest
from looking import keep

from eval.labels import TruthKeeper
from eval.metrics import Loops, RunFacts, Stages, StageTime, assemble
from eval.oracle import OracleDetector
from eval.outputs import metrics_json
from eval.picture import picture_of, plan_png
from eval.score.failures import Fates, Fault
from eval.score.map import SurfaceDistance
from eval.score.scores import RunRecord, Scores, graph_truth, score_run
from eval.score.trajectory import Trajectory
from sim.truth import ScanTruth
from slam.core import Array, Links, Proposals, RoomProposal, WallProposal, inverse, pose, so3_exp
from worlds.plan import UNLABELLED

ROUTE = [(1.0, 1.0), (3.0, 1.0), (3.0, 2.0), (6.0, 2.0), (6.0, 3.8), (1.0, 3.8)]
FACTS = RunFacts(
    status="complete",
    scene="house",
    scene_sha256="0" * 64,
    seed=0,
    sensor="ideal",
    conditions="ideal",
    detector="gnn",
    layers="rooms+walls",
    factors="informative",
    odometry="kiss",
    versions={"roomloop": "0.1.0"},
    simulated_s=20.0,
    startup_s=1.5,
    wall_s=4.0,
    loops=Loops(0, 0, 0),
    stages=Stages(lidar=StageTime.of([0.002, 0.004])),
    peak_rss_mb=512.0,
)


def drive(house, T_map_world: Array, steps: int = 40) -> RunRecord:
    """All faces are seen from the first scan on, and mapped and proposed without an error."""
    keeper = TruthKeeper(house.truth)
    poses = house.drive(ROUTE, steps)
    first = None
    for k, T_world_base in enumerate(poses):
        looks = house.whole(*range(12)) if k == 0 else {}
        scan, truth = house.scan(k, 0.1 * (k + 1), T_world_base[:3, 3], looks)
        keep(
            keeper,
            scan,
            ScanTruth(T_world_base, truth.face, truth.geom, truth.points_world),
            keyframe=k % 10 == 0,
        )
        if k == 0:
            first = scan, truth
            record = propose(house, first, keeper, T_map_world)
        if k % 10 == 0:
            keeper.snapshot(scan.stamp, 0.005, record.view, record.proposals)
    stamps = 0.1 * np.arange(1, len(poses) + 1)
    path = Trajectory(stamps, T_map_world @ poses)
    return dataclasses.replace(record, estimate=path, odometry=path, online=path)


def propose(house, pair, keeper: TruthKeeper, T_map_world: Array) -> RunRecord:
    planes = [house.plane(i, pair, house.whole(i), T_map_world=T_map_world) for i in range(12)]
    pieces = [house.piece(plane) for plane in planes]
    rooms = []
    for room in house.truth.rooms:
        outline = np.array(room.polygon.exterior.coords)[:-1]
        corners = np.column_stack([outline, np.zeros(len(outline))])
        polygon = (corners @ T_map_world[:3, :3].T + T_map_world[:3, 3])[:, :2]
        own = tuple(pieces[face] for face in room.faces)
        rooms.append(RoomProposal(room.id, own, polygon, polygon.mean(axis=0), 1.0))
    walls = tuple(
        WallProposal(wall.id, tuple(pieces[face] for face in wall.faces), 1.0)
        for wall in house.truth.walls
    )
    nothing = Trajectory(np.empty(0), np.empty((0, 4, 4)))
    view, proposals = house.view(*planes), Proposals(tuple(rooms), walls)
    return RunRecord(keeper, nothing, nothing, None, view, proposals)


@pytest.fixture(scope="module")
def surface(house) -> SurfaceDistance:
    corners = np.concatenate(
        [
            np.array([[*f.segment[i], z] for i, z in ((0, 0), (1, 0), (1, 2.5), (0, 2.5))], float)
            for f in house.truth.faces
        ]
    )
    quads = np.array(
        [[[4 * i, 4 * i + 1, 4 * i + 2], [4 * i, 4 * i + 2, 4 * i + 3]] for i in range(12)]
    )
    return SurfaceDistance(corners, quads.reshape(-1, 3), np.repeat(np.arange(12), 2))


def test_without_room_truth_rooms_and_walls_are_not_judged(house, surface, tmp_path) -> None:
    record = drive(house, np.eye(4))
    rooms = tuple(dataclasses.replace(r, kind=UNLABELLED) for r in house.truth.rooms)
    record.keeper.truth = dataclasses.replace(house.truth, rooms=rooms)
    scores = score_run(record, surface)
    assert scores.planes.completeness == 1.0
    metrics = json.loads(metrics_json(assemble(FACTS, scores)))
    assert set(metrics["rooms"].values()) == {None}
    assert set(metrics["walls"].values()) == {None}
    assert metrics["first_room_s"] is None
    layers = {layer for layer, _ in graph_truth(scores, record.keeper.truth, record)}
    assert layers == {"plane"}
    picture = picture_of(record, scores)
    assert picture.title.endswith("no room truth")
    assert not picture.entered
    assert OracleDetector(record.keeper).update(record.view) == Proposals()
    plan_png(record, scores, tmp_path / "plan.png")


def test_a_perfect_run(house, surface) -> None:
    record = drive(house, inverse(house.drive(ROUTE)[0]))
    scores = score_run(record, surface)
    assert scores.estimate.ate == pytest.approx(0.0, abs=1e-9)
    assert scores.ate_keyframes == pytest.approx(0.0, abs=1e-9)
    rooms = scores.rooms
    assert (rooms.precision, rooms.recall, rooms.piece_f1) == (1.0, 1.0, 1.0)
    assert (rooms.centre_precision, rooms.centre_recall) == (1.0, 1.0)
    assert rooms.mean_iou == pytest.approx(1.0)
    assert (rooms.truth, rooms.entered) == (3, 3)
    walls = scores.walls
    assert (walls.truth, walls.precision, walls.recall) == (3, 1.0, 1.0)
    assert scores.planes.completeness == 1.0
    assert scores.planes.plane_rmse == pytest.approx(0.0, abs=1e-6)
    for value in (scores.map.mma, scores.map.mma_face, scores.map.mma_floor):
        assert value == pytest.approx(0.0, abs=1e-5)
    # The first sweep begins at 0 and ends at 0.1, and the inference takes 5 ms.
    assert scores.time.first_room_s == pytest.approx(0.105)
    # A is entered at 0.1 and found 5 ms later; B and C are found before they are entered.
    assert scores.time.latency_median_s == 0.0
    assert (scores.time.retracted_true, scores.time.id_switches) == (0, 0)
    # 2 + 1 + 3 + 1.8 + 5, less the last of 40 steps of the last leg
    assert scores.path_m == pytest.approx(12.8 - 5.0 / 40)


@pytest.mark.parametrize(
    ("pieces", "links", "cause"),
    [
        (False, None, "missed_clustering"),
        (True, None, "missed_planes"),
        (False, Links((), np.empty((0, 2), dtype=np.int64)), "missed_planes"),
    ],
)
def test_a_run_that_ends_without_rooms_knows_if_they_were_of_planes(
    house, surface, pieces, links, cause
) -> None:
    """The map has lost all planes: that is no fault of a detector that never asked for them."""
    record = drive(house, np.eye(4))
    instants = record.keeper.instants
    if not pieces:
        instants[:] = [
            dataclasses.replace(i, rooms=tuple(dataclasses.replace(v, faces=()) for v in i.rooms))
            for i in instants
        ]
    lost = dataclasses.replace(record, view=house.view(), proposals=Proposals(), links=links)
    failures = score_run(lost, surface).failures
    assert {name: count for name, count in vars(failures).items() if count} == {cause: 3}
    instants.clear()
    failures = score_run(dataclasses.replace(lost, links=None), surface).failures
    assert failures.missed_clustering == 3


def test_where_the_map_frame_lies_changes_nothing(house, surface) -> None:
    rng = np.random.default_rng(2)
    level = pose(so3_exp(np.array([0.0, 0.0, 2.5])), np.array([11.0, -20.0, 0.3]))
    tilted = level @ pose(so3_exp(rng.normal(0.0, 0.003, 3)), rng.normal(0.0, 0.01, 3))
    base = figures(score_run(drive(house, np.eye(4)), surface))
    # Rooms are drawn in plan view, where a tilt of 0.2 degrees moves them by a millimetre.
    for T_map_world, off in ((level, 2e-5), (tilted, 1e-3)):
        other = figures(score_run(drive(house, T_map_world), surface))
        assert other == pytest.approx(base, abs=off)


def figures(scores: Scores) -> list[float]:
    tree = json.loads(metrics_json(assemble(FACTS, scores)))
    del tree["T_world_map"], tree["versions"]
    return [x for x in flat(tree) if isinstance(x, int | float)]


def flat(tree: object) -> list[object]:
    if isinstance(tree, dict):
        return [leaf for item in tree.values() for leaf in flat(item)]
    return [tree]


def test_scoring_twice_gives_the_same(house, surface) -> None:
    texts = [
        metrics_json(assemble(FACTS, score_run(drive(house, np.eye(4)), surface))) for _ in range(2)
    ]
    assert texts[0] == texts[1]


def test_a_drifting_estimate_is_seen_by_the_scores_it_concerns(house, surface) -> None:
    """Positions off by 3 cm up and down in turn: ATE 3 cm, all in height; rooms stay found."""
    record = drive(house, np.eye(4))
    poses = record.estimate.poses.copy()
    poses[:, 2, 3] += 0.03 * (-1.0) ** np.arange(len(poses))
    estimate = Trajectory(record.estimate.stamps, poses)
    scores = score_run(dataclasses.replace(record, estimate=estimate), surface)
    assert scores.estimate.ate == pytest.approx(0.03, rel=1e-3)
    assert scores.estimate.ate_z == pytest.approx(0.03, rel=1e-3)
    assert scores.estimate.ate_xy < 1e-3
    # Keyframes are every tenth scan: all of them are too high.
    assert scores.ate_keyframes == pytest.approx(0.03, rel=1e-3)
    assert scores.odometry.ate == pytest.approx(0.0, abs=1e-9)
    assert scores.online.ate == pytest.approx(0.0, abs=1e-9)
    assert scores.rooms.recall == 1.0


def test_a_run_too_short_to_align_has_nulls_not_nonsense(house, surface) -> None:
    record = drive(house, np.eye(4), steps=2)
    cut = Trajectory(record.estimate.stamps[:2], record.estimate.poses[:2])
    keeper = TruthKeeper(house.truth)
    for k in range(2):
        keep(
            keeper,
            *house.scan(k, 0.1 * (k + 1), (1.0 + k, 1.0, 0.0), house.whole(*range(12))),
            keyframe=k == 0,
        )
    short = dataclasses.replace(record, keeper=keeper, estimate=cut, odometry=cut, online=None)
    tree = json.loads(metrics_json(assemble(FACTS, score_run(short, surface))))
    for key in ("T_world_map", "ate_m", "ate_online_m", "mma_m", "mma_face_m", "first_room_s"):
        assert tree[key] is None
    assert tree["rooms"]["precision"] is None
    assert tree["rooms"]["truth"] == 3
    assert tree["walls"]["precision"] == 1.0
    assert tree["ate_origin_m"] == pytest.approx(0.0, abs=1e-9)
    assert tree["mma_floor_m"] == pytest.approx(0.0, abs=1e-5)


def test_a_run_without_a_scan(house, surface) -> None:
    nothing = Trajectory(np.empty(0), np.empty((0, 4, 4)))
    record = RunRecord(TruthKeeper(house.truth), nothing, nothing, None, house.view(), Proposals())
    tree = json.loads(metrics_json(assemble(FACTS, score_run(record, surface))))
    assert (tree["path_m"], tree["ate_m"], tree["map_completeness"]) == (0.0, None, None)
    assert tree["planes"] == {"mapped": 0, "mixed": 0, "duplicates": 0, "faces_seen": 0}


def test_the_truth_of_the_graph(house, surface) -> None:
    record = drive(house, np.eye(4))
    extra = dataclasses.replace(record.proposals.rooms[0], id=9)
    proposals = Proposals((*record.proposals.rooms, extra), record.proposals.walls[:1])
    record = dataclasses.replace(record, proposals=proposals)
    labels = graph_truth(score_run(record, surface), house.truth, record)
    assert [labels["room", i] for i in (0, 1, 2, 9)] == ["A", "B", "C", "false"]
    assert labels["wall", 0] == "wall 0"
    assert labels["plane", 0] == labels["plane", 4] == f"surface {house.truth.faces[0].surface}"


def test_the_picture_of_a_run_with_and_without_an_alignment(house, surface, tmp_path) -> None:
    record = drive(house, inverse(house.drive(ROUTE)[0]))
    scores = score_run(record, surface)
    picture = picture_of(record, scores, "house")
    assert picture.title == "house, ATE 0.0 cm (odometry 0.0 cm), rooms 3 of 3 entered"
    assert np.allclose(picture.T_world_map, house.drive(ROUTE)[0], atol=1e-8)
    plan_png(record, scores, tmp_path / "plan.png")
    assert (tmp_path / "plan.png").stat().st_size > 1000
    lost = dataclasses.replace(scores.estimate, T_truth_estimate=None, ate=None)
    scores = dataclasses.replace(scores, estimate=lost, odometry=lost)
    picture = picture_of(record, scores)
    assert picture.title.startswith("not aligned")
    assert np.allclose(picture.T_world_map, house.drive(ROUTE)[0])


KEYS = """schema, status, error, scene, scene_sha256, seed, sensor, conditions, detector, layers,
factors, odometry, versions, simulated_s, scans_skipped, startup_s, wall_s, real_time_factor,
path_m, T_world_map, ate_m, ate_keyframes_m, ate_online_m, ate_origin_m, ate_xy_m, ate_z_m, yaw_deg,
rpe_percent, ate_odometry_m, ate_odometry_xy_m, rpe_odometry_percent, mma_m, mma_face_m,
mma_floor_m, plane_rmse_m, map_completeness, planes{mapped, mixed, duplicates, faces_seen},
rooms{truth, entered, detected, true_positive, precision, recall, centre_precision, centre_recall,
mean_iou, piece_f1, over_segmented, under_segmented, retracted_true, id_switches},
walls{truth, detected, true_positive, precision, recall},
failures{missed_unseen, missed_planes, missed_edges, missed_clustering, false_unseen, false_planes,
false_edges, false_clustering}, loops{true, false, missed},
consistency{keyframes{mean, within_95},
planes{mean, within_95}, chi2{odometry, planes, plumb, loops, rooms, walls, floors, parallel,
perpendicular, thickness}}, first_room_s, room_latency_s{median,
p95}, stages{lidar{median_ms, p95_ms, total_s}, odometry{median_ms, p95_ms, total_s},
planes{median_ms, p95_ms, total_s}, semantics{median_ms, p95_ms, total_s}, graph{median_ms, p95_ms,
total_s}}, peak_rss_mb"""


def shape(tree: dict[str, object]) -> str:
    """The keys of a tree as the README writes them."""
    parts = []
    for key, value in tree.items():
        nested = isinstance(value, dict) and key != "versions"
        parts.append(f"{key}{{{shape(value)}}}" if nested else key)
    return ", ".join(parts)


def test_the_keys_of_metrics_json_are_the_contract(house, surface) -> None:
    tree = json.loads(metrics_json(assemble(FACTS, score_run(drive(house, np.eye(4)), surface))))
    assert shape(tree) == re.sub(r"\s+", " ", KEYS)
    assert tree["schema"] == "roomloop-1"
    assert tree["real_time_factor"] == 5.0
    expected = {"median_ms": 3.0, "p95_ms": pytest.approx(3.9), "total_s": pytest.approx(0.006)}
    assert tree["stages"]["lidar"] == expected
    assert tree["stages"]["graph"] == {"median_ms": None, "p95_ms": None, "total_s": None}
    assert np.allclose(tree["T_world_map"], np.eye(4), atol=1e-9)


def test_every_figure_goes_to_its_own_key(house, surface) -> None:
    scores = score_run(drive(house, np.eye(4)), surface)
    values = iter(range(100, 200))
    count = values.__next__

    def numbered(part: object) -> object:
        """The same dataclass with a different number in each plain field."""
        plain = {f.name for f in dataclasses.fields(part)} - {"matches", "mapped_faces", "votes"}
        return dataclasses.replace(part, **{name: count() for name in plain})

    parts = {
        name: numbered(getattr(scores, name))
        for name in ("odometry", "online", "planes", "map", "rooms", "walls", "time")
    }
    estimate = dataclasses.replace(numbered(scores.estimate), T_truth_estimate=np.eye(4))
    fates = Fates({}, (Fault(0, None, "edges"), Fault(0, 1, "unseen"), Fault(None, 2, "unseen")))
    others = {"estimate": estimate, "ate_keyframes": 7, "path_m": 8, "fates": fates}
    scores = dataclasses.replace(scores, **parts, **others)
    metrics = assemble(FACTS, scores)
    renamed = {
        "ate": "ate_m",
        "ate_xy": "ate_xy_m",
        "ate_z": "ate_z_m",
        "ate_origin": "ate_origin_m",
    }
    for name in ("ate", "ate_xy", "ate_z", "ate_origin", "yaw_deg", "rpe_percent"):
        assert getattr(metrics, renamed.get(name, name)) == getattr(scores.estimate, name)
    assert metrics.ate_odometry_m == scores.odometry.ate
    assert metrics.ate_odometry_xy_m == scores.odometry.ate_xy
    assert metrics.rpe_odometry_percent == scores.odometry.rpe_percent
    assert (metrics.ate_keyframes_m, metrics.path_m) == (7, 8)
    assert metrics.ate_online_m == scores.online.ate
    for name in ("mma", "mma_face", "mma_floor"):
        assert getattr(metrics, name + "_m") == getattr(scores.map, name)
    assert metrics.plane_rmse_m == scores.planes.plane_rmse
    assert metrics.map_completeness == scores.planes.completeness
    for group, source in (
        (metrics.planes, scores.planes),
        (metrics.walls, scores.walls),
        (metrics.rooms, {**vars(scores.time), **vars(scores.rooms)}),
    ):
        known = source if isinstance(source, dict) else vars(source)
        assert vars(group) == {key: known[key] for key in vars(group)}
    missed, false = {"missed_edges": 1}, {"false_unseen": 2}
    assert {k: v for k, v in vars(metrics.failures).items() if v} == missed | false
    assert metrics.first_room_s == scores.time.first_room_s
    assert metrics.room_latency_s.median == scores.time.latency_median_s
    assert metrics.room_latency_s.p95 == scores.time.latency_p95_s
