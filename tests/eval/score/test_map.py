"""Distances of map points, against numbers worked out by hand."""

from __future__ import annotations

import numpy as np
import pytest

from eval.score.map import MapCloud, SurfaceDistance, face_distances, map_cloud, score_map
from slam.core import MapPlane, pose, so3_exp, transform_points
from worlds.truth import CLUTTER, FLOOR, NO_FACE


@pytest.fixture(scope="module")
def surface(house) -> SurfaceDistance:
    """The house's faces and its floor as triangles."""
    return SurfaceDistance(*mesh(house))


def mesh(house):
    corners, triangles, labels = [], [], []
    quads = [
        np.array([[*f.segment[i], z] for i, z in ((0, 0), (1, 0), (1, 2.5), (0, 2.5))], float)
        for f in house.truth.faces
    ]
    quads.append(np.array([[-1, -1, 0], [10, -1, 0], [10, 6, 0], [-1, 6, 0]], float))
    for i, quad in enumerate(quads):
        corners.append(quad)
        labels += [i if i < 12 else FLOOR] * 2
        triangles += [[4 * i, 4 * i + 1, 4 * i + 2], [4 * i, 4 * i + 2, 4 * i + 3]]
    return np.concatenate(corners), np.array(triangles), np.array(labels)


def test_distance_to_the_mesh(surface) -> None:
    points = np.array([[2.0, 1.5, 0.3], [3.9, 1.5, 1.0], [4.05, 1.5, 1.0], [-2.0, 0.0, 0.0]])
    assert surface(points) == pytest.approx([0.3, 0.1, 0.05, 1.0], abs=1e-5)


def test_distance_far_from_the_origin(house) -> None:
    """Float32 has steps of 0.03 mm at 500 m; the mesh is brought to the origin first."""
    vertices, *rest = mesh(house)
    away = np.array([4000.0, -3000.0, 0.0])
    far = SurfaceDistance(vertices + away, *rest)
    assert far(np.array([[3.9, 1.5, 1.0]]) + away) == pytest.approx([0.1], abs=1e-5)


def test_distances_to_what_was_hit(surface) -> None:
    """Across 3 cm; 3 cm across and 4 cm beyond an end: 5; above the top; below the floor."""
    labels = np.array([1, 1, 1, FLOOR, NO_FACE, CLUTTER], np.int32)
    points = np.array(
        [
            [3.97, 1.0, 1.0],
            [4.03, 3.04, 1.0],
            [4.0, 1.0, 2.6],
            [1.0, 1.0, -0.02],
            [1.0, 1.0, 1.0],
            [1.0, 1.0, 1.0],
        ]
    )
    expected = [0.02, 0.03, 0.05, 0.1]
    assert face_distances(points, labels, surface) == pytest.approx(expected, abs=1e-5)


def test_a_shift_hides_from_the_nearest_surface_but_not_from_the_face(surface) -> None:
    """A's east face (x = 4) drawn 9 cm off, 1 cm from B's west face (x = 4.1): 1 cm against 9."""
    ys = np.linspace(0.5, 2.5, 20)
    true = np.column_stack([np.full(20, 4.0), ys, np.full(20, 1.2)])
    cloud = MapCloud(true + np.array([0.09, 0.0, 0.0]), np.zeros(20, int), np.arange(20))
    result = score_map(cloud, np.ones(20, np.int32), true, surface, np.eye(4))
    assert result.mma == pytest.approx(0.01, abs=1e-5)
    assert result.mma_face == pytest.approx(0.09, abs=1e-5)
    assert result.mma_floor == pytest.approx(0.0, abs=1e-5)


def test_the_floor_is_the_sensor_s_own_error(surface) -> None:
    """Half of the returns 2 cm short at true poses: 2 / sqrt 2, whatever the map made of them."""
    true = np.column_stack([np.full(20, 4.0), np.linspace(0.5, 2.5, 20), np.full(20, 1.2)])
    true[::2, 0] -= 0.02
    cloud = MapCloud(true + np.array([0.5, 0.0, 0.0]), np.zeros(20, int), np.arange(20))
    result = score_map(cloud, np.ones(20, np.int32), true, surface, None)
    assert result.mma_floor == pytest.approx(0.02 / np.sqrt(2), abs=1e-5)
    assert (result.mma, result.mma_face) == (None, None)


def test_a_rigid_motion_changes_nothing(surface) -> None:
    rng = np.random.default_rng(0)
    true = np.column_stack([np.full(50, 4.0), rng.uniform(0, 3, 50), rng.uniform(0, 2.5, 50)])
    points = true + rng.normal(0, 0.02, (50, 3))
    labels = np.ones(50, np.int32)
    T = pose(so3_exp(rng.normal(0, 1, 3)), rng.normal(0, 20, 3))
    results = [
        score_map(MapCloud(p, np.zeros(50, int), np.arange(50)), labels, true, surface, M)
        for p, M in ((points, np.eye(4)), (transform_points(np.linalg.inv(T), points), T))
    ]
    assert results[0].mma == pytest.approx(results[1].mma, abs=1e-5)
    assert results[0].mma_face == pytest.approx(results[1].mma_face, abs=1e-5)


def test_an_empty_map(surface) -> None:
    empty = map_cloud([])
    assert empty.points.shape == (0, 3)
    result = score_map(empty, np.empty(0, np.int32), empty.points, surface, np.eye(4))
    assert (result.mma, result.mma_face, result.mma_floor) == (None, None, None)


def plane(id: int, points: np.ndarray, ids: np.ndarray) -> MapPlane:
    return MapPlane(id, np.array([1.0, 0, 0]), 0.0, points, ids, np.array([0]))


def test_one_point_per_voxel_and_plane() -> None:
    points = np.array([[0.01, 0.01, 0.01], [0.04, 0.04, 0.04], [0.06, 0.01, 0.01], [-0.01, 0, 0]])
    cloud = map_cloud(
        [plane(5, points, np.array([9, 4, 7, 8])), plane(2, points[:1], np.array([3]))]
    )
    assert cloud.plane_id.tolist() == [2, 5, 5, 5]
    assert cloud.point_ids.tolist() == [3, 4, 7, 8]
    assert np.array_equal(cloud.points, points[[0, 1, 2, 3]])


def test_the_cloud_does_not_depend_on_the_order_of_planes() -> None:
    rng = np.random.default_rng(1)
    planes = [plane(i, rng.uniform(0, 1, (500, 3)), 500 * i + np.arange(500)) for i in range(3)]
    first, second = map_cloud(planes), map_cloud(planes[::-1])
    assert np.array_equal(first.points, second.points)
    assert np.array_equal(first.point_ids, second.point_ids)
