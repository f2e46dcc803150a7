import numpy as np
import pytest
from synthetic import base_pose, box_planes, in_base, scan_box

from slam.core import transform_plane
from slam.extraction import ExtractionConfig, extract
from slam.extraction.levels import find_levels
from slam.extraction.ramps import _best_plane, on_ramp
from slam.extraction.sweep import Sweep

CONFIG = ExtractionConfig()
SHAFT = box_planes(14.0, 3.0, 3.5)
FOOT = 4.0


def ramp(slope):
    """A plane that rises along x [rad] from the foot on, over the floor of the shaft."""
    normal = np.array([-np.sin(slope), 0.0, np.cos(slope)])
    return normal, float(np.sin(slope) * FOOT)


def seen(planes, T, rng=None):
    scan = scan_box(planes, T, rng)
    return scan, in_base(scan), scan.T_base_lidar[:3, 3]


@pytest.mark.parametrize("slope", [4.0, 6.0, 8.0])
@pytest.mark.parametrize("x", [1.0, 2.5])
def test_a_ramp_is_no_wall_and_does_not_tilt_the_floor(slope, x):
    planes = [*SHAFT, ramp(np.radians(slope))]
    scan, points, origin = seen(planes, base_pose(x, 1.5, 0.3), np.random.default_rng(1))
    found = extract(points, scan.ring, origin, CONFIG)
    walls = [p for p in found.planes if abs(p.normal[2]) < 0.7]
    for wall in walls:
        normal, _ = transform_plane(base_pose(x, 1.5, 0.3), wall.normal, wall.d)
        assert max(true @ normal for true, _ in SHAFT) > np.cos(np.radians(2.0))
    for floor in (p for p in found.planes if abs(p.normal[2]) > 0.7):
        assert np.degrees(np.arccos(abs(floor.normal[2]))) < 1.0


def test_what_is_on_a_ramp_is_told():
    slope = np.radians(6.0)
    normal, d = ramp(slope)
    scan, points, origin = seen([*SHAFT, (normal, d)], base_pose(1.5, 1.5, 0.0))
    sweep = Sweep.of(points, scan.ring, origin, CONFIG.max_range)
    world = sweep.xyz + base_pose(1.5, 1.5, 0.0)[:3, 3]
    near = np.abs(world @ normal + d) < 0.005
    inside = near & (world[:, 0] > FOOT + 0.5) & (world[:, 1] > 0.1) & (world[:, 1] < 2.9)
    on = find_levels(sweep, CONFIG).on
    assert inside.sum() > 300
    assert on[inside].mean() > 0.95
    high = world[:, 2] > 1.5
    assert not on[high & (np.abs(world[:, 0] - 14.0) < 0.01)].any()


def test_a_room_without_one_has_none():
    scan, points, origin = seen(SHAFT, base_pose(5.0, 1.5, 0.3), np.random.default_rng(0))
    sweep = Sweep.of(points, scan.ring, origin, CONFIG.max_range)
    nothing = np.zeros(len(sweep), dtype=bool)
    floor = sweep.xyz[:, 2] < 0.1
    assert not on_ramp(sweep, nothing | floor, *sweep.above(), CONFIG).any()


def test_a_wall_is_no_ramp_however_many_points_it_has():
    rng = np.random.default_rng(0)
    y, z = rng.uniform(-3.0, 3.0, (2, 500))
    assert _best_plane(np.column_stack([np.full(500, 2.0), y, z]), CONFIG) is None


@pytest.mark.parametrize("tilt", [(0.0, 0.0), (0.0, -0.1), (0.05, 0.02), (-0.12, 0.0)])
def test_walls_tell_which_way_is_up(tilt):
    T = base_pose(5.0, 1.5, 0.4, tilt)
    scan, points, origin = seen(SHAFT, T, np.random.default_rng(2))
    plumb = extract(points, scan.ring, origin, CONFIG).plumb
    assert plumb is not None
    assert np.degrees(np.arccos(plumb @ T[2, :3])) < 0.4


def test_without_walls_nobody_knows():
    floor = [SHAFT[4], *((normal, 500.0) for normal, _ in SHAFT[:4])]
    scan, points, origin = seen(floor, base_pose(0.0, 0.0, 0.0))
    assert extract(points, scan.ring, origin, CONFIG).plumb is None
