from dataclasses import replace

import mujoco
import numpy as np
import pytest
from boxworld import build_box_world, flat, single_room, wall

from sim.base import base_poses
from sim.caster import RayCaster
from sim.lidar import Lidar
from sim.motion import Motion
from sim.sensorfile import sensor_named
from slam.core import inverse, pose, so3_exp, transform_points
from slam.odometry import deskew
from worlds.catalogue import load_scene
from worlds.conditions import AS_BUILT
from worlds.truth import FLOOR
from worlds.world import build_world

T_BASE_LIDAR = pose(np.eye(3), np.array([0.0, 0.0, 0.5]))
STANDING = (2.0, 3.5, 0.4)


def motion(start, end=None, period=0.1):
    """From one (x, y, yaw) to another in one sweep."""
    ends = np.array([start, end or start])
    coordinates = np.linspace(*ends, 21)
    flat_out = np.column_stack([coordinates, np.zeros((21, 3))])
    return Motion(np.linspace(0.0, period, 21), base_poses(flat_out, 0.0))


def sweep(sensor="ideal", moved=None, seed=0, world=None):
    lidar = Lidar(
        sensor_named(sensor),
        RayCaster((world or flat()).mesh),
        np.random.default_rng(seed),
        T_BASE_LIDAR,
    )
    return lidar.sweep(0, 0.1, moved or motion(STANDING))


def rays(origins, directions):
    return np.hstack([origins, directions]).astype(np.float32)


def test_rays_hit_where_a_closed_form_says():
    caster = RayCaster(flat().mesh)
    origins = np.tile([2.0, 3.5, 0.5], (4, 1))
    directions = np.array([[-1.0, 0, 0], [0, 1.0, 0], [0, 0, -1.0], [-0.6, 0.8, 0]])
    hits = caster.cast(rays(origins, directions))
    assert hits.distance == pytest.approx([2.0, 2.2, 0.5, 2.75], abs=1e-6)
    assert hits.face[2] == FLOOR


def test_embree_and_mujoco_agree_on_an_as_built_building():
    world = build_world(load_scene("SE1"), np.random.SeedSequence(3), AS_BUILT)
    model = world.spec.copy().compile()
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    ids = np.array([model.geom(n).id for n in world.mesh.geom_names], dtype=np.int32)
    caster = RayCaster(world.mesh, ids)
    rng = np.random.default_rng(0)
    rooms = [room.polygon.centroid.coords[0] for room in world.truth.rooms]
    origins = np.array([[*rooms[k % len(rooms)], 0.5] for k in range(6000)])
    directions = rng.normal(size=(6000, 3)) * [1.0, 1.0, 0.3]
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    hits = caster.cast(rays(origins, directions))
    wrong = 0
    for k in range(len(origins)):
        geom = np.array([-1], dtype=np.int32)
        distance = mujoco.mj_ray(model, data, origins[k], directions[k], None, 1, -1, geom)
        wrong += abs(distance - hits.distance[k]) > 1e-3 or geom[0] != hits.geom[k]
    assert wrong <= 1  # a ray within a millimetre of an edge


def test_every_return_of_a_perfect_sensor_lies_on_its_face():
    world = flat()
    scan, truth = sweep(world=world)
    assert len(scan) > 25_000
    for face in world.truth.faces:
        points = truth.points_world[truth.face == face.id]
        assert np.abs(points @ face.normal + face.d).max(initial=0.0) < 1e-3
    assert np.abs(truth.points_world[truth.face == FLOOR][:, 2]).max() < 1e-3


def test_points_and_truth_are_of_the_same_returns():
    scan, truth = sweep()
    in_world = transform_points(truth.T_world_base @ T_BASE_LIDAR, scan.points)
    assert np.abs(in_world - truth.points_world).max() < 1e-4
    assert len(scan.times) == len(scan.ring) == len(scan.intensity) == len(truth.face)
    assert ((scan.intensity >= 0.0) & (scan.intensity <= 1.0)).all()
    assert (scan.times <= 0.0).all()
    assert len(np.unique(scan.times)) > 20_000


def test_a_sweep_cast_in_motion_is_straight_again_once_deskewed_with_the_truth():
    start, end = (1.5, 3.2, 0.2), (1.56, 3.22, 0.32)
    scan, truth = sweep(moved=motion(start, end))
    fraction = 1.0 + scan.times / 0.1
    x, y, yaw = (np.array(start)[:, None] + np.subtract(end, start)[:, None] * fraction).tolist()
    zeros = np.zeros(len(scan))
    poses = base_poses(np.column_stack([x, y, yaw, zeros, zeros, zeros]), 0.0)
    in_base = scan.points + T_BASE_LIDAR[:3, 3]
    in_world = np.einsum("nij,nj->ni", poses[:, :3, :3], in_base) + poses[:, :3, 3]
    assert np.abs(in_world - truth.points_world).max() < 1e-3
    skewed = transform_points(truth.T_world_base @ T_BASE_LIDAR, scan.points)
    assert np.abs(skewed - truth.points_world).max() > 0.05


def on_an_arc(seconds, speed, turn_rate):
    """T_world_base (K, 4, 4) of a base that drives a circle, in closed form."""
    yaw, radius = 0.3 + turn_rate * np.asarray(seconds), speed / turn_rate
    x = 3.0 + radius * (np.sin(yaw) - np.sin(0.3))
    y = 2.0 - radius * (np.cos(yaw) - np.cos(0.3))
    zero = np.zeros(len(yaw))
    return base_poses(np.column_stack([x, y, yaw, zero, zero, zero]), 0.0)


def off_the_room(points):
    """Distance (N,) of points from the nearest surface of ``single_room()``."""
    x, y, z = points.T
    return np.min(np.abs([x, x - 6.0, y, y - 4.0, z, z - 2.7]), axis=0)


@pytest.mark.parametrize(("speed", "turn_rate"), [(0.6, 0.8), (1.5, 1.2), (0.1, -2.0)])
def test_what_is_cast_on_the_way_round_a_bend_lies_on_the_walls(speed, turn_rate):
    stamps = np.linspace(0.0, 0.1, 21)
    drive = Motion(stamps, on_an_arc(stamps, speed, turn_rate))
    scan, _ = sweep(moved=drive, world=single_room())
    poses = on_an_arc(0.1 + scan.times, speed, turn_rate)
    in_base = transform_points(T_BASE_LIDAR, scan.points)
    in_world = np.einsum("nij,nj->ni", poses[:, :3, :3], in_base) + poses[:, :3, 3]
    assert len(scan) > 25_000
    assert off_the_room(in_world).max() < 1e-3
    assert off_the_room(transform_points(drive.poses[-1], in_base)).max() > 0.02
    # Knowing only where the sweep began and ended, the odometry's way of it.
    ends = [(0.0, drive.poses[0]), (0.1, drive.poses[-1])]
    deskewed = transform_points(drive.poses[-1], deskew(replace(scan, stamp=0.1), ends))
    assert off_the_room(deskewed).max() < 1e-3 + speed * abs(turn_rate) * 0.1**2 / 8.0


def test_the_noise_is_what_the_preset_says():
    sensor = sensor_named("vlp16")
    lidar = Lidar(sensor, RayCaster(flat().mesh), np.random.default_rng(0), T_BASE_LIDAR)
    sweeps = [lidar.sweep(k, 0.1, motion(STANDING)) for k in range(20)]
    for ring in range(16):
        errors, shots = [], 0
        for scan, truth in sweeps:
            mine = scan.ring == ring
            origin = transform_points(truth.T_world_base, T_BASE_LIDAR[:3, 3])
            world = flat()
            away = truth.points_world[mine] - origin
            ways = away / np.linalg.norm(away, axis=1, keepdims=True)
            exact = RayCaster(world.mesh).cast(rays(np.tile(origin, (len(ways), 1)), ways)).distance
            errors.append(np.linalg.norm(away, axis=1) - exact)
            shots += mine.sum()
        error = np.concatenate(errors)
        assert np.median(error) == pytest.approx(sensor.range_offsets[ring], abs=0.003)
        spread = 1.4826 * np.median(np.abs(error - np.median(error)))
        assert spread == pytest.approx(sensor.range_noise[ring], rel=0.1)
        kept = shots / (20 * sensor.columns)
        assert kept <= 1.0 - sensor.dropout[ring] + 0.02
        assert kept > 0.9


def test_a_shot_across_an_edge_may_return_from_in_between():
    sensor = replace(sensor_named("ideal"), divergence=0.002)
    lidar = Lidar(sensor, RayCaster(flat().mesh), np.random.default_rng(0), T_BASE_LIDAR)
    clean, _ = Lidar(
        replace(sensor, divergence=0.0),
        RayCaster(flat().mesh),
        np.random.default_rng(0),
        T_BASE_LIDAR,
    ).sweep(0, 0.1, motion((2.0, 3.5, 0.4)))
    mixed, _ = lidar.sweep(0, 0.1, motion((2.0, 3.5, 0.4)))
    ranges, exact = (np.full((sensor.columns, 16), np.nan) for _ in range(2))
    for scan, table in ((mixed, ranges), (clean, exact)):
        column = np.floor((scan.times + 0.1) * 18_000 + 1e-6).astype(int)
        table[column, scan.ring] = np.linalg.norm(scan.points, axis=1)
    row, beam = np.nonzero(np.abs(np.diff(exact, axis=0)) > 0.1)
    assert len(row) > 20
    low, high = (f(exact[row, beam], exact[row + 1, beam]) for f in (np.minimum, np.maximum))
    blended = 0
    for shot in (row, row + 1):
        r = ranges[shot, beam]
        assert ((r >= low - 1e-6) & (r <= high + 1e-6)).all()
        blended += ((r > low + 1e-3) & (r < high - 1e-3)).sum()
    step = abs(sensor.column_step)
    assert blended / len(row) == pytest.approx(sensor.divergence / step, abs=0.2)
    untouched = np.abs(ranges - exact) < 1e-9
    untouched[row, beam] = untouched[row + 1, beam] = True
    assert untouched[np.isfinite(exact)].all()


def glazed():
    """A room with a thick pane across it, 1 m before the east wall."""
    boxes = [
        wall("south", -0.2, -0.2, 6.2, 0.0),
        wall("north", -0.2, 4.0, 6.2, 4.2),
        wall("west", -0.2, 0.0, 0.0, 4.0),
        wall("east", 6.0, 0.0, 6.2, 4.0),
        replace(wall("pane", 4.99, 0.0, 5.0, 4.0), glass=True),
    ]
    return build_box_world(boxes, (), ())


def test_glass_lets_most_shots_through_and_mirrors_those_that_meet_it_head_on():
    world = glazed()
    pane = world.mesh.geom_names.index("pane")
    east = world.mesh.geom_names.index("east")
    shares = {}
    for glass, mirror in ((0.0, 0.0), (0.1, 0.0), (0.0, 0.8), (1.0, 0.0)):
        sensor = replace(sensor_named("ideal"), glass=glass, glass_mirror=mirror)
        lidar = Lidar(sensor, RayCaster(world.mesh), np.random.default_rng(0), T_BASE_LIDAR)
        scan, truth = lidar.sweep(0, 0.1, motion((2.0, 2.0, 0.0)))
        at = T_BASE_LIDAR[:3, 3] + [2.0, 2.0, 0.0]
        azimuth = np.abs(np.arctan2(*(truth.points_world - at)[:, [1, 0]].T))
        through = azimuth < 0.4
        through &= np.abs(scan.points[:, 2]) < 0.4  # neither floor nor ceiling
        head_on = through & (np.linalg.norm(scan.points[:, 1:], axis=1) < 0.3)
        on_pane = truth.geom == pane
        shares[glass, mirror] = [
            on_pane[rows].mean() for rows in (through & (azimuth > 0.3), head_on)
        ]
        behind = truth.points_world[truth.geom == east]
        assert np.abs(behind[:, 0] - 6.0).max(initial=0.0) < 1e-3
        corners = world.mesh.vertices[world.mesh.triangles[world.mesh.geom_name == pane]]
        low, high = corners.min(axis=(0, 1)), corners.max(axis=(0, 1))
        beyond = np.abs(truth.points_world[on_pane] - (low + high) / 2.0) - (high - low) / 2.0
        assert np.abs(beyond.max(axis=1)).max(initial=0.0) < 1e-3  # on its surface
    assert shares[0.0, 0.0] == [0.0, 0.0]
    assert shares[0.1, 0.0][0] == pytest.approx(0.19, abs=0.04)  # two surfaces
    assert shares[1.0, 0.0] == [1.0, 1.0]
    assert shares[0.0, 0.8][1] > 0.5 > shares[0.0, 0.8][0]


def test_a_shot_that_meets_too_many_panes_is_lost():
    panes = [replace(wall(f"p{k}", 2 + k, 0.0, 2.1 + k, 9.0), glass=True) for k in range(5)]
    world = build_box_world([wall("east", 9.0, 0.0, 9.2, 9.0), *panes], (), ())
    sensor = sensor_named("ideal")
    lidar = Lidar(sensor, RayCaster(world.mesh), np.random.default_rng(0), T_BASE_LIDAR)
    _, truth = lidar.sweep(0, 0.1, motion((1.0, 4.5, 0.0)))
    assert not (truth.geom == world.mesh.geom_names.index("east")).any()


def test_a_sweep_without_a_single_return_is_empty():
    far = build_box_world([wall("far", 300.0, 0.0, 301.0, 1.0)], (), ())
    scan, truth = sweep(moved=motion((0.0, 0.0, 0.0)), world=far)
    assert len(scan) == len(scan.times) == len(scan.ring) == len(truth.face) == 0
    assert scan.points.shape == (0, 3)


@pytest.mark.parametrize("name", ["vlp16-harsh", "os1-32"])
def test_every_preset_sweeps(name):
    sensor = sensor_named(name)
    scan, truth = sweep(name)
    assert 0.7 * sensor.beams * sensor.columns < len(scan) <= sensor.beams * sensor.columns
    assert set(scan.ring) == set(range(sensor.beams))
    in_world = transform_points(truth.T_world_base @ T_BASE_LIDAR, scan.points)
    assert np.abs(in_world - truth.points_world).max() < 1e-4


def test_the_same_generator_gives_the_same_sweep():
    one, two, other = sweep("vlp16", seed=1), sweep("vlp16", seed=1), sweep("vlp16", seed=2)
    assert np.array_equal(one[0].points, two[0].points)
    assert len(one[0]) != len(other[0]) or not np.array_equal(one[0].points, other[0].points)


def test_a_tilted_base_sees_a_tilted_floor():
    tilt = so3_exp(np.array([0.02, 0.0, 0.0]))
    T = pose(tilt, np.array([2.0, 3.5, 0.0]))
    still = Motion(np.array([0.0, 0.1]), np.stack([T, T]))
    scan, truth = sweep(moved=still)
    floor = transform_points(T_BASE_LIDAR, scan.points[truth.face == FLOOR])
    assert np.abs(transform_points(T, floor)[:, 2]).max() < 1e-3
    assert np.ptp(floor[:, 2]) > 0.02
    assert np.allclose(inverse(T) @ T, np.eye(4))
