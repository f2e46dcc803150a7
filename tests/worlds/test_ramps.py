"""Ramps as built: where they are drawn, and nothing open beside, under or above them."""

import mujoco
import numpy as np
import pytest

from worlds.catalogue import load_scene
from worlds.conditions import AS_BUILT
from worlds.model import MARGIN
from worlds.world import build_world

UP = np.array([0.0, 0.0, 0.5])


@pytest.fixture(scope="module")
def building():
    world = build_world(load_scene("ramp"), np.random.SeedSequence(2), AS_BUILT)
    model = world.spec.copy().compile()
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    return world, model, data


def ray(model, data, origin, direction):
    geom = np.array([-1], dtype=np.int32)
    return mujoco.mj_ray(model, data, origin, direction, None, 1, -1, geom)


def places_on(world, ramp, rng, count):
    """(count, 3) on the surface of a ramp, 0.3 m and more off its sides."""
    along, aside = rng.uniform(0.02, 0.98, count), rng.uniform(-0.7, 0.7, count)
    foot, head = ramp.foot.mean(axis=0), ramp.head.mean(axis=0)
    left = (ramp.foot[0] - ramp.foot[1]) / np.linalg.norm(ramp.foot[0] - ramp.foot[1])
    level = foot + along[:, None] * (head - foot) + aside[:, None] * left
    low, high = (world.plan.storeys[ramp.storey + k].z_floor for k in (0, 1))
    return np.column_stack([level, low + along * (high - low)])


def test_the_surface_of_a_ramp_is_where_it_is_drawn(building):
    world, model, data = building
    rng = np.random.default_rng(0)
    assert len(world.ramps) == 2
    for ramp in world.ramps:
        for place in places_on(world, ramp, rng, 60):
            down = ray(model, data, place + UP, np.array([0.0, 0.0, -1.0]))
            assert down == pytest.approx(0.5, abs=1e-6)


def test_no_ray_leaves_the_building_from_a_ramp(building):
    world, model, data = building
    rng = np.random.default_rng(1)
    for ramp in world.ramps:
        for place in places_on(world, ramp, rng, 60):
            for direction in rng.standard_normal((40, 3)):
                distance = ray(model, data, place + UP, direction)
                assert distance > 0.0
                hit = place + UP + distance * direction
                assert -0.2 <= hit[0] <= 34.4
                assert -0.2 <= hit[1] <= 15.2


def test_one_storey_by_itself_has_no_ramp_and_no_hole():
    world = build_world(load_scene("ramp"), np.random.SeedSequence(2), AS_BUILT, storey=1)
    assert world.ramps == ()
    names = world.mesh.geom_names
    assert "s1_floor" in names
    assert "s1_ceiling" in names


def test_a_floor_with_a_hole_has_the_rest_of_its_area(building):
    world, _, _ = building
    mesh = world.mesh
    own = [k for k, name in enumerate(mesh.geom_names) if name.startswith("s1_floor")]
    corners = mesh.vertices[mesh.triangles[np.isin(mesh.geom_name, own)]]
    across = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    top = across[:, 2] > 1e-9
    assert corners[top][..., 2] == pytest.approx(world.plan.storeys[1].z_floor)
    bounds = np.array(world.plan.storeys[1].walls.bounds).reshape(2, 2)
    whole = float(np.prod(bounds[1] - bounds[0] + 2.0 * MARGIN))
    hole = world.ramps[0].outline.area
    assert across[top, 2].sum() / 2.0 == pytest.approx(whole - hole, abs=1e-6)
