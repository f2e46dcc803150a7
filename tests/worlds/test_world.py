import mujoco
import numpy as np
import pytest
from drawings import house, write
from hypothesis import example, given, settings
from hypothesis import strategies as st
from shapely.geometry import MultiPolygon, Point, Polygon
from shapely.ops import unary_union

from worlds.catalogue import load_scene
from worlds.conditions import AS_BUILT, IDEAL, conditions_named
from worlds.generator import GeneratorConfig, random_plan
from worlds.planfile import read_plan
from worlds.truth import CEILING, FLOOR, NO_FACE
from worlds.world import build_world, true_mesh, true_world

SEED = np.random.SeedSequence(11)


@pytest.fixture(scope="module")
def se1():
    world = build_world(load_scene("SE1"), SEED, AS_BUILT)
    model = world.spec.copy().compile()
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    return world, model, data


def rays_from(room, count, rng):
    """Origins inside a room and directions all round, a little up and down."""
    origins = []
    low_x, low_y, high_x, high_y = room.polygon.bounds
    inner = room.polygon.buffer(-0.3)
    while len(origins) < count:
        place = rng.uniform([low_x, low_y], [high_x, high_y])
        if inner.contains(Point(place)):
            origins.append([*place, rng.uniform(0.3, 1.5)])
    angle, tilt = rng.uniform(-np.pi, np.pi, count), rng.uniform(-0.26, 0.26, count)
    directions = np.stack(
        [np.cos(tilt) * np.cos(angle), np.cos(tilt) * np.sin(angle), np.sin(tilt)], axis=1
    )
    return np.array(origins), directions


def mj_ray(model, data, origin, direction):
    geom = np.array([-1], dtype=np.int32)
    distance = mujoco.mj_ray(model, data, origin, direction, None, 1, -1, geom)
    return distance, int(geom[0])


def test_every_face_is_where_rays_say_it_is(se1):
    world, model, data = se1
    rng = np.random.default_rng(0)
    hits, met = 0, set()
    for room in world.truth.rooms:
        for origin, direction in zip(*rays_from(room, 250, rng), strict=True):
            distance, _ = mj_ray(model, data, origin, direction)
            assert distance > 0.0, "a ray escaped"
            place = origin + distance * direction
            near = [
                face
                for face in (world.truth.faces[f] for f in room.faces)
                if abs(face.normal @ place + face.d) < 1e-3 and face.normal @ direction < 0.0
            ]
            if near and room.polygon.buffer(0.02).contains(Point(place[:2])):
                hits += 1
                met.update(face.id for face in near)
    assert hits > 1200
    assert met == {face.id for face in world.truth.faces}


def test_labels_of_triangles_lie_on_their_faces(se1):
    world, _, _ = se1
    mesh = world.mesh
    corners = mesh.vertices[mesh.triangles]
    for face in world.truth.faces:
        mine = corners[mesh.face == face.id].reshape(-1, 3)
        assert len(mine), f"no triangle shows face {face.id}"
        assert np.abs(mine @ face.normal + face.d).max() < 1e-3
    assert {FLOOR, CEILING, NO_FACE} <= set(np.unique(mesh.face).tolist())
    floor = corners[mesh.face == FLOOR]
    assert floor[..., 2].max() == pytest.approx(0.0)


def test_many_rays_at_once_and_one_by_one_agree(se1):
    world, model, data = se1
    rng = np.random.default_rng(1)
    origin = np.array([*world.truth.rooms[0].polygon.centroid.coords[0], 1.0])
    directions = rng.normal(size=(400, 3))
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    geoms = np.full(400, -1, dtype=np.int32)
    distances = np.zeros(400)
    mujoco.mj_multiRay(
        model, data, origin, directions.ravel(), None, 1, -1, geoms, distances, None, 400, 1e6
    )
    for direction, geom, distance in zip(directions, geoms, distances, strict=True):
        one, which = mj_ray(model, data, origin, direction)
        assert one == pytest.approx(distance, abs=1e-9)
        assert which == geom


def test_the_house_as_drawn(tmp_path):
    plan = read_plan(write(house(), tmp_path))
    truth = build_world(plan, SEED, IDEAL).truth
    assert [room.name for room in truth.rooms] == ["left", "right", "hall"]
    assert [len(room.faces) for room in truth.rooms] == [4, 4, 4]
    areas = [room.polygon.area for room in truth.rooms]
    assert areas == pytest.approx([3.85 * 3.85, 4.85 * 3.85, 8.8 * 1.85], abs=1e-6)
    # left | right, and the hall's long face with each of the two rooms behind it
    pairs = {frozenset(truth.faces[f].room for f in wall.faces) for wall in truth.walls}
    assert pairs == {frozenset((0, 1)), frozenset((0, 2)), frozenset((1, 2))}
    assert [wall.thickness for wall in truth.walls] == pytest.approx([0.1] * 3)
    doors = {frozenset(door.rooms) for door in truth.doors}
    assert doors == {frozenset((0, 2)), frozenset((1, 2))}
    # the outer faces of left and right on y = 5.9, and those on y = 2.05, are one surface each
    surfaces = [truth.faces[f].surface for f in (*truth.rooms[0].faces, *truth.rooms[1].faces)]
    assert len(surfaces) - len(set(surfaces)) == 2
    for face in truth.faces:
        middle = face.segment.mean(axis=0)
        inside = truth.rooms[face.room].polygon
        assert inside.contains(Point(middle + 0.05 * face.normal[:2]))


def test_a_door_splits_the_parts_of_a_face_but_not_the_face(tmp_path):
    plan = read_plan(write(house(), tmp_path))
    truth = build_world(plan, SEED, IDEAL).truth
    hall = next(f for f in truth.faces if f.room == 2 and f.normal[1] < -0.9)
    assert len(hall.parts) == 3
    assert hall.length == pytest.approx(8.8 - 2 * 0.9)
    assert np.linalg.norm(hall.segment[1] - hall.segment[0]) == pytest.approx(8.8)


@pytest.mark.parametrize(("width", "rooms"), [(2.4, 3), (2.8, 2)])
def test_rooms_that_a_wide_opening_joins_are_one(width, rooms, tmp_path):
    tree = house()
    tree["storeys"][0]["doors"][0] = {
        "at": [2, 2],
        "width": width,
        "kind": "opening",
        "height": 2.6,
    }
    truth = build_world(read_plan(write(tree, tmp_path)), SEED, IDEAL).truth
    assert len(truth.rooms) == rooms


def test_rooms_without_a_wall_between_them_are_one(tmp_path):
    tree = house()
    del tree["storeys"][0]["walls"][5]
    truth = build_world(read_plan(write(tree, tmp_path)), SEED, IDEAL).truth
    assert sorted(room.name for room in truth.rooms) == ["hall", "left + right"]


def test_the_same_seed_builds_the_same_world_and_another_one_another():
    plan = load_scene("SE1")

    def vertices(seed):
        return build_world(plan, np.random.SeedSequence(seed), AS_BUILT).mesh.vertices

    assert np.array_equal(vertices(1), vertices(1))
    assert not np.array_equal(vertices(1), vertices(2))


def test_as_built_departs_from_the_plan_by_what_it_says():
    plan = load_scene("SE1")
    ideal = build_world(plan, SEED, IDEAL).truth
    turns, shifts = [], []
    for seed in range(12):
        built = build_world(plan, np.random.SeedSequence(seed), AS_BUILT).truth
        for a in ideal.faces:
            b = _same_face(a, built)
            sine = a.normal[0] * b.normal[1] - a.normal[1] * b.normal[0]
            turns.append(np.degrees(np.arcsin(sine)))
            middle = np.append(a.segment.mean(axis=0), 1.3)
            shifts.append(b.normal @ middle + b.d)
    assert np.std(turns) == pytest.approx(0.15, rel=0.25)
    assert 0.003 < np.std(shifts) < 0.03
    assert abs(np.mean(shifts)) < 0.004


def _same_face(face, truth):
    """The face of another truth that is nearest to this one."""
    middle = np.append(face.segment.mean(axis=0), 1.3)
    alike = [f for f in truth.faces if f.room == face.room and f.normal @ face.normal > 0.9]
    return min(alike, key=lambda f: abs(f.normal @ middle + f.d))


def section(mesh, height):
    """Area of the walls cut at a height, from the triangles alone: the solids' outlines."""
    areas = []
    for name in np.unique(mesh.geom_name):
        triangles = mesh.vertices[mesh.triangles[mesh.geom_name == name]]
        ends = []
        for a, b in ((0, 1), (1, 2), (2, 0)):
            p, q = triangles[:, a], triangles[:, b]
            crosses = (p[:, 2] - height) * (q[:, 2] - height) < 0
            t = ((height - p[:, 2]) / np.where(crosses, q[:, 2] - p[:, 2], 1.0))[:, None]
            ends.append((p + t * (q - p))[crosses][:, :2])
        points = np.concatenate(ends)
        if len(points) >= 3:
            areas.append(MultiPolygon([Polygon()]).union(_hull(points)))
    return unary_union(areas)


def _hull(points):
    from shapely.geometry import MultiPoint

    return MultiPoint(points).convex_hull


@settings(max_examples=15, deadline=None)
@given(st.integers(0, 100_000))
def test_the_model_of_any_plan_has_the_plans_walls(seed):
    plan = random_plan(np.random.default_rng(seed))
    world = build_world(plan, SEED, IDEAL)
    drawn = plan.storeys[0]
    doors = unary_union([o.footprint for o in drawn.openings if o.z_min < 1.0 < o.z_max])
    expected = drawn.walls.difference(doors)
    found = section(world.mesh, drawn.z_floor + 1.0)
    assert found.symmetric_difference(expected).area < 1e-3 * expected.area


OPEN = GeneratorConfig(kinds=("wings", "blocks"), cross=1.0, opening=1.0)


@settings(max_examples=15, deadline=None)
@given(st.sampled_from([None, OPEN]), st.integers(0, 100_000))
@example(OPEN, 26)  # two openings that end where the wall does
def test_any_plan_can_be_built_and_its_truth_is_consistent(config, seed):
    plan = random_plan(np.random.default_rng(seed), config)
    truth = true_world(plan, np.random.SeedSequence(seed), AS_BUILT)
    assert truth.rooms
    for room in truth.rooms:
        assert room.polygon.is_valid
        assert all(truth.faces[f].room == room.id for f in room.faces)
    for wall in truth.walls:
        a, b = (truth.faces[f] for f in wall.faces)
        assert a.normal @ b.normal < -0.99
        assert 0.0 < wall.thickness <= 0.6
    for face in truth.faces:
        assert face.length >= 0.5
        assert np.linalg.norm(face.normal) == pytest.approx(1.0)


def test_the_generator_draws_valid_buildings():
    for seed in (*range(30), 34363):  # the last one drew a room that crossed itself
        (storey,) = random_plan(np.random.default_rng(seed)).storeys
        outlines = [room.outline for room in storey.rooms]
        assert all(outline.is_valid and outline.area > 1.0 for outline in outlines)
        assert sum(o.area for o in outlines) == pytest.approx(unary_union(outlines).area, rel=1e-6)
        for opening in storey.openings:
            assert opening.footprint.intersection(storey.walls).area > 0.5 * opening.footprint.area


@pytest.mark.parametrize("name", ["as-built", "office"])
def test_the_surfaces_alone_are_those_of_the_world(name):
    plan, conditions = random_plan(np.random.default_rng(3)), conditions_named(name)
    world = build_world(plan, SEED, conditions)
    truth, mesh = true_mesh(plan, SEED, conditions)
    assert np.array_equal(mesh.vertices, world.mesh.vertices)
    assert np.array_equal(mesh.face, world.mesh.face)
    assert len(truth.faces) == len(world.truth.faces)
