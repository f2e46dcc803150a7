import itertools
from dataclasses import replace

import numpy as np
import pytest
from held import floor, residuals_of, variable_count
from synthetic import base_pose, box_planes, in_base, scan_box

from eval.config import FACTORS
from eval.config import LAYERS as ASKED_LAYERS
from slam.backend import LAYERS, BackEnd, BackEndConfig
from slam.concepts import RoomNode
from slam.core import (
    Frame,
    InputError,
    KeyframeScan,
    PlaneObservation,
    PlanePiece,
    Proposals,
    RoomProposal,
    RunError,
    WallProposal,
    inverse,
    pose,
    so3_exp,
)
from slam.extraction import ExtractionConfig, extract_planes
from slam.graph import LayeredGraph
from slam.relations import (
    KINDS,
    Relation,
    RelationConfig,
    Thicknesses,
    relations_named,
    room_relations,
)

BOX = box_planes(6.0, 4.0, 2.7)
SENSOR = np.array([0.0, 0.0, 0.5])
ROOM, WALL = 2, 3
"""Residuals of one."""


def true_poses(count):
    turn = np.linspace(0.0, 2.0 * np.pi, count)
    return [base_pose(3.0 + 1.5 * np.cos(a), 2.0 + 0.8 * np.sin(a), a + 1.5) for a in turn]


def drifting(poses, rng):
    """Odometry that makes an error at every step; odom is the first pose."""
    T, odometry = np.eye(4), [np.eye(4)]
    for before, after in itertools.pairwise(poses):
        error = pose(so3_exp(rng.normal(0, 0.004, 3)), rng.normal(0, 0.015, 3))
        T = T @ inverse(before) @ after @ error
        odometry.append(T)
    return odometry


@pytest.fixture(scope="module")
def frames():
    rng = np.random.default_rng(4)
    poses = true_poses(30)
    odometry = drifting(poses, rng)
    made = []
    for k, (T_world_base, T_odom_base) in enumerate(zip(poses, odometry, strict=True)):
        scan = scan_box(BOX, T_world_base, rng, index=2 * k)
        points = in_base(scan)
        planes = extract_planes(points, scan.ring, np.array([0, 0, 0.5]), ExtractionConfig())
        keyframe = KeyframeScan(planes, points[::8], np.array([0, 0, 0.5]))
        made.append(Frame(2 * k, 0.2 * k, T_odom_base, T_odom_base, keyframe))
        if k + 1 < len(poses):  # a scan between two keyframes, half-way by odometry
            made.append(Frame(2 * k + 1, 0.2 * k + 0.1, T_odom_base, T_odom_base, None))
    return made, poses


def run(frames, layers="rooms+walls", proposals=None):
    backend = BackEnd(BackEndConfig(layers=layers))
    for frame in frames:
        if backend.add(frame) and proposals is not None:
            backend.accept(proposals(backend.view()))
    backend.optimise()
    return backend


def errors(estimated, true):
    """Position errors [m] of poses in map against poses in world; map is the first pose."""
    return np.array(
        [(inverse(true[0]) @ T)[:3, 3] - E[:3, 3] for E, T in zip(estimated, true, strict=True)]
    )


def test_the_graph_is_far_better_than_the_odometry(frames):
    made, poses = frames
    backend = run(made)
    trajectory = zip(made, backend.trajectory(), strict=True)
    estimate = errors([T for frame, T in trajectory if frame.keyframe], poses)
    odometry = errors([frame.T_odom_base for frame in made if frame.keyframe], poses)
    rms = [np.sqrt((e**2).sum(axis=1).mean()) for e in (estimate, odometry)]
    assert rms[1] > 0.03
    assert rms[0] < 0.25 * rms[1]


def test_every_wall_is_one_plane_and_opposite_faces_are_kept_apart(frames):
    planes = run(frames[0]).dense_view().planes
    assert len(planes) == 5
    for plane in planes:
        assert len(plane.keyframes) >= 20
        assert np.abs(plane.points @ plane.normal + plane.d).max() < 0.1
        assert len(np.unique(plane.point_ids)) == len(plane.point_ids)


def test_the_trajectory_has_a_pose_for_every_scan(frames):
    made, _ = frames
    backend = run(made)
    assert backend.trajectory().shape == backend.odometry().shape == (len(made), 4, 4)
    keyframes = {k.scan_index: k.T_map_base for k in backend.keyframes()}
    for frame, T in zip(made, backend.trajectory(), strict=True):
        if frame.index in keyframes:
            assert np.allclose(T, keyframes[frame.index], atol=1e-9)


def test_two_runs_agree(frames):
    one, two = (run(frames[0]).trajectory() for _ in range(2))
    assert np.abs(one - two).max() < 1e-9


def room_of(view):
    """All walls of the box as one room, and (nonsense, but legal) two of them as a wall."""
    walls = [plane for plane in view.planes if not plane.horizontal]
    pieces = tuple(PlanePiece(plane.id, plane.segment) for plane in walls)
    centre = np.mean([plane.points[:, :2].mean(axis=0) for plane in walls], axis=0)
    room = RoomProposal(0, pieces, None, centre, 0.9)
    return Proposals((room,), (WallProposal(0, (pieces[0], pieces[1]), 0.9),))


def test_rooms_and_walls_enter_the_graph_and_leave_it(frames):
    made, _ = frames
    backend = run(made, proposals=room_of)
    graph = backend.graph()
    assert (residuals_of(graph, "rooms"), residuals_of(graph, "walls")) == (ROOM, WALL)
    assert floor(graph) is not None
    size = variable_count(graph)
    backend.accept(Proposals())
    backend.optimise()
    assert (residuals_of(graph, "rooms"), residuals_of(graph, "walls")) == (0, 0)
    assert variable_count(graph) == size - 2


def test_a_floor_is_amid_its_rooms_where_they_are_now():
    graph = LayeredGraph()
    graph.add_keyframe(0, np.eye(4), None)
    planes = []
    for place, (normal, d) in enumerate(BOX[:4]):
        covariance = np.diag([1e-4, 1e-4, 1e-4])
        points = np.zeros((0, 3), np.float32)
        middle = np.array([3.0, 2.0, 1.0])
        foot = middle - (normal @ middle + d) * normal
        seen = PlaneObservation(normal, d, foot, covariance, points, np.zeros(0, np.int64))
        planes.append(graph.add_plane(normal, d, foot))
        graph.observe(0, planes[-1], seen, place)
    along, whole = ((0, 1),), ((0, 1), (2, 3))
    graph.set_concepts({0: RoomNode(tuple(planes), whole, np.array([3.0, 2.0, 1.0]))}, {})
    graph.optimise(whole=True)
    graph.set_concepts({0: RoomNode(tuple(planes[:2]), along, np.array([3.0, 40.0, 1.0]))}, {})
    graph.optimise(whole=True)
    assert floor(graph) == pytest.approx([3.0, 40.0], abs=0.1)
    graph.set_concepts({0: RoomNode(tuple(planes[:2]), along, np.array([3.0, 41.0, 1.0]))}, {})
    graph.optimise(whole=True)
    assert floor(graph) == pytest.approx([3.0, 41.0], abs=0.1)
    graph.set_concepts({1: RoomNode(tuple(planes[:2]), along, np.array([5.0, 2.0, 1.0]))}, {})
    graph.optimise(whole=True)
    assert floor(graph) == pytest.approx([5.0, 2.0], abs=0.1)


def test_each_storey_has_a_floor(frames):
    made, _ = frames

    def on_both(view):
        below = room_of(view).rooms[0]
        return Proposals((below, replace(below, id=1, storey=1)))

    graph = run(made, proposals=on_both).graph()
    assert residuals_of(graph, "rooms") == 2 * ROOM
    assert floor(graph, 0) is not None
    assert floor(graph, 1) is not None
    assert floor(graph, 2) is None


def test_walls_of_different_storeys_are_never_one(frames):
    """The same box again 2.3 m higher: what was seen of its walls overlaps in height."""
    made, _ = frames
    up = pose(np.eye(3), np.array([0.0, 0.0, 2.3]))
    above = [
        replace(
            frame,
            index=frame.index + 100,
            stamp=frame.stamp + 10.0,
            T_odom_base=up @ frame.T_odom_base,
            T_track_base=up @ frame.T_track_base,
        )
        for frame in made
    ]
    view = run([*made, *above]).view()
    assert {keyframe.storey for keyframe in view.keyframes} == {0, 1}
    for storey in (0, 1):
        walls = [p for p in view.planes if p.storey == storey and not p.horizontal]
        assert len(walls) >= 4
        assert max(wall.z_range[1] - wall.z_range[0] for wall in walls) < 2.8


def test_a_room_may_come_back_before_the_graph_has_let_it_go(frames):
    backend = run(frames[0], proposals=room_of)
    graph = backend.graph()
    size = variable_count(graph)
    again = room_of(backend.view())
    backend.accept(Proposals())
    backend.accept(again)
    backend.optimise(whole=True)
    assert residuals_of(graph, "rooms") == ROOM
    assert variable_count(graph) == size


@pytest.mark.parametrize(("layers", "rooms", "walls"), [("planes", 0, 0), ("rooms", 1, 0)])
def test_layers_say_what_enters_the_graph(frames, layers, rooms, walls):
    graph = run(frames[0], layers, room_of).graph()
    assert residuals_of(graph, "rooms") == rooms * ROOM
    assert residuals_of(graph, "walls") == walls * WALL


def test_other_layers_are_refused():
    assert LAYERS == ASKED_LAYERS
    with pytest.raises(InputError, match="layers: 'walls' is unknown, .* planes, rooms, "):
        BackEndConfig(layers="walls")


def test_the_published_factors_add_no_information(frames):
    without = run(frames[0], "planes").trajectory()
    with_rooms = run(frames[0], "rooms", room_of).trajectory()
    assert np.abs(without - with_rooms).max() < 1e-3


def test_a_keyframe_without_planes_is_carried_by_the_odometry(frames):
    made, _ = frames
    bare = KeyframeScan((), np.zeros((0, 3)), np.zeros(3))
    with_gap = [replace(f, keyframe=bare) if f.index == 10 else f for f in made]
    assert np.isfinite(run(with_gap).trajectory()).all()


def test_keyframes_that_add_nothing_are_not_added():
    """Round and round in one room: as many keyframes as there are places, all scans have poses."""
    rng = np.random.default_rng(7)
    round_trip = true_poses(13)[:-1]
    poses = [round_trip[k % 12] for k in range(48)]
    odometry = drifting(poses, rng)
    backend = BackEnd()
    added = []
    for k, (T, T_odom) in enumerate(zip(poses, odometry, strict=True)):
        scan = scan_box(BOX, T, rng, index=k)
        planes = extract_planes(in_base(scan), scan.ring, SENSOR, ExtractionConfig())
        keyframe = KeyframeScan(planes, np.zeros((0, 3)), SENSOR)
        added.append(backend.add(Frame(k, 0.1 * k, T_odom, T_odom, keyframe)))
    backend.finish()
    assert 12 <= sum(added) <= 24
    assert not any(added[30:])
    assert len(backend.keyframes()) == sum(added)
    assert np.abs(errors(backend.online(), poses)).max() < 0.03
    assert np.abs(errors(backend.trajectory(), poses)).max() < 0.03


@pytest.mark.parametrize("tilt", [1.0, 6.0])
def test_on_a_ramp_plumb_walls_say_how_steep_it_is(tilt):
    """An odometry takes a tenth of a degree too little at each step; on the level nobody asks."""
    backend = BackEnd()
    for k in range(12):
        true, odom = (
            base_pose(0.4 * k, 0.0, 0.3, (0.0, -np.radians(degrees)))
            for degrees in ((tilt, 0.8 * tilt) if k > 5 else (0.0, 0.0))
        )
        plumb = true[:3, :3].T @ np.array([0.0, 0.0, 1.0])
        keyframe = KeyframeScan((), np.zeros((0, 3)), SENSOR, plumb)
        backend.add(Frame(k, 0.1 * k, odom, odom, keyframe))
    backend.finish()
    last = backend.keyframes()[-1].T_map_base
    found = np.degrees(np.arccos(base_pose(0, 0, 0.3)[:3, 2] @ last[:3, 2]))
    assert found == pytest.approx(6.0 if tilt == 6.0 else 0.8, abs=0.1)


def test_a_plane_without_a_direction_is_refused():
    with pytest.raises(InputError, match="a unit normal"):
        LayeredGraph().add_plane(np.zeros(3), 1.0, np.zeros(3))


def test_a_first_keyframe_without_planes_starts_a_map():
    backend = BackEnd()
    bare = KeyframeScan((), np.zeros((0, 3)), np.zeros(3))
    assert backend.add(Frame(0, 0.0, np.eye(4), np.eye(4), bare))
    assert backend.view().planes == []


def test_observation_of_a_merged_plane_moves_with_it():
    """Two planes a hand apart at first, found to be one when they are seen better."""
    rng = np.random.default_rng(0)
    u, v = rng.uniform(-2, 2, 500), rng.uniform(0, 1, 500)
    backend = BackEnd(BackEndConfig(merge_every=1))

    def seen(offset, sigma):
        points = np.column_stack([u, np.full(500, 3.0 + offset), v])
        observation = PlaneObservation(
            np.array([0.0, -1.0, 0.0]),
            3.0 + offset,
            points.mean(axis=0),
            np.diag([1e-6, 1e-6, sigma**2]),
            points,
            np.arange(500),
        )
        return KeyframeScan((observation,), points, np.zeros(3))

    backend.add(Frame(0, 0.0, np.eye(4), np.eye(4), seen(0.0, 0.01)))
    backend.add(Frame(1, 0.1, np.eye(4), np.eye(4), seen(0.17, 0.001)))
    assert len(backend.view().planes) == 2
    backend.add(Frame(2, 0.2, np.eye(4), np.eye(4), seen(0.12, 0.001)))
    for k in range(3, 8):
        backend.add(Frame(k, 0.1 * k, np.eye(4), np.eye(4), seen(0.02, 0.001)))
    assert len(backend.view().planes) <= 2


def informative(frames, **switches):
    backend = BackEnd(BackEndConfig(relations=RelationConfig(**switches)))
    for frame in frames:
        if backend.add(frame):
            backend.accept(walls_of_a_room(backend.view()))
    backend.finish()
    return backend


def walls_of_a_room(view):
    walls = [plane for plane in view.planes if not plane.horizontal]
    pieces = tuple(PlanePiece(plane.id, plane.segment) for plane in walls)
    centre = np.mean([plane.points[:, :2].mean(axis=0) for plane in walls], axis=0)
    return Proposals((RoomProposal(0, pieces, None, centre, 0.9),))


def rectangularity(backend):
    """The largest departure of the walls from right angles [rad]."""
    normals = [plane.normal for plane in backend.view().planes if not plane.horizontal]
    dots = np.abs(np.array(normals) @ np.array(normals).T)
    return float(np.minimum(np.abs(dots), np.sqrt(np.maximum(1.0 - dots**2, 0.0))).max())


def test_relations_of_a_room_make_it_more_rectangular(frames):
    made, _ = frames
    off = {"parallel": False, "perpendicular": False}
    with_them = informative(made, angle=np.radians(0.1))
    without = informative(made, **off)
    assert rectangularity(with_them) < rectangularity(without)


@pytest.mark.parametrize("kind", ["parallel", "perpendicular"])
def test_one_kind_of_relation_may_be_asked_for_alone(frames, kind):
    made, _ = frames
    backend = BackEnd(BackEndConfig(relations=relations_named(kind)))
    for frame in made:
        if backend.add(frame):
            backend.accept(walls_of_a_room(backend.view()))
    backend.optimise()
    assert {each for each in KINDS if residuals_of(backend.graph(), each)} == {kind}


def test_every_factor_of_the_command_has_its_relations():
    asked = {name: relations_named(name) for name in FACTORS}
    assert asked.pop("paper") is None
    assert asked.pop("informative") == RelationConfig()
    for name, config in asked.items():
        assert [kind for kind in KINDS if getattr(config, kind)] == [name]
    with pytest.raises(InputError, match="factors: 'square' is unknown"):
        relations_named("square")


def test_relations_leave_the_graph_with_their_room(frames):
    made, _ = frames
    backend = informative(made)
    graph = backend.graph()
    assert (residuals_of(graph, "parallel"), residuals_of(graph, "perpendicular")) == (4, 4)
    backend.accept(Proposals())
    backend.optimise()
    assert not any(residuals_of(graph, kind) for kind in KINDS)


def test_walls_of_one_thickness_are_grouped_and_a_thick_one_is_not():
    normals = np.array([[1.0, 0, 0], [-1.0, 0, 0]] * 4)
    thick = (0.100, 0.104, 0.097, 0.25)
    offsets = np.array([d for k, t in enumerate(thick) for d in (-5.0 * k - t, 5.0 * k)])
    walls = [((2 * k, 2 * k + 1), np.array([5.0 * k + t / 2, 0, 0])) for k, t in enumerate(thick)]
    found = Thicknesses(RelationConfig()).relations(walls, normals, offsets)
    assert [relation.planes for relation in found] == [(0, 1), (2, 3), (4, 5)]
    assert len({relation.group for relation in found}) == 1
    assert [relation.value for relation in found] == pytest.approx(thick[:3])


def test_a_thickness_that_no_wall_has_any_more_can_come_again():
    graph = LayeredGraph()
    graph.add_keyframe(0, np.eye(4), None)
    planes = []
    for place, (normal, d) in enumerate((([0.0, 1.0, 0.0], -2.1), ([0.0, -1.0, 0.0], 2.0))):
        foot, points = -d * np.array(normal), np.zeros((0, 3), np.float32)
        covariance = np.diag([1e-6, 1e-6, 1e-4])
        seen = PlaneObservation(
            np.array(normal), d, foot, covariance, points, np.zeros(0, np.int64)
        )
        planes.append(graph.add_plane(seen.normal, d, foot))
        graph.observe(0, planes[-1], seen, place)
    between = np.array([0.0, 2.05, 0.0])
    wall = Relation("thickness", (planes[0], planes[1]), point=between, value=0.1)
    for held, residuals in (([wall], 1), ([], 0), ([wall], 1)):
        graph.set_relations(held, RelationConfig())
        graph.optimise(whole=True)
        assert residuals_of(graph, "thickness") == residuals


def test_rooms_that_are_not_rectangular_have_no_relations():
    angles = np.radians([0.0, 85.0, 178.0, 262.0])
    normals = np.column_stack([np.cos(angles), np.sin(angles), np.zeros(4)])
    assert list(room_relations(range(4), normals, RelationConfig())) == []


class Unsolvable:
    """A solver that gives up."""

    def update(self, *_):
        raise RuntimeError("Indeterminate linear system detected while working near variable x7.")


def test_a_failed_optimisation_says_so_and_keeps_the_last_estimate(frames, monkeypatch):
    made, _ = frames
    backend = run(made[:20])
    before = backend.trajectory()
    monkeypatch.setattr(backend.graph()._optimiser.solver, "_isam", Unsolvable())
    with pytest.raises(RunError, match=r"could not be optimised: Indeterminate .* x7"):
        backend.optimise(whole=True)
    backend.finish()
    assert np.array_equal(backend.trajectory(), before)
    assert len(backend.view().planes) == 5
