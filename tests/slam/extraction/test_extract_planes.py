from itertools import pairwise

import numpy as np
import pytest
from synthetic import base_pose, box_planes, in_base, scan_box, scan_walls

from slam.core import inverse, plane_axes, transform_plane
from slam.extraction import ExtractionConfig, extract_planes

BOX = box_planes(6.0, 4.0, 2.7)


def extract(T_world_base, rng=None):
    scan = scan_box(BOX, T_world_base, rng)
    return extract_planes(in_base(scan), scan.ring, scan.T_base_lidar[:3, 3], ExtractionConfig())


def residuals(observation, T_world_base):
    """Directions along both tangents [rad] and distance [m] of the true plane nearest in normal."""
    normal, _ = transform_plane(T_world_base, observation.normal, observation.d)
    true = max(BOX, key=lambda plane: plane[0] @ normal)
    n, d = transform_plane(inverse(T_world_base), *true)
    first, second = plane_axes(observation.normal)
    return np.array([first @ n, second @ n, n @ observation.centroid + d])


def test_a_perfect_scan_gives_the_exact_planes():
    T = base_pose(2.5, 1.5, 0.4)
    observations = extract(T)
    assert len(observations) == 5  # four walls and the floor: +15 degrees do not reach the ceiling
    for observation in observations:
        assert np.abs(residuals(observation, T)) == pytest.approx(np.zeros(3), abs=2e-3)
        assert observation.normal @ (np.array([0.0, 0.0, 0.5]) - observation.centroid) > 0.0
        assert observation.normal @ observation.centroid + observation.d == pytest.approx(0.0)


def test_errors_are_small_and_no_larger_than_the_covariances_say():
    rng = np.random.default_rng(3)
    errors, chi2 = [], []
    for _ in range(12):
        tilt = tuple(rng.normal(0.0, 0.005, 2))
        T = base_pose(rng.uniform(1, 5), rng.uniform(1, 3), rng.uniform(-3, 3), tilt)
        for observation in extract(T, rng):
            e = residuals(observation, T)
            errors.append(e)
            chi2.append(e @ np.linalg.solve(observation.covariance, e))
    rms = np.sqrt(np.mean(np.square(errors), axis=0))
    assert np.degrees(rms[0]) < 0.04
    assert np.degrees(rms[1]) < 0.15
    assert rms[2] < 0.004
    assert np.mean(chi2) < 4.5  # three degrees of freedom


def test_points_are_named_by_their_place_in_the_scan():
    scan = scan_box(BOX, base_pose(3.0, 2.0, 1.0), np.random.default_rng(0))
    points = in_base(scan)
    for observation in extract_planes(points, scan.ring, np.array([0, 0, 0.5]), ExtractionConfig()):
        assert np.array_equal(points[observation.point_index], observation.points)
        off = observation.points @ observation.normal + observation.d
        assert np.abs(off).max() < 0.09


def test_the_order_of_the_points_does_not_matter():
    scan = scan_box(BOX, base_pose(3.0, 2.0, 1.0), np.random.default_rng(0))
    points, origin = in_base(scan), np.array([0.0, 0.0, 0.5])
    shuffle = np.random.default_rng(1).permutation(len(points))
    one = extract_planes(points, scan.ring, origin, ExtractionConfig())
    two = extract_planes(points[shuffle], scan.ring[shuffle], origin, ExtractionConfig())
    assert len(one) == len(two)
    for a, b in zip(one, two, strict=True):
        assert np.allclose(np.append(a.normal, a.d), np.append(b.normal, b.d), atol=1e-9)


@pytest.mark.parametrize("count", [0, 1, 5])
def test_too_few_points_give_no_plane(count):
    points = np.ones((count, 3))
    ring = np.zeros(count, dtype=np.int16)
    assert extract_planes(points, ring, np.zeros(3), ExtractionConfig()) == ()


def test_points_that_are_not_numbers_are_left_out():
    scan = scan_box(BOX, base_pose(3.0, 2.0, 1.0))
    points = in_base(scan)
    points[::7] = np.nan
    observations = extract_planes(points, scan.ring, np.array([0, 0, 0.5]), ExtractionConfig())
    assert len(observations) == 5
    assert all(np.isfinite(observation.covariance).all() for observation in observations)


def test_noise_without_structure_gives_no_wall():
    rng = np.random.default_rng(0)
    points = rng.uniform(-5.0, 5.0, (4000, 3))
    ring = rng.integers(0, 16, 4000).astype(np.int16)
    observations = extract_planes(points, ring, np.zeros(3), ExtractionConfig())
    assert [o for o in observations if abs(o.normal[2]) < 0.7] == []


ROOM = [((-4.0, 3.0), (4.0, 3.0)), ((-4.0, 3.0), (-4.0, -2.5)), ((4.0, 3.0), (4.0, -2.5))]
BEHIND = ((-9.0, -6.0), (9.0, -6.0))


@pytest.mark.parametrize("step", [0.05, 0.07, 0.10, 0.15])
@pytest.mark.parametrize("hole", [0.0, 1.0])
@pytest.mark.parametrize("seed", range(4))
def test_two_walls_one_a_little_behind_the_other_are_two_planes(step, hole, seed):
    """Side by side, or with a doorway between them: never one plane that slants across both."""
    rng = np.random.default_rng(seed)
    near = ((-4.0, -2.0), (-0.5 * hole, -2.0))
    far = ((0.5 * hole, -2.0 - step), (4.0, -2.0 - step))
    T = base_pose(rng.uniform(-2.0, 2.0), rng.uniform(-0.5, 1.5), rng.uniform(-3.0, 3.0))
    scan, wall = scan_walls([near, far, *ROOM, BEHIND], T, rng)
    origin = scan.T_base_lidar[:3, 3]
    found = extract_planes(in_base(scan), scan.ring, origin, ExtractionConfig())
    seen = set()
    for plane in found:
        counts = np.bincount(wall[plane.point_index] + 1, minlength=6)
        assert counts.max() > 0.95 * counts.sum()
        true = int(counts.argmax()) - 1
        if true in (0, 1):
            normal, d = transform_plane(T, plane.normal, plane.d)
            assert np.degrees(np.arctan2(*normal[:2])) == pytest.approx(0.0, abs=0.4)
            assert d == pytest.approx(2.0 + step * true, abs=0.012)
            assert true not in seen
            seen.add(true)
    assert seen == {0, 1}


def test_a_wall_over_another_is_two_planes():
    """The lower beams meet a wall, the upper ones over it another one, a little behind."""
    T = base_pose(0.0, 1.0, 0.3)
    south = ((-4.0, -2.0), (4.0, -2.0)), ((-4.0, -2.1), (4.0, -2.1))
    scans = [scan_walls([wall, *ROOM], T, np.random.default_rng(5)) for wall in south]
    upper = scans[0][0].ring > 8
    points = np.where(upper[:, None], in_base(scans[1][0]), in_base(scans[0][0]))
    found = extract_planes(points, scans[0][0].ring, np.array([0, 0, 0.5]), ExtractionConfig())
    distances = []
    for plane in found:
        normal, d = transform_plane(T, plane.normal, plane.d)
        if normal[1] > 0.9:
            assert abs(np.degrees(normal[2])) < 1.0
            distances.append(d)
    assert sorted(distances) == pytest.approx([2.0, 2.1], abs=0.02)


def test_one_wall_of_many_bodies_is_one_plane():
    """Built a centimetre out of line, and turned by a fraction of a degree."""
    rng = np.random.default_rng(0)
    ends = np.linspace(-4.0, 4.0, 5)
    off = rng.normal(-2.0, 0.005, (4, 2))
    bodies = [((a, y), (b, z)) for a, b, (y, z) in zip(ends[:-1], ends[1:], off, strict=True)]
    scan, wall = scan_walls([*bodies, *ROOM], base_pose(1.0, 1.0, 0.5), rng)
    origin = scan.T_base_lidar[:3, 3]
    found = extract_planes(in_base(scan), scan.ring, origin, ExtractionConfig())
    assert sum(np.isin(wall[plane.point_index], range(4)).mean() > 0.5 for plane in found) == 1


@pytest.mark.parametrize("depth", [0.05, 0.08])
def test_pilasters_and_the_wall_behind_them_are_two_planes(depth):
    """By turns along the wall, none of either longer than a metre."""
    rng = np.random.default_rng(1)
    bounds = np.arange(-4.0, 4.1, 0.8)
    walls = [
        ((a, -2.0 - depth * (k % 2)), (b, -2.0 - depth * (k % 2)))
        for k, (a, b) in enumerate(pairwise(bounds.tolist()))
    ]
    T = base_pose(0.5, 0.5, 0.4)
    scan, wall = scan_walls([*walls, *ROOM], T, rng)
    origin = scan.T_base_lidar[:3, 3]
    found = extract_planes(in_base(scan), scan.ring, origin, ExtractionConfig())
    distances = []
    for plane in found:
        of = wall[plane.point_index]
        south = (of >= 0) & (of < len(walls))
        if south.mean() > 0.5:
            back = (of[south] % 2 == 1).mean()
            assert max(back, 1.0 - back) > 0.95
            assert abs(np.degrees(plane.normal[2])) < 0.5
            distances.append(transform_plane(T, plane.normal, plane.d)[1])
    assert min(distances) == pytest.approx(2.0, abs=0.012)
    assert max(distances) == pytest.approx(2.0 + depth, abs=0.012)


def test_a_shallow_recess_does_not_make_the_wall_lean():
    """Two centimetres, too little to be another wall: where it is near, beams meet it lower than
    where the wall is far."""
    for seed in range(3):
        rng = np.random.default_rng(seed)
        bounds, ys = [(-7.0, -1.0), (-1.0, 1.0), (1.0, 7.0)], (-2.0, -2.02, -2.0)
        walls = [((a, y), (b, y)) for (a, b), y in zip(bounds, ys, strict=True)]
        scan, wall = scan_walls([*walls, *ROOM[:1]], base_pose(0.0, 1.0, 0.3), rng)
        origin = scan.T_base_lidar[:3, 3]
        found = extract_planes(in_base(scan), scan.ring, origin, ExtractionConfig())
        south = [
            plane for plane in found if np.isin(wall[plane.point_index], range(3)).mean() > 0.5
        ]
        longest = max(south, key=lambda plane: len(plane.points))
        assert abs(np.degrees(longest.normal[2])) < 0.4
