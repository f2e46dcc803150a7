import numpy as np
import pytest
from boxworld import flat
from shapely.geometry import LineString, Point

from sim.base import Base, BaseConfig
from sim.drive import Drive
from sim.follower import Follower
from sim.route import Route, plan_route
from sim.sensorfile import sensor_named
from slam.core import InputError, RunError, inverse
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


def test_the_body_leans_against_what_the_wheels_do():
    config = BaseConfig(road_height=0.0, road_tilt=0.0)
    base = Base(flat().spec, 0.0, (2.0, 3.0, 0.0), config, np.random.default_rng(0))

    def lean(speed, turn_rate, steps):
        for speed_now in np.linspace(*speed, steps):
            base.step(speed_now, turn_rate)
        return base.coordinates[4:]

    assert lean((0.0, 0.4), 0.0, 160)[1] < -0.002  # nose up while it speeds up
    roll, _ = lean((0.4, 0.4), 0.8, 200)
    assert roll > 0.002  # out of the bend: the left side rises in a left turn
    assert lean((0.4, 0.0), 0.0, 160)[1] > 0.002
    assert np.abs(lean((0.0, 0.0), 0.0, 800)).max() < 1e-4


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
        assert np.array_equal(a.wheels.T_odom_base, b.wheels.T_odom_base)
    assert not np.array_equal(one[-1][1].T_world_base, other[-1][1].T_world_base)


@pytest.mark.parametrize(
    ("points", "speed", "wall"),
    [
        ([[2.0, 3.5], [-1.0, 3.5]], 0.6, "west"),
        ([[2.0, 3.5], [-1.0, 3.5]], 1.5, "west"),
        ([[2.0, 5.55], [3.8, 5.55]], 0.6, "north"),  # along it, 15 cm away: the disc has 20
        ([[1.2, 3.0], [1.8, 1.0]], 0.6, "inner_b"),  # through a door, but at its jamb
    ],
)
def test_touching_a_wall_fails_the_run(points, speed, wall):
    into_the_wall = Route(np.array(points), ("Left",), ())
    with pytest.raises(RunError, match=rf"touched a wall at t=.*\({wall}\)"):
        list(Drive(flat(), IDEAL, into_the_wall, speed=speed))


@pytest.mark.parametrize("config", [BaseConfig(), BaseConfig(speed=1.5, turn_rate=1.2)])
def test_speed_acceleration_and_jerk_stay_within_their_bounds(config):
    route = plan_route(flat())
    follower = Follower(route.points, config)
    base = Base(flat().spec, 0.0, follower.start, config, np.random.default_rng(0))
    asked, went = [], []
    while not follower.finished:
        asked.append(follower.command(*base.coordinates[:3].tolist()))
        base.step(*asked[-1])
        went.append(base.coordinates)
    line = LineString(route.points)
    assert max(line.distance(Point(place)) for place in np.array(went)[:, :2]) < 0.03
    bounds = np.array(
        [
            [config.speed, config.acceleration, config.jerk],
            [config.turn_rate, config.turn_acceleration, config.turn_jerk],
        ]
    )
    change = np.array(asked)
    for order in range(3):
        assert (np.abs(change).max(axis=0) <= bounds[:, order] * (1.0 + 1e-4)).all()
        assert (np.abs(change).max(axis=0) > 0.6 * bounds[:, order]).all()
        change = np.diff(change, axis=0) / config.timestep
    moved = np.diff(np.array(went)[:, :2], axis=0) / config.timestep
    speed = np.linalg.norm(moved, axis=1)
    assert speed.max() < 1.03 * config.speed
    assert np.abs(np.diff(speed)).max() / config.timestep < 1.6 * config.acceleration


def test_every_scan_comes_with_what_the_wheels_say():
    world = flat()
    pairs = list(Drive(world, IDEAL, plan_route(world), seed=2, duration=20.0))
    wheels = [scan.wheels for scan, _ in pairs]
    assert [w.stamp for w in wheels] == [scan.stamp for scan, _ in pairs]
    truth = np.array([t.T_world_base for _, t in pairs])
    went = np.linalg.norm(np.diff(truth[:, :2, 3], axis=0), axis=1).sum()
    believed = inverse(wheels[0].T_odom_base) @ wheels[-1].T_odom_base
    true = inverse(truth[0]) @ truth[-1]
    off = float(np.linalg.norm((believed - true)[:2, 3]))
    assert 1e-4 < off < 0.1 * went  # an odometry, and not the truth
    speed = [w.twist[0] for w in wheels]
    assert max(speed) == pytest.approx(0.6, abs=0.05)
