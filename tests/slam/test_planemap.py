"""Association: a wall and the next, opposite faces, what is seen again after drift."""

import numpy as np
import pytest

from slam.alignment import aligned
from slam.backend import BackEnd
from slam.core import (
    Frame,
    KeyframeScan,
    PlaneObservation,
    inverse,
    plane_axes,
    pose,
    so3_exp,
    transform_plane,
    transform_points,
)

Y = np.array([0.0, 1.0, 0.0])
X = np.array([1.0, 0.0, 0.0])
Z = np.array([0.0, 0.0, 1.0])


def patch(normal, place, length=2.0, height=1.0):
    """A wall: its normal, and points of it around a place."""
    first, second = plane_axes(normal)
    a, b = np.meshgrid(np.linspace(-0.5, 0.5, 40) * length, np.linspace(-0.5, 0.5, 12) * height)
    points = np.asarray(place) + a.reshape(-1, 1) * first + b.reshape(-1, 1) * second
    return np.asarray(normal, float), points


def sight(T_map_base, walls, rng=None, sigma=0.004):
    """What a keyframe at a true pose observes of walls."""
    planes, first = [], 0
    for normal, points in walls:
        in_base = transform_points(inverse(T_map_base), points)
        n, _ = transform_plane(inverse(T_map_base), normal, 0.0)
        noise = 0.0 if rng is None else rng.normal(0.0, sigma)
        centroid = in_base.mean(axis=0) + noise * n
        index = np.arange(first, first + len(points))
        covariance = np.diag([0.002**2, 0.004**2, sigma**2])
        planes.append(
            PlaneObservation(n, float(-n @ centroid), centroid, covariance, in_base, index)
        )
        first += len(points)
    return KeyframeScan(tuple(planes), np.zeros((0, 3)), np.zeros(3))


ROOM = [
    patch(Y, [0, -2, 1], 6),
    patch(-Y, [0, 2, 1], 6),
    patch(X, [-3, 0, 1], 4),
    patch(Z, [0, 0, 0]),
]


def at(x, y=0.0, yaw=0.0):
    return pose(so3_exp(np.array([0.0, 0.0, yaw])), np.array([x, y, 0.0]))


def drive(backend, path, walls_of, rng, estimate=lambda k, T: T):
    for k, T in enumerate(path, start=len(backend.stamps())):
        backend.add(Frame(k, 0.5 * k, estimate(k, T), estimate(k, T), sight(T, walls_of(k), rng)))


def test_two_walls_in_line_but_not_on_one_plane_stay_two():
    rng = np.random.default_rng(0)
    step = patch(Y, [4.5, -2.035, 1], 3.0)
    backend = BackEnd()
    drive(backend, [at(0.3 * k) for k in range(12)], lambda k: [*ROOM, step], rng)
    assert len(backend.view().planes) == 5


def test_two_stretches_of_one_wall_are_one_plane():
    rng = np.random.default_rng(0)
    behind_a_door = patch(Y, [4.9, -2.0, 1], 2.0)
    backend = BackEnd()
    drive(backend, [at(0.3 * k) for k in range(12)], lambda k: [*ROOM, behind_a_door], rng)
    assert len(backend.view().planes) == 4


@pytest.mark.parametrize("thickness", [0.0, 0.06, 0.2])
def test_opposite_faces_are_never_one(thickness):
    rng = np.random.default_rng(1)
    face, back = patch(Y, [0, -2, 1]), patch(-Y, [0, -2 - thickness, 1])
    backend = BackEnd()
    drive(backend, [at(0.3 * k) for k in range(8)], lambda k: [*ROOM[1:], face, back], rng)
    normals = [plane.normal for plane in backend.view().planes]
    assert len(normals) == 5


def test_a_place_is_recognised_after_drift():
    """Away and back, with odometry that has gone wrong by a hand's breadth and a degree."""
    rng = np.random.default_rng(2)
    far = [patch(Y, [20, -2, 1], 8), patch(-X, [24, 0, 1], 4), patch(Z, [20, 0, 0])]
    out = [at(0.5 * k) for k in range(6)]
    away = [at(18.0 + 0.5 * k) for k in range(6)]
    drift = pose(so3_exp(np.array([0.0, 0.0, np.radians(1.0)])), np.array([0.05, 0.04, 0.0]))
    backend = BackEnd()
    drive(backend, out, lambda k: ROOM, rng)
    drive(backend, away, lambda k: far, rng)
    before = len(backend.view().planes)
    drive(backend, out[::-1], lambda k: ROOM, rng, lambda k, T: drift @ T)
    assert len(backend.view().planes) == before
    error = backend.latest()[:3, 3] - out[0][:3, 3]
    assert np.abs(error).max() < 0.02


def test_alignment_finds_the_pose_and_shrugs_off_one_wrong_plane():
    T = at(1.0, 0.5, 0.3)
    guess = T @ pose(so3_exp(np.array([0.002, -0.002, 0.008])), np.array([0.02, -0.03, 0.01]))
    niche = patch(-X, [4, 1, 1], 2)
    scan = sight(T, [*ROOM, niche, patch(-X, [3, 0, 1], 4)])
    walls = [*ROOM, niche, patch(-X, [3.05, 0, 1], 4)]  # five centimetres off
    sights = [
        (observation, normal, float(-normal @ points[0]), observation.covariance)
        for observation, (normal, points) in zip(scan.planes, walls, strict=True)
    ]
    assert np.abs(aligned(guess, sights) - T).max() < 0.008


def test_a_plane_seen_once_and_hardly_is_forgotten():
    rng = np.random.default_rng(3)
    edge = (X, patch(X, [2.0, 0.5, 0.5], 0.3, 0.3)[1][::6])
    backend = BackEnd()
    drive(
        backend, [at(0.3 * k) for k in range(14)], lambda k: [*ROOM, edge] if k == 2 else ROOM, rng
    )
    assert len(backend.view().planes) == 4
    assert len(backend.graph().estimates.normals) == 5


@pytest.mark.parametrize("fault", ["nan normal", "zero normal", "nan d", "no points", "covariance"])
def test_what_is_no_plane_is_left_out(fault):
    from dataclasses import replace

    rng = np.random.default_rng(4)
    broken = {
        "nan normal": {"normal": np.full(3, np.nan)},
        "zero normal": {"normal": np.zeros(3)},
        "nan d": {"d": float("nan")},
        "no points": {"points": np.zeros((0, 3)), "point_index": np.zeros(0, np.int64)},
        "covariance": {"covariance": np.zeros((3, 3))},
    }[fault]
    backend = BackEnd()
    for k in range(4):
        scan = sight(at(0.3 * k), ROOM, rng)
        planes = (replace(scan.planes[0], **broken), *scan.planes[1:])
        backend.add(Frame(k, 0.5 * k, at(0.3 * k), at(0.3 * k), replace(scan, planes=planes)))
    assert len(backend.view().planes) == 3
    assert np.isfinite(backend.trajectory()).all()


def test_what_only_the_last_keyframe_saw_is_kept():
    """Nobody had the chance to see it again; what an earlier one saw once, the others had."""
    normal, points = patch(Y, [0, -2, 1], 0.8, 0.3)
    little = normal, points[::10]
    for seen_at, kept in ((0, 4), (11, 5)):
        backend = BackEnd()
        walls = [patch(Y, [0, -3, 1], 6), *ROOM[1:]]
        extra = [[*walls, little] if k == seen_at else walls for k in range(12)]
        drive(backend, [at(0.1 * k) for k in range(12)], extra.__getitem__, None)
        backend.finish()
        assert len(backend.view().planes) == kept


def test_a_plane_seen_once_beside_one_that_was_seen_often_is_its_shadow():
    """As of a sweep whose motion was wrong. One that stands off by more is a plane of its own."""
    for off, planes in ((0.08, 4), (0.20, 5)):
        wall, strange = patch(Y, [0, -2, 1], 6), patch(Y, [0, off - 2, 1], 4)
        backend = BackEnd()
        seen = [[*ROOM[1:], strange if k == 5 else wall] for k in range(16)]
        drive(backend, [at(0.3 * k - 2.4) for k in range(16)], seen.__getitem__, None)
        assert len(backend.view().planes) == planes
