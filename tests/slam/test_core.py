import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from slam.core import (
    MapPlane,
    PlanePiece,
    interpolate,
    inverse,
    plane_axes,
    point_ids,
    pose,
    quaternion_xyzw,
    rotate,
    rotation_from_quaternion_xyzw,
    so3_exp,
    so3_log,
    thread_limit,
    transform_plane,
    transform_points,
)

angles = st.floats(-3.0, 3.0)
vectors = st.tuples(angles, angles, angles).map(np.array)


def random_pose(rng: np.random.Generator) -> np.ndarray:
    return pose(so3_exp(rng.normal(size=3)), rng.normal(size=3) * 5.0)


@given(vectors)
def test_exp_is_scipys_rotation(v):
    assert np.allclose(so3_exp(v), Rotation.from_rotvec(v).as_matrix(), atol=1e-12)


@given(vectors)
def test_log_is_scipys_rotation_vector(v):
    rotation = Rotation.from_rotvec(v)
    assert np.allclose(so3_exp(so3_log(rotation.as_matrix())), rotation.as_matrix(), atol=1e-9)
    if np.linalg.norm(v) < 3.1:
        assert np.allclose(so3_log(rotation.as_matrix()), v, atol=1e-7)


@given(vectors, vectors)
def test_turning_a_point_is_multiplying_it(v, p):
    fractions = np.array([0.0, 0.3, 1.0])
    turned = rotate(v, fractions, np.tile(p, (3, 1)))
    assert np.allclose(turned, so3_exp(fractions[:, None] * v) @ p, atol=1e-12)
    assert np.allclose(rotate(np.zeros(3), fractions[:1], p[None])[0], p)


@given(vectors)
def test_quaternion_round_trip(v):
    R = so3_exp(v)
    assert np.allclose(rotation_from_quaternion_xyzw(quaternion_xyzw(R)), R, atol=1e-12)
    assert quaternion_xyzw(R)[3] >= 0.0


def test_inverse_undoes():
    T = random_pose(np.random.default_rng(0))
    assert np.allclose(T @ inverse(T), np.eye(4), atol=1e-12)


def test_a_transformed_plane_keeps_its_distances():
    rng = np.random.default_rng(1)
    T_a_b, normal_b, d_b = random_pose(rng), np.array([0.6, 0.0, 0.8]), -1.5
    points_b = rng.normal(size=(20, 3))
    normal_a, d_a = transform_plane(T_a_b, normal_b, d_b)
    points_a = transform_points(T_a_b, points_b)
    assert np.allclose(points_a @ normal_a + d_a, points_b @ normal_b + d_b)


@pytest.mark.parametrize("normal", [[1, 0, 0], [0, -1, 0], [0, 0, 1], [0, 0, -1], [0.6, 0.8, 0]])
def test_plane_axes_are_orthonormal_and_right_handed(normal):
    n = np.array(normal, dtype=float)
    first, second = plane_axes(n)
    frame = np.stack([first, second, n])
    assert np.allclose(frame @ frame.T, np.eye(3))
    assert np.allclose(np.cross(n, first), second)
    if abs(n[2]) < 0.5:
        assert first[2] == 0.0


def test_interpolation_hits_both_ends_and_halves_the_turn():
    start = pose(np.eye(3), np.zeros(3))
    end = pose(so3_exp(np.array([0.0, 0.0, 0.8])), np.array([1.0, 2.0, 0.0]))
    rotations, translations = interpolate(start, end, np.array([0.0, 0.5, 1.0]))
    assert np.allclose(rotations[2], end[:3, :3])
    assert np.allclose(so3_log(rotations[1]), [0, 0, 0.4])
    assert np.allclose(translations, [[0, 0, 0], [0.5, 1, 0], [1, 2, 0]])


def test_a_segment_ignores_a_stray_point():
    along = np.linspace(0.0, 4.0, 400)
    points = np.column_stack([along, np.full(400, 2.0), np.tile([0.2, 1.0], 200)])
    points = np.vstack([points, [60.0, 2.0, 0.5]])
    plane = MapPlane(
        0, np.array([0.0, -1.0, 0.0]), 2.0, points, np.zeros(401, int), np.zeros(1, int)
    )
    ends = np.sort(plane.segment[:, 0])
    assert plane.segment[:, 1] == pytest.approx([2.0, 2.0])
    assert ends == pytest.approx([0.0, 4.0], abs=0.1)


def test_a_piece_owns_the_points_between_its_ends():
    piece = PlanePiece(0, np.array([[1.0, 2.0], [3.0, 2.0]]))
    points = np.array([[0.9, 2.0, 1.0], [1.0, 2.1, 0.0], [2.0, 1.9, 2.0], [3.1, 2.0, 0.0]])
    assert piece.mask(points).tolist() == [False, True, True, False]
    assert piece.length == 2.0


def test_point_ids_name_scan_and_place():
    ids = point_ids(7, np.array([0, 28_799]))
    assert (ids >> 20).tolist() == [7, 7]
    assert (ids & ((1 << 20) - 1)).tolist() == [0, 28_799]


@pytest.mark.parametrize(
    ("said", "most", "threads"),
    [("", 2, 2), ("", 0, 1), ("1", 2, 1), ("4", 2, 2), ("0", 2, 1), ("nonsense", 2, 2)],
)
def test_threads_are_as_many_as_the_environment_allows_and_one_at_least(
    monkeypatch, said, most, threads
):
    monkeypatch.setenv("OMP_NUM_THREADS", said)
    assert thread_limit(most) == threads
