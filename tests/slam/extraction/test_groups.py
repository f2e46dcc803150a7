from dataclasses import replace

import numpy as np
import pytest
from synthetic import base_pose, in_base, scan_walls

from slam.extraction.config import ExtractionConfig
from slam.extraction.groups import Gatherer, wall_groups
from slam.extraction.runs import straight_runs
from slam.extraction.sweep import Sweep

CONFIG = ExtractionConfig()


def runs_of(walls, T, seed=0):
    """Runs, and the wall that each is from."""
    scan, wall = scan_walls(walls, T)
    rng = np.random.default_rng(seed)
    points = in_base(scan)
    rays = scan.points / np.linalg.norm(scan.points, axis=1, keepdims=True)
    points = points + rng.normal(0.0, 0.0066, len(points))[:, None] * rays
    points[wall < 0] = np.nan
    sweep = Sweep.of(points, scan.ring, scan.T_base_lidar[:3, 3], CONFIG.max_range)
    runs = straight_runs(sweep, CONFIG)  # no beam is off here
    runs = replace(runs, sigma=np.full(len(runs), 0.001))
    counts = [
        np.bincount(wall[sweep.place[start:stop]], minlength=len(walls))
        for start, stop in zip(runs.start, runs.stop, strict=True)
    ]
    return runs, np.array(counts)


def groups_of(walls, T):
    """Of each group with enough returns: how many of them (W,) are from each wall."""
    runs, counts = runs_of(walls, T)
    groups = [counts[members].sum(axis=0) for members in wall_groups(runs, CONFIG)]
    return [count for count in groups if count.sum() >= CONFIG.min_points]


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


@pytest.mark.parametrize("step", [0.04, 0.06, 0.1])
@pytest.mark.parametrize("which", [0, 1])
def test_a_group_that_two_lines_explain_better_is_that_of_its_seed(step, which):
    """However it came together."""
    walls = [((-3.0, -2.0), (0.5, -2.0)), ((0.5, -2.0 - step), (3.0, -2.0 - step))]
    runs, counts = runs_of(walls, base_pose(0.3, 0.5, 0.2))
    of = counts.argmax(axis=1)
    gatherer = Gatherer(runs, CONFIG)
    seed = int(np.flatnonzero(of == which)[gatherer.size[of == which].argmax()])
    members = gatherer.of_one_wall(np.arange(len(runs)), seed)
    assert set(of[members]) == {which}
    assert len(members) > 0.9 * np.count_nonzero(of == which)


def test_a_group_of_one_wall_stays_whole():
    runs, _ = runs_of([((-3.0, -2.0), (3.0, -2.0))], base_pose(0.3, 0.5, 0.2))
    every = np.arange(len(runs))
    assert np.array_equal(Gatherer(runs, CONFIG).of_one_wall(every, 0), every)
