"""Routes: into every room of every scene, round its loops, up its ramps, and back if asked."""

from functools import cache

import numpy as np
import pytest
import shapely
from hypothesis import given, settings
from hypothesis import strategies as st
from shapely.geometry import LineString, Point

from sim.base import Base, BaseConfig
from sim.follower import Follower
from sim.freespace import covered
from sim.ground import Ground
from sim.route import RouteConfig, named_route, plan_route
from sim.tour import plan_tour
from slam.core import InputError
from worlds.catalogue import load_scene, scene_names
from worlds.conditions import AS_BUILT
from worlds.generator import random_plan
from worlds.world import build_world

ONE_STOREY = [name for name in scene_names() if name != "ramp"]


@cache
def built(name):
    return build_world(load_scene(name), np.random.SeedSequence(0), AS_BUILT)


@pytest.mark.parametrize("name", [*ONE_STOREY, "rooms-40-3"])
def test_every_room_of_a_scene_is_reached_without_coming_near_a_wall(name):
    world = built(name)
    route = plan_route(world)
    line = LineString(route.points)
    assert set(route.rooms) == {room.name for room in world.truth.rooms}
    assert route.unreachable == ()
    assert line.distance(world.footprints[0]) > 0.20
    for room in world.truth.rooms:
        assert line.intersection(room.polygon).length > 0.3
    first = next(r for r in world.truth.rooms if r.polygon.contains(Point(route.points[0])))
    assert first.kind == "room"


@pytest.mark.parametrize("name", ["SE1", "SE3", "curved", "rooms-40-3"])
def test_a_closed_route_returns_to_its_start(name):
    route = plan_route(built(name), config=RouteConfig(closed=True))
    assert route.points[-1] == pytest.approx(route.points[0])
    assert set(route.rooms) == {room.name for room in built(name).truth.rooms}


def doors_passed(world, route):
    line = LineString(route.points)
    return [line.distance(Point(door.centre[:2])) < door.width / 2.0 for door in world.truth.doors]


@pytest.mark.parametrize("name", ["SE1", "SE2", "SC1F1"])
def test_loops_are_driven_round(name):
    world = built(name)
    with_loops = plan_route(world)
    without = plan_route(world, config=RouteConfig(loop=0.0))
    # A building with L loops is a tree and L doors more; all of them are passed.
    assert all(doors_passed(world, with_loops))
    assert len(world.truth.doors) >= len(world.truth.rooms)
    assert without.length <= with_loops.length < without.length + 2 * 12.0


def test_a_named_route_keeps_to_its_rooms():
    world = built("SE3")
    part = named_route(world.plan, "Fourteen")
    route = plan_route(world, part=part)
    drawn = {room.id: room.name for room in world.plan.storeys[0].rooms}
    assert set(route.rooms) == {drawn[k] for k in part.rooms}
    assert len(route.rooms) == 14
    others = [r.polygon for r in world.truth.rooms if r.name not in route.rooms]
    assert not LineString(route.points).crosses(shapely.union_all(others).buffer(-0.5))
    assert Point(route.points[0]).within(
        next(r.polygon for r in world.truth.rooms if r.name == "room 1")
    )


def test_an_unknown_route_is_refused_with_the_known_ones():
    with pytest.raises(InputError, match="fourteen"):
        named_route(load_scene("SE3"), "forteen")
    with pytest.raises(InputError, match="names none"):
        named_route(load_scene("SE1"), "all")


def test_a_route_leads_through_all_storeys_that_ramps_join():
    world = built("ramp")
    route = plan_route(world)
    assert set(route.rooms) == {room.name for room in world.truth.rooms}
    assert route.unreachable == ()
    one = plan_route(build_world(world.plan, np.random.SeedSequence(0), AS_BUILT, 1), 1)
    assert {name for name in one.rooms if name.startswith("room 1")} == {
        room.name for room in world.truth.rooms if room.name.startswith("room 1")
    }


def test_the_base_drives_up_the_ramp_and_leans_as_it_does():
    world = built("ramp")
    ramp = world.ramps[0]
    middle = np.array([ramp.foot.mean(axis=0), ramp.head.mean(axis=0)])
    line = middle + np.array([[-0.9, 0.0], [0.9, 0.0]])
    config = BaseConfig()
    ground, follower = Ground(world, 0), Follower(line, config)
    rng = np.random.default_rng(0)
    base = Base(world.spec, ground.height, follower.start, config, rng, ground)
    track = []
    while not follower.finished:
        base.step(*follower.command(*base.coordinates[:3].tolist()))
        track.append(base.coordinates)
    x, z, pitch = np.array(track)[:, [0, 3, 5]].T
    rise = np.clip((x - middle[0, 0]) / (middle[1, 0] - middle[0, 0]), 0.0, 1.0) * 2.9
    assert np.abs(z - rise).max() < 0.02
    assert z[-1] == pytest.approx(2.9, abs=0.01)
    on_it = (x > middle[0, 0] + 2.0) & (x < middle[1, 0] - 2.0)
    assert np.degrees(pitch[on_it].mean()) == pytest.approx(
        -np.degrees(np.arctan(2.9 / 30.0)), abs=0.1
    )


@settings(max_examples=15, deadline=None)
@given(seed=st.integers(0, 10_000))
def test_points_in_polygons_are_those_that_shapely_finds(seed):
    walls = random_plan(np.random.default_rng(seed)).storeys[0].walls
    low_x, low_y, high_x, high_y = walls.bounds
    xs, ys = np.arange(low_x - 1.0, high_x + 1.0, 0.13), np.arange(low_y - 1.0, high_y + 1.0, 0.13)
    expected = shapely.contains_xy(walls, *np.meshgrid(xs, ys))
    assert np.array_equal(covered(walls, xs, ys), expected)


@settings(max_examples=30, deadline=None)
@given(seed=st.integers(0, 10_000), count=st.integers(1, 40), closed=st.booleans())
def test_a_tour_visits_every_place_once_and_has_no_crossings_to_undo(seed, count, closed):
    places = np.random.default_rng(seed).uniform(0.0, 10.0, (count, 2))
    distances = np.linalg.norm(places[:, None] - places[None], axis=2)
    tour = plan_tour(distances, 0, closed)
    assert tour[0] == 0
    if closed:
        assert tour[-1] == 0
    assert sorted(tour[: len(tour) - closed].tolist()) == list(range(count))

    def length(order):
        return distances[order[:-1], order[1:]].sum()

    last = len(tour) - 1 if closed else len(tour)
    for i in range(1, last):
        for j in range(i + 1, last):
            turned = tour.copy()
            turned[i : j + 1] = tour[i : j + 1][::-1]
            assert length(turned) >= length(tour) - 1e-5
