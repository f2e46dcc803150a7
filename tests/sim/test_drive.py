import numpy as np
import pytest
from boxworld import flat
from shapely.geometry import LineString, Point

from sim.drive import Drive
from sim.route import Route, plan_route
from sim.sensorfile import sensor_named
from slam.core import InputError, RunError
from worlds.catalogue import load_scene
from worlds.conditions import AS_BUILT
from worlds.world import build_world

IDEAL = sensor_named("ideal")


@pytest.fixture(scope="module")
def se1():
    return build_world(load_scene("SE1"), np.random.SeedSequence(0), AS_BUILT)


def test_the_route_visits_every_room_and_keeps_clear_of_the_walls(se1):
    route = plan_route(se1)
    line = LineString(route.points)
    assert set(route.rooms) == {room.name for room in se1.truth.rooms}
    assert route.unreachable == ()
    assert line.distance(se1.footprints[0]) > 0.20
    for room in se1.truth.rooms:
        assert line.intersection(room.polygon).length > 0.5
    first = next(room for room in se1.truth.rooms if room.polygon.contains(Point(route.points[0])))
    assert first.kind == "room"


def test_a_run_can_start_in_a_room_of_choice(se1):
    route = plan_route(se1, start_room="room 5")
    room = next(room for room in se1.truth.rooms if room.name == "room 5")
    assert room.polygon.contains(Point(route.points[0]))


def test_rooms_that_cannot_be_reached_are_listed():
    route = plan_route(flat())
    assert route.unreachable == ("Cellar",)
    assert route.rooms[0] in ("Left", "Right")


def test_a_door_of_59_cm_is_passed_and_one_of_30_cm_is_not():
    assert set(plan_route(flat(door=0.59)).rooms) == {"Left", "Right", "Corridor"}
    assert set(plan_route(flat(door=0.30)).unreachable) >= {"Cellar"}


def test_bad_starts_and_storeys_are_refused(se1):
    with pytest.raises(InputError, match="room 1"):
        plan_route(se1, start_room="rom 1")
    with pytest.raises(InputError, match="storey 3"):
        plan_route(se1, storey=3)


@pytest.mark.parametrize(("name", "value"), [("speed", 0.0), ("speed", -1.0), ("duration", 0.0)])
def test_bad_speeds_and_durations_are_refused(name, value):
    world = flat()
    with pytest.raises(InputError, match=name):
        Drive(world, IDEAL, plan_route(world), **{name: value})


def poses_of(drive):
    return np.array([truth.T_world_base for _, truth in drive])


def test_the_base_follows_its_route_without_touching_anything():
    world = flat()
    route = plan_route(world)
    drive = Drive(world, IDEAL, route, seed=1)
    poses = poses_of(drive)
    line = LineString(route.points)
    off = [line.distance(Point(place)) for place in poses[:, :2, 3]]
    assert max(off) < 0.05
    assert np.linalg.norm(poses[-1, :2, 3] - route.points[-1]) < 0.1
    assert len(poses) * 0.1 == pytest.approx(drive.duration, rel=0.15)
    speed = np.linalg.norm(np.diff(poses[:, :2, 3], axis=0), axis=1) / 0.1
    assert speed.max() < 0.65
    assert speed[:4].max() < 0.01  # it stands at first


def test_stamps_are_the_ends_of_the_sweeps():
    world = flat()
    scans = [scan for scan, _ in Drive(world, IDEAL, plan_route(world), duration=1.0)]
    assert [scan.stamp for scan in scans] == pytest.approx(np.arange(1, 11) * 0.1)
    assert [scan.index for scan in scans] == list(range(10))


def test_the_base_nods_but_little():
    world = flat()
    poses = poses_of(Drive(world, IDEAL, plan_route(world), seed=3, duration=25.0))
    tilt = np.degrees(np.arccos(np.clip(poses[:, 2, 2], -1.0, 1.0)))
    assert 0.1 < np.sqrt(np.mean(tilt**2)) < 1.0
    assert tilt.max() < 2.0


def test_two_drives_with_one_seed_are_the_same_to_the_bit_and_another_seed_is_not():
    world = flat()

    def drive(seed):
        sensor, route = sensor_named("vlp16"), plan_route(world)
        return list(Drive(world, sensor, route, seed=seed, duration=1.5))

    one, two, other = drive(4), drive(4), drive(5)
    for (a, at), (b, bt) in zip(one, two, strict=True):
        assert np.array_equal(a.points, b.points)
        assert np.array_equal(a.times, b.times)
        assert np.array_equal(at.T_world_base, bt.T_world_base)
        assert np.array_equal(at.face, bt.face)
    assert not np.array_equal(one[-1][1].T_world_base, other[-1][1].T_world_base)


def test_touching_a_wall_fails_the_run():
    world = flat()
    into_the_wall = Route(np.array([[2.0, 3.5], [-1.0, 3.5]]), ("Left",), ())
    with pytest.raises(RunError, match="touched a wall at t="):
        list(Drive(world, IDEAL, into_the_wall))
