"""People who walk: met by rays where MuJoCo meets them, and never in the base's way."""

import mujoco
import numpy as np
import pytest
import shapely

from sim.base import Base, BaseConfig
from sim.caster import RayCaster
from sim.crowd import Nobody, make_crowd, meet_capsule
from sim.drive import Drive
from sim.follower import Follower
from sim.route import plan_route
from sim.sensorfile import sensor_named
from sim.walkers import gather_walkers
from slam.core import RunError
from worlds.catalogue import load_scene
from worlds.conditions import AS_BUILT, conditions_named
from worlds.generator import random_plan
from worlds.people import RADII, REACH, posture
from worlds.truth import PEOPLE
from worlds.world import build_world

SEED = np.random.SeedSequence(2)
CONFIG = BaseConfig()


def crowded(conditions="office", seed=SEED):
    world = build_world(load_scene("SE1"), seed, conditions_named(conditions))
    return world, plan_route(world)


def started(world, route, seed=0):
    rng = np.random.default_rng(seed)
    base = Base(world.spec, 0.0, Follower(route.points, CONFIG).start, CONFIG, rng)
    crowd = make_crowd(world, 0, route.points, CONFIG.radius, CONFIG.speed, base.model, rng)
    return base, crowd


def test_rays_meet_people_where_mujoco_does():
    world, route = crowded()
    base, crowd = started(world, route)
    caster = crowd.before(RayCaster(world.mesh, base.geom_ids(world.mesh.geom_names), threads=1))
    rng = np.random.default_rng(0)
    met, wrong = 0, 0
    for instant in range(6):
        for _ in range(15):
            crowd.advance(0.1, np.array([100.0, 100.0]))
        fraction = instant / 5.0
        crowd.put(base.data, fraction)
        mujoco.mj_kinematics(base.model, base.data)
        for x, y in crowd.places():
            origins, directions = rays_at(world, crowd, (x, y), rng)
            rays = np.hstack([origins, directions]).astype(np.float32)
            hits = caster.cast(rays, np.full(len(rays), fraction, dtype=np.float32))
            for k, (origin, direction) in enumerate(zip(origins, directions, strict=True)):
                geom = np.array([-1], dtype=np.int32)
                far = mujoco.mj_ray(base.model, base.data, origin, direction, None, 1, -1, geom)
                if far < 0.0:
                    assert not np.isfinite(hits.distance[k])
                    continue
                wrong += abs(far - hits.distance[k]) > 1e-3 or geom[0] != hits.geom[k]
                met += hits.face[k] == PEOPLE
    assert met > 1500
    assert wrong <= 2  # rays within a millimetre of an edge


def rays_at(world, crowd, place, rng, count=220):
    """Rays from up to 2 m off, and from inside nothing, towards somebody at a place."""
    angle = rng.uniform(-np.pi, np.pi, count)
    off = np.column_stack([np.cos(angle), np.sin(angle)]) * rng.uniform(0.6, 2.0, (count, 1))
    origins = np.column_stack([place + off, rng.uniform(0.3, 1.2, count)])
    free = np.linalg.norm(origins[:, None, :2] - crowd.places(), axis=2).min(axis=1) > 0.45
    free &= shapely.distance(shapely.points(origins[:, :2]), world.footprints[0]) > 0.0
    targets = np.append(place, 0.0) + rng.normal(0.0, [0.15, 0.15, 0.0], (count, 3))
    targets[:, 2] = rng.uniform(0.02, 1.9, count)
    run = (targets - origins)[free]
    origins = origins[free]
    return origins, run / np.linalg.norm(run, axis=1, keepdims=True)


def test_a_capsule_is_met_where_a_closed_form_says():
    middle, axis = np.array([[2.0, 0.0, 1.0]]), np.array([[0.0, 0.0, 1.0]])

    def reach(origin, direction):
        rays = np.array([origin]), np.array([direction])
        distance, cosine = meet_capsule(*rays, middle, axis, 0.5, 0.2)
        return distance[0], cosine[0]

    assert reach([0, 0, 1.0], [1.0, 0, 0]) == pytest.approx((1.8, 1.0))
    assert reach([0, 0.1, 1.0], [1.0, 0, 0])[0] == pytest.approx(2.0 - np.sqrt(0.03))
    assert reach([0, 0, 1.6], [1.0, 0, 0])[0] == pytest.approx(2.0 - np.sqrt(0.03))
    assert reach([2.0, 0, 3.0], [0, 0, -1.0]) == pytest.approx((1.3, 1.0))
    assert reach([0, 0, 1.8], [1.0, 0, 0])[0] == np.inf
    assert reach([4.0, 0, 1.0], [1.0, 0, 0])[0] == np.inf


@pytest.mark.parametrize("seed", range(4))
def test_nobody_comes_near_the_base_nor_the_walls_nor_each_other(seed):
    plan = random_plan(np.random.default_rng(seed))
    world = build_world(plan, np.random.SeedSequence(seed), conditions_named("people+furniture"))
    route = plan_route(world)
    walkers, each = gather_walkers(
        world, 0, route.points, CONFIG.radius, CONFIG.speed, np.random.default_rng(seed)
    )
    line = shapely.linestrings(route.points)
    walked = 0.0
    for step in range(700):
        base = shapely.get_coordinates(line.interpolate(0.06 * step))[0]
        before = [walker.place for walker in walkers.people]
        walkers.advance(0.1, base)
        places = np.array([walker.place for walker in walkers.people]).reshape(-1, 2)
        walked += np.linalg.norm(places - np.array(before).reshape(-1, 2), axis=1).sum()
        assert (np.linalg.norm(places - base, axis=1) > CONFIG.radius + REACH).all()
        for k in range(len(places)):
            others = np.delete(places, k, axis=0)
            assert (np.linalg.norm(others - places[k], axis=1) > 2.0 * max(RADII)).all()
        assert (shapely.distance(shapely.points(places), world.footprints[0]) > 0.2).all()
    assert len(each) == len(world.people)
    assert walked > 5.0


def test_no_limb_is_farther_out_than_the_reach_that_keeps_the_base_away():
    world, _ = crowded("people")
    for person in world.people:
        for stride in (-0.28, 0.0, 0.28):
            middles, axes = posture(person, 0.0, 0.0, 0.3, stride)
            for side in (-1.0, 1.0):
                ends = middles + side * person.halves[:, None] * axes
                assert (np.hypot(ends[:, 0], ends[:, 1]) + RADII <= REACH + 0.01).all()
            tops = middles[:2, 2] + person.halves[:2] + RADII[:2]
            assert tops.max() < person.height + 1e-9


def test_scans_with_people_repeat_and_show_them():
    world, route = crowded("people")
    drives = [Drive(world, sensor_named("vlp16"), route, seed=3, duration=1.5) for _ in range(2)]
    first, second = (list(drive) for drive in drives)
    for (a, truth_a), (b, truth_b) in zip(first, second, strict=True):
        assert np.array_equal(a.points, b.points)
        assert np.array_equal(truth_a.face, truth_b.face)
    assert any((truth.face == PEOPLE).any() for _, truth in first)


def test_an_empty_building_costs_nothing_and_changes_nothing():
    world = build_world(load_scene("SE1"), SEED, AS_BUILT)
    route = plan_route(world)
    _, crowd = started(world, route)
    assert isinstance(crowd, Nobody)
    caster = RayCaster(world.mesh)
    assert crowd.before(caster) is caster


def test_running_into_somebody_fails_the_run():
    world, route = crowded("people")
    base, _ = started(world, route)
    x, y = base.coordinates[:2]
    base.data.mocap_pos[0] = [x + 0.1, y, 0.4]
    with pytest.raises(RunError, match="person0_trunk"):
        base.step(0.0, 0.0)
