"""The truth against the model that rays are cast in: over random buildings, and as they are lived
in."""

import mujoco
import numpy as np
import pytest
import shapely
from hypothesis import example, given, settings
from hypothesis import strategies as st
from shapely.geometry import MultiPoint

from sim.caster import RayCaster
from worlds.catalogue import load_scene, scene_names
from worlds.conditions import CONDITIONS, IDEAL, conditions_named
from worlds.generator import random_plan
from worlds.redrawn import redrawn
from worlds.truth import CEILING, FLOOR
from worlds.world import build_world

CLOSE = 1e-3
"""What "where rays say it is" means [m]."""
BEFORE = 0.02
"""Rays start this far before a face: nothing stands nearer [m]."""
LEANING = 0.03
"""By how much a part may end earlier at its foot than at mid height, where it is drawn: the wall
round the corner leans too, 0.15 degrees in one standard deviation [m]."""
LIVED_IN = ("ideal", "as-built", "office", "real-site")


def compiled(world, bare=False):
    """bare: without what stands in it."""
    spec = world.spec.copy()
    standing = {solid.name for fitting in world.fittings for solid in fitting.solids()}
    for geom in list(spec.geoms) if bare else ():
        if geom.name in standing:
            spec.delete(geom)
    model = spec.compile()
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    return model, data


def mj_ray(model, data, origin, direction):
    geom = np.array([-1], dtype=np.int32)
    distance = mujoco.mj_ray(model, data, origin, direction, None, 1, -1, geom)
    return distance, int(geom[0])


def assert_faces_are_where_rays_say(world, rng, places=3):
    """Each part of each face, met from in front of it at its foot, where no opening begins; what
    stands before it is taken away first."""
    model, data = compiled(world, bare=True)
    for face in world.truth.faces:
        across = np.append(face.normal[:2] / np.hypot(*face.normal[:2]), 0.0)
        z = face.z_range[0] + 0.03
        for start, end in face.parts:
            inset = LEANING / np.linalg.norm(end - start)
            if inset > 0.5:
                continue
            for share in rng.uniform(inset, 1.0 - inset, places):
                foot = np.append(start + share * (end - start), z)
                # The wall leans itself.
                foot -= (face.normal @ foot + face.d) / (face.normal @ across) * across
                distance, _ = mj_ray(model, data, foot + BEFORE * across, -across)
                assert abs(distance - BEFORE) < CLOSE, f"face {face.id} at {foot}"


def assert_hits_are_on_their_faces(world, rng, count):
    """Rays from anywhere in the rooms end on the faces that their labels name."""
    inner = [room.polygon.buffer(-0.4) for room in world.truth.rooms]
    inner = [polygon for polygon in inner if not polygon.is_empty]
    places = [polygon.representative_point().coords[0] for polygon in inner]
    z_floor = world.truth.floors[0].z_floor
    origins = np.array([[*places[k % len(places)], z_floor + 1.0] for k in range(count)])
    directions = rng.normal(size=(count, 3)) * [1.0, 1.0, 0.4]
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    rays = np.hstack([origins, directions]).astype(np.float32)
    hits = RayCaster(world.mesh, threads=1).cast(rays)
    points = origins + hits.distance[:, None] * directions
    met = 0
    for k in np.flatnonzero(np.isfinite(hits.distance) & (hits.face >= 0)):
        face = world.truth.faces[hits.face[k]]
        assert abs(face.normal @ points[k] + face.d) < CLOSE
        assert face.normal @ directions[k] < 0.0
        assert face.z_range[0] - 0.03 <= points[k, 2] <= face.z_range[1] + 0.03
        along = (face.segment[1] - face.segment[0]) / np.linalg.norm(np.diff(face.segment, axis=0))
        reach = np.sort((face.segment - points[k, :2]) @ along)
        assert reach[0] < 0.03
        assert reach[1] > -0.03
        met += 1
    for label, level in ((FLOOR, 0), (CEILING, 1)):
        z = points[(hits.face == label) & np.isfinite(hits.distance), 2]
        floor = world.truth.floors[0]
        expected = (floor.z_floor, floor.z_ceiling)[level]
        assert np.abs(z - expected).max(initial=0.0) < CLOSE
    return met


@settings(max_examples=6, deadline=None)
@given(st.integers(0, 100_000), st.sampled_from(LIVED_IN))
def test_every_face_of_any_building_is_where_rays_say_it_is(seed, name):
    plan = random_plan(np.random.default_rng(seed))
    world = build_world(plan, np.random.SeedSequence(seed), conditions_named(name))
    rng = np.random.default_rng(seed)
    assert_faces_are_where_rays_say(world, rng)
    assert assert_hits_are_on_their_faces(world, rng, 800) > 50


@pytest.mark.slow
@settings(max_examples=60, deadline=None)
@given(st.integers(0, 100_000), st.sampled_from(sorted(CONDITIONS)))
@example(50, "as-built")  # A corner 12 mm further in at its foot.
def test_every_face_of_many_buildings_is_where_rays_say_it_is(seed, name):
    plan = random_plan(np.random.default_rng(seed))
    world = build_world(plan, np.random.SeedSequence(seed), conditions_named(name))
    rng = np.random.default_rng(seed)
    assert_faces_are_where_rays_say(world, rng)
    assert_hits_are_on_their_faces(world, rng, 2000)


def test_a_room_joined_over_a_gap_has_one_face_on_one_line():
    # Two bodies on one line in one room: as built they differed by 8 mm, and the face lay between.
    plan = random_plan(np.random.default_rng(13))
    world = build_world(plan, np.random.SeedSequence(13), CONDITIONS["as-built"])
    corners = world.mesh.vertices[world.mesh.triangles]
    for face in world.truth.faces:
        mine = corners[world.mesh.face == face.id].reshape(-1, 3)
        assert np.abs(mine @ face.normal + face.d).max() < 1e-9


def section(world, height):
    """What the walls of the compiled model cut out of a level plane [shapely geometry]."""
    model, data = compiled(world)
    found = []
    for geom in range(model.ngeom):
        if model.geom_type[geom] != mujoco.mjtGeom.mjGEOM_MESH:
            continue
        mesh = model.geom_dataid[geom]
        first, count = model.mesh_vertadr[mesh], model.mesh_vertnum[mesh]
        rotation = data.geom_xmat[geom].reshape(3, 3)
        points = model.mesh_vert[first : first + count] @ rotation.T + data.geom_xpos[geom]
        first, count = model.mesh_faceadr[mesh], model.mesh_facenum[mesh]
        triangles = points[model.mesh_face[first : first + count]]
        cut = _cut(triangles, height)
        if len(cut) > 2:
            found.append(MultiPoint(cut).convex_hull)
    return shapely.union_all(found)


def _cut(triangles, height):
    """(N, 2) where the edges of triangles cross a height."""
    p, q = triangles.reshape(-1, 3), np.roll(triangles, -1, axis=1).reshape(-1, 3)
    crosses = (p[:, 2] - height) * (q[:, 2] - height) < 0
    p, q = p[crosses], q[crosses]
    t = (height - p[:, 2]) / (q[:, 2] - p[:, 2])
    return (p + t[:, None] * (q - p))[:, :2]


@settings(max_examples=10, deadline=None)
@given(st.integers(0, 100_000), st.booleans())
def test_a_section_through_the_model_gives_back_the_plan(seed, unfinished):
    plan = random_plan(np.random.default_rng(seed))
    storey = plan.storeys[0]
    conditions = conditions_named("ideal+unfinished") if unfinished else IDEAL
    seeds = np.random.SeedSequence(seed)
    world = build_world(plan, seeds, conditions)
    own = np.random.SeedSequence(seeds.entropy, spawn_key=(0, 0))
    drawn = redrawn(storey, conditions, np.random.default_rng(own))
    for height in (0.5, 1.2, 2.1):
        open_there = [o.footprint for o in drawn.openings if o.z_min < height < o.z_max]
        expected = drawn.walls.difference(shapely.union_all(open_there))
        found = section(world, storey.z_floor + height)
        assert found.symmetric_difference(expected).area < 1e-3 * expected.area


@pytest.mark.parametrize("conditions", ["as-built", "office+real-site"])
@pytest.mark.parametrize("name", scene_names())
def test_many_rays_at_once_agree_with_one_by_one_on_every_scene(name, conditions):
    world = build_world(load_scene(name), np.random.SeedSequence(1), conditions_named(conditions))
    model, data = compiled(world)
    rng = np.random.default_rng(2)
    for room in world.truth.rooms[:: max(1, len(world.truth.rooms) // 6)]:
        floor = next(f for f in world.truth.floors if f.storey == room.storey)
        place = room.polygon.buffer(-0.3).representative_point()
        origin = np.array([place.x, place.y, floor.z_floor + 0.5])
        directions = rng.normal(size=(80, 3))
        directions /= np.linalg.norm(directions, axis=1, keepdims=True)
        geoms, distances = np.full(80, -1, dtype=np.int32), np.zeros(80)
        mujoco.mj_multiRay(
            model, data, origin, directions.ravel(), None, 1, -1, geoms, distances, None, 80, 1e6
        )
        for direction, geom, distance in zip(directions, geoms, distances, strict=True):
            one, which = mj_ray(model, data, origin, direction)
            assert one == pytest.approx(distance, abs=1e-9)
            assert which == geom
