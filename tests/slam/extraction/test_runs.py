import itertools

import numpy as np
import pytest
from synthetic import base_pose, in_base, scan_walls

from slam.extraction.config import ExtractionConfig
from slam.extraction.moments import Lines
from slam.extraction.runs import straight_runs
from slam.extraction.sweep import Sweep

CONFIG = ExtractionConfig()


def upright(walls, T, rng=None, noise=0.0066):
    """The sweep of walls without its floor, and the wall of each return."""
    scan, wall = scan_walls(walls, T, rng, noise)
    points = np.where((wall >= 0)[:, None], in_base(scan), np.nan)
    sweep = Sweep.of(points, scan.ring, scan.T_base_lidar[:3, 3], CONFIG.max_range)
    return sweep, wall[sweep.place]


def test_runs_lie_on_one_wall_each_and_know_its_direction():
    corner = [((-3.0, -2.0), (3.0, -2.0)), ((3.0, -2.0), (3.0, 2.5))]
    sweep, wall = upright(corner, base_pose(0.5, 0.0, 0.3), np.random.default_rng(0))
    runs = straight_runs(sweep, CONFIG)
    assert runs.noise == pytest.approx(0.0066, rel=0.15)
    found = set()
    for start, stop, angle in zip(runs.start, runs.stop, Lines(runs.moments).angle, strict=True):
        on = wall[start:stop]
        assert np.bincount(on).max() > 0.97 * len(on)
        assert len(set(sweep.ring[start:stop])) == 1
        true = -0.3 + 0.5 * np.pi * np.bincount(on).argmax()
        off = np.degrees((angle - true + 0.5 * np.pi) % np.pi - 0.5 * np.pi)
        assert abs(off) < 1.0
        found.add(int(np.bincount(on).argmax()))
    assert found == {0, 1}


@pytest.mark.parametrize("step", [0.05, 0.1])
def test_a_step_within_a_beam_cuts_the_run(step):
    walls = [((-3.0, -2.0), (0.0, -2.0)), ((0.0, -2.0 - step), (3.0, -2.0 - step))]
    sweep, wall = upright(walls, base_pose(0.2, 0.0, 0.3), np.random.default_rng(1))
    runs = straight_runs(sweep, CONFIG)
    for start, stop in zip(runs.start, runs.stop, strict=True):
        count = np.bincount(wall[start:stop], minlength=2)
        assert count.min() <= 0.03 * count.sum() + 1


def test_noise_is_told_by_the_sweep_itself():
    walls = [((-3.0, -2.0), (3.0, -2.0)), ((-3.0, 2.0), (3.0, 2.0))]
    for noise in (0.004, 0.01, 0.015):
        sweep, _ = upright(walls, base_pose(0.0, 0.0, 0.0), np.random.default_rng(2), noise)
        runs = straight_runs(sweep, CONFIG)
        assert runs.noise == pytest.approx(noise, rel=0.2)
        assert runs.count.sum() > 0.9 * len(sweep)


def test_a_curved_wall_is_runs_that_follow_it():
    """The chords of a column of 1.5 m radius, each a stretch that a line explains."""
    angles = np.linspace(0.0, np.pi, 61)
    rim = np.column_stack([1.5 * np.cos(angles), -2.0 + 1.5 * np.sin(angles) - 2.0])
    walls = [(tuple(a), tuple(b)) for a, b in itertools.pairwise(rim)]
    sweep, _ = upright(walls, base_pose(0.0, 0.0, 0.0), np.random.default_rng(3))
    runs = straight_runs(sweep, CONFIG)
    lines = Lines(runs.moments)
    assert len(runs) > 16
    assert np.sqrt(lines.residual / lines.weight).max() < 3.0 * runs.noise
