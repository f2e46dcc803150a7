import numpy as np
import pytest
from synthetic import base_pose, in_base, scan_walls

from slam.core import transform_points
from slam.extraction.config import ExtractionConfig
from slam.extraction.moments import Lines
from slam.extraction.offsets import beam_offsets
from slam.extraction.runs import straight_runs
from slam.extraction.sweep import Sweep

CONFIG = ExtractionConfig()
ROOM = [
    ((-3.0, -2.0), (4.0, -2.0)),
    ((4.0, -2.0), (4.0, 3.0)),
    ((4.0, 3.0), (-3.0, 3.0)),
    ((-3.0, 3.0), (-3.0, -2.0)),
]


def sweep_of(walls, T, offsets, rng):
    """A sweep without its floor; the beams are off by offsets (16,)."""
    scan, wall = scan_walls(walls, T)
    rays = scan.points / np.linalg.norm(scan.points, axis=1, keepdims=True)
    error = offsets[scan.ring] + rng.normal(0.0, 0.0066, len(scan))
    points = in_base(scan) + np.where(wall >= 0, error, np.nan)[:, None] * rays
    return Sweep.of(points, scan.ring, scan.T_base_lidar[:3, 3], CONFIG.max_range)


def assert_found(found, offsets):
    """As far as it can be known: the lowest beams hardly meet a wall."""
    known = found.sigma < 0.004
    assert known[4:].all()
    error = (found.range - offsets)[known]
    assert np.abs(error - error.mean()).max() < 0.004
    chi2 = ((found.range - offsets - np.mean(error)) / found.sigma) ** 2
    assert chi2.mean() < 3.0


@pytest.mark.parametrize("seed", range(3))
def test_what_beams_are_off_against_each_other_is_found(seed):
    rng = np.random.default_rng(seed)
    offsets = rng.normal(0.0, 0.012, 16)
    sweep = sweep_of(ROOM, base_pose(0.5, 0.3, 0.4), offsets, rng)
    found = beam_offsets(straight_runs(sweep, CONFIG), 16, CONFIG)
    assert_found(found, offsets)
    assert np.abs(found.tilt).max() < np.radians(0.15)


def test_the_base_s_tilt_is_found_and_not_taken_for_offsets():
    rng = np.random.default_rng(4)
    tilt = np.radians([1.0, -2.0])
    level = sweep_of(ROOM, base_pose(0.5, 0.3, 0.4), np.zeros(16), rng)
    T = base_pose(0.0, 0.0, 0.0, tuple(tilt))
    tilted = Sweep.of(
        transform_points(np.linalg.inv(T), level.xyz), level.ring, np.array([0.0, 0.0, 0.5]), 25.0
    )
    found = beam_offsets(straight_runs(tilted, CONFIG), 16, CONFIG)
    plumb = np.linalg.inv(T)[:3, 2]
    assert found.tilt == pytest.approx(plumb[:2] / plumb[2], abs=np.radians(0.2))
    assert np.abs(found.range - found.range.mean()).max() < 0.005


def test_walls_a_little_behind_others_do_not_count():
    rng = np.random.default_rng(5)
    offsets = rng.normal(0.0, 0.012, 16)
    pilasters = [((x, -1.95), (x + 0.5, -1.95)) for x in (-2.0, 0.0, 2.0)]
    sweep = sweep_of([*ROOM, *pilasters], base_pose(0.5, 0.3, 0.4), offsets, rng)
    found = beam_offsets(straight_runs(sweep, CONFIG), 16, CONFIG)
    assert_found(found, offsets)


def test_runs_without_their_offsets_lie_on_their_wall():
    rng = np.random.default_rng(6)
    sweep = sweep_of(ROOM, base_pose(0.5, 0.3, 0.0), rng.normal(0.0, 0.012, 16), rng)
    runs = straight_runs(sweep, CONFIG)
    found = beam_offsets(runs, 16, CONFIG)
    before, after = Lines(runs.moments), Lines(found.taken_off(runs).moments)
    south = (before.mean[:, 1] < -2.0) & (np.abs(before.mean[:, 0]) < 2.0)
    assert np.ptp(after.mean[south, 1]) < 0.3 * np.ptp(before.mean[south, 1])
    # The same, return by return.
    first = int(runs.start[south][0])
    ray = sweep.xyz[first] - sweep.origin
    moved = found.exact(sweep, np.array([first]))[0] - sweep.xyz[first]
    expected = -found.range[sweep.ring[first]] * ray / np.linalg.norm(ray)
    assert moved == pytest.approx(expected)


def test_a_sweep_without_walls_tells_nothing():
    runs = straight_runs(
        Sweep.of(np.zeros((0, 3)), np.zeros(0, np.int16), np.zeros(3), 25.0), CONFIG
    )
    found = beam_offsets(runs, 16, CONFIG)
    assert not found.range.any()
    assert not found.tilt.any()
