from dataclasses import replace

import numpy as np
import pytest
from synthetic import base_pose, box_planes, in_base, scan_box

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
    assert np.degrees(rms[0]) < 0.03
    assert np.degrees(rms[1]) < 0.4
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


@pytest.mark.parametrize("recess", [0.08, 0.10, 0.15])
def test_two_walls_one_a_little_behind_the_other_are_two_planes(recess):
    where = base_pose(4.0, 2.0, 0.0)
    near, far = (
        scan_box(
            [*box_planes(8.0, 5.0, 2.7)[:2], (np.array([0.0, 1.0, 0.0]), depth)],
            where,
            np.random.default_rng(1),
        )
        for depth in (0.0, recess)
    )
    left = near.points[:, 0] < 0.0
    scan = replace(near, points=np.where(left[:, None], near.points, far.points))
    scan = replace(scan, points=np.where(np.isfinite(scan.points), scan.points, np.nan))
    origin = scan.T_base_lidar[:3, 3]
    found = extract_planes(in_base(scan), scan.ring, origin, ExtractionConfig())
    south = [plane for plane in found if plane.normal[1] > 0.9]
    assert sorted(round(float(plane.d), 2) for plane in south) == [2.0, round(2.0 + recess, 2)]
