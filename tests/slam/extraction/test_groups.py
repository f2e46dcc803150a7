import numpy as np
import pytest
from synthetic import base_pose, in_base, scan_walls

from slam.extraction.config import ExtractionConfig
from slam.extraction.groups import wall_groups
from slam.extraction.runs import straight_runs
from slam.extraction.sweep import Sweep

CONFIG = ExtractionConfig()


def groups_of(walls, T, seed=0):
    """Of each group with enough returns: how many of them (W,) are from each wall."""
    scan, wall = scan_walls(walls, T)
    rng = np.random.default_rng(seed)
    points = in_base(scan)
    rays = scan.points / np.linalg.norm(scan.points, axis=1, keepdims=True)
    points = points + rng.normal(0.0, 0.0066, len(points))[:, None] * rays
    points[wall < 0] = np.nan
    sweep = Sweep.of(points, scan.ring, scan.T_base_lidar[:3, 3], CONFIG.max_range)
    runs = straight_runs(sweep, CONFIG)
    counts = []
    for members in wall_groups(runs, CONFIG):
        of = np.concatenate([wall[sweep.place[runs.start[m] : runs.stop[m]]] for m in members])
        if len(of) >= CONFIG.min_points:
            counts.append(np.bincount(of, minlength=len(walls)))
    return counts


@pytest.mark.parametrize("step", [0.05, 0.1, -0.1])
def test_walls_beside_each_other_are_two_groups(step):
    walls = [((-3.0, -2.0), (0.5, -2.0)), ((0.5, -2.0 - step), (3.0, -2.0 - step))]
    found = groups_of(walls, base_pose(0.3, 0.5, 0.2))
    assert len(found) == 2
    assert {int(count.argmax()) for count in found} == {0, 1}
    assert all(count.max() > 0.98 * count.sum() for count in found)


def test_what_stands_out_of_a_wall_does_not_part_it():
    """A pilaster: the wall goes on behind it, in line."""
    walls = [
        ((-3.0, -2.0), (-0.3, -2.0)),
        ((0.3, -2.0), (3.0, -2.0)),
        ((-0.3, -1.9), (0.3, -1.9)),
    ]
    found = groups_of(walls, base_pose(0.3, 0.5, 0.2))
    assert len(found) == 2
    whole = max(found, key=lambda count: count[0])
    assert min(whole[:2]) > 500
    assert whole[2] < 0.02 * whole.sum()


def test_a_wall_goes_on_behind_a_door_and_ends_behind_a_hall():
    for hole, groups in ((1.0, 1), (2.0, 2)):
        walls = [((-3.0, -2.0), (-0.5 * hole, -2.0)), ((0.5 * hole, -2.0), (3.0, -2.0))]
        assert len(groups_of(walls, base_pose(0.1, 0.5, 0.2))) == groups


@pytest.mark.parametrize(("bend", "groups"), [(0.5, 1), (4.0, 2)])
def test_a_wall_with_a_bend_is_two(bend, groups):
    rise = 3.0 * np.tan(np.radians(bend))
    walls = [((-3.0, -2.0), (0.0, -2.0)), ((0.0, -2.0), (3.0, -2.0 - rise))]
    assert len(groups_of(walls, base_pose(0.0, 0.5, 0.2))) == groups
