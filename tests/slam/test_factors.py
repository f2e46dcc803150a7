import gtsam
import numpy as np
import pytest

from slam.charts import Chart, Charts
from slam.core import PlaneObservation, pose, so3_exp, transform_plane
from slam.factors import (
    huber,
    parallel_factor,
    perpendicular_factor,
    plumb_factor,
    room_factor,
    sighting,
    thickness_factor,
    wall_factor,
)

POSE, ROOM, PLANES, THICKNESS = 0, 1, (10, 11, 12, 13), 20


def observation(normal, d, centroid):
    return PlaneObservation(
        np.asarray(normal, float),
        d,
        np.asarray(centroid, float),
        np.eye(3) * 0.01,
        np.zeros((0, 3)),
        np.zeros(0, dtype=np.int64),
    )


def numeric_jacobian(factor, values, key, dimension, step=1e-6):
    columns = []
    for axis in range(dimension):
        ends = []
        for sign in (1.0, -1.0):
            delta = gtsam.VectorValues()
            for k in list(factor.keys()):
                size = dimension if k == key else values_dimension(values, k)
                v = np.zeros(size)
                if k == key:
                    v[axis] = sign * step
                delta.insert(k, v)
            ends.append(factor.unwhitenedError(values.retract(delta)))
        columns.append((ends[0] - ends[1]) / (2 * step))
    return np.stack(columns, axis=1)


def values_dimension(values, key):
    if key == POSE:
        return 6
    if key == THICKNESS:
        return 1
    return 3 if key in PLANES or key == 2 else 2


def check_jacobians(factor, values):
    jacobians, _ = factor.linearize(values).jacobian()  # whitened by the noise model
    whiten = factor.noiseModel().R()
    column = 0
    for key in list(factor.keys()):
        dimension = values_dimension(values, key)
        numeric = whiten @ numeric_jacobian(factor, values, key, dimension)
        assert jacobians[:, column : column + dimension] == pytest.approx(numeric, abs=1e-5)
        column += dimension


def add_plane(values, key, normal, d, rng=None):
    """A plane variable in a chart that is not quite its own; returns its key and chart."""
    rng = rng or np.random.default_rng(key)
    normal = np.asarray(normal, float)
    near = normal + rng.normal(0.0, 0.05, 3)
    chart = Chart.at(rng.normal(size=3), near / np.linalg.norm(near))
    values.insert(key, chart.coordinates(normal, d))
    return key, chart


def random_direction(rng):
    n = rng.normal(size=3)
    return n / np.linalg.norm(n)


def seen(*observations):
    """Rows and roots of the information of what keyframes observed."""
    whiten = np.linalg.cholesky(np.linalg.inv([o.covariance for o in observations]))
    return np.array([o.rows for o in observations]), whiten.transpose(0, 2, 1)


def moved(T, step):
    """A pose, (rotation, translation) on its right."""
    return T @ pose(so3_exp(step[:3]), step[3:])


@pytest.mark.parametrize("seed", range(5))
def test_sighting_jacobians(seed):
    """Of three observations by as many keyframes."""
    rng = np.random.default_rng(seed)
    T = np.array([pose(so3_exp(rng.normal(size=3)), rng.normal(size=3)) for _ in range(3)])
    rows, whiten = seen(
        observation([0, 1, 0], -2.0, [0.3, 2.0, 0.4]),
        observation([1, 0, 0], -3.0, [3.0, 0.5, 0.2]),
        observation([0, 1, 0], -2.1, [1.3, 2.1, 0.4]),
    )
    charts = Charts.of([Chart.at(rng.normal(size=3), random_direction(rng)) for _ in range(3)])
    x = rng.normal(0.0, 0.3, (3, 3))
    _, by_pose, by_plane = sighting(T, rows, whiten, charts, x)
    for axis, step in enumerate(1e-6 * np.eye(6)):
        ends = [
            sighting(np.array([moved(each, sign * step) for each in T]), rows, whiten, charts, x)[0]
            for sign in (1.0, -1.0)
        ]
        assert by_pose[:, :, axis] == pytest.approx((ends[0] - ends[1]) / 2e-6, abs=1e-5)
    for axis, step in enumerate(1e-6 * np.eye(3)):
        ends = [sighting(T, rows, whiten, charts, x + sign * step)[0] for sign in (1.0, -1.0)]
        assert by_plane[:, :, axis] == pytest.approx((ends[0] - ends[1]) / 2e-6, abs=1e-5)


def off_by(shift):
    """The errors of an observation whose plane is so far off [m], and of one that fits."""
    T = pose(so3_exp(np.array([0.01, -0.02, 1.0])), np.array([2.0, 1.0, 0.0]))
    charts, x, observations = [], [], []
    for direction, far in (([0.0, 1.0, 0.0], shift), ([1.0, 0, 0], 0.0)):
        observations.append(observation(direction, 2.0, [-2.0, -2.0, 0.3]))
        normal, d = transform_plane(T, observations[-1].normal, observations[-1].d)
        charts.append(Chart.at(np.array([0.3, 0.2, 0.1]), normal))
        x.append(charts[-1].coordinates(normal, d + far))
    error, *_ = sighting(np.array([T, T]), *seen(*observations), Charts.of(charts), np.array(x))
    return error


def test_sightings_are_off_in_standard_deviations_and_zero_for_the_true_plane():
    assert off_by(0.05) == pytest.approx(np.array([[0.0, 0.0, 0.5], [0.0, 0.0, 0.0]]), abs=1e-9)


def test_a_sighting_that_is_far_off_counts_less_by_itself():
    assert huber(off_by(0.8), robust=2.0) == pytest.approx([0.25, 1.0])


@pytest.mark.parametrize("seed", range(3))
def test_plumb_walls_hold_the_tilt_and_nothing_else(seed):
    rng = np.random.default_rng(seed)
    up = random_direction(rng)
    T = pose(so3_exp(rng.normal(size=3)), rng.normal(size=3))
    values = gtsam.Values()
    values.insert(POSE, gtsam.Pose3(T))
    noise = gtsam.noiseModel.Isotropic.Sigma(2, 0.01)
    check_jacobians(plumb_factor(POSE, random_direction(rng), up, noise), values)
    factor = plumb_factor(POSE, up @ T[:3, :3], up, noise)
    assert factor.unwhitenedError(values) == pytest.approx([0.0, 0.0], abs=1e-9)
    values.update(POSE, gtsam.Pose3(pose(so3_exp(0.7 * up) @ T[:3, :3], rng.normal(size=3))))
    assert factor.unwhitenedError(values) == pytest.approx([0.0, 0.0], abs=1e-9)
    tilted = T[:3, :3] @ so3_exp(0.02 * np.cross(up @ T[:3, :3], [1.0, 0.0, 0.0]))
    values.update(POSE, gtsam.Pose3(pose(tilted, T[:3, 3])))
    assert np.linalg.norm(factor.unwhitenedError(values)) == pytest.approx(
        0.02 * np.linalg.norm(np.cross(up @ T[:3, :3], [1.0, 0.0, 0.0])), rel=0.01
    )


def box_values(width, depth):
    values = gtsam.Values()
    box = (((1, 0, 0), 0), ((-1, 0, 0), width), ((0, 1, 0), 0), ((0, -1, 0), depth))
    return values, [add_plane(values, key, *plane) for key, plane in zip(PLANES, box, strict=True)]


def test_a_four_plane_room_is_centred_between_its_planes():
    values, planes = box_values(6.0, 4.0)
    values.insert(ROOM, np.array([3.0, 2.0]))
    noise = gtsam.noiseModel.Unit.Create(2)
    point = np.array([2.0, 2.5, 1.0])  # anywhere inside: the planes decide
    factor = room_factor(ROOM, planes, ((0, 1), (2, 3)), point, noise)
    assert factor.unwhitenedError(values) == pytest.approx([0.0, 0.0], abs=1e-12)


def test_a_two_plane_room_keeps_its_place_along_the_corridor():
    values, planes = box_values(6.0, 4.0)
    values.insert(ROOM, np.array([2.0, 2.0]))
    noise = gtsam.noiseModel.Unit.Create(2)
    factor = room_factor(ROOM, planes[2:], ((0, 1),), np.array([2.0, 2.5, 1.0]), noise)
    assert factor.unwhitenedError(values) == pytest.approx([0.0, 0.0], abs=1e-12)


def test_the_room_factor_does_not_break_where_its_middle_plane_meets_the_origin():
    values = gtsam.Values()
    planes = [add_plane(values, PLANES[k], (0, n, 0), 1.0) for k, n in ((0, 1.0), (1, -1.0))]
    values.insert(ROOM, np.array([2.0, 0.0]))
    noise = gtsam.noiseModel.Unit.Create(2)
    factor = room_factor(ROOM, planes, ((0, 1),), np.array([2.0, 0.3, 1.0]), noise)
    assert factor.unwhitenedError(values) == pytest.approx([0.0, 0.0], abs=1e-12)


@pytest.mark.parametrize("seed", range(5))
def test_room_and_wall_jacobians(seed):
    rng = np.random.default_rng(seed)
    values = gtsam.Values()
    planes = []
    for key, n in zip(PLANES, ([1, 0, 0], [-1, 0, 0], [0, 1, 0], [0, -1, 0]), strict=True):
        normal = np.array(n) + rng.normal(0.0, 0.05, 3)
        planes.append(add_plane(values, key, normal / np.linalg.norm(normal), rng.normal(), rng))
    values.insert(ROOM, rng.normal(size=2))
    values.insert(2, rng.normal(size=3))
    point = rng.normal(size=3)
    room = room_factor(
        ROOM, planes, ((0, 1), (2, 3)), point, gtsam.noiseModel.Isotropic.Sigma(2, 0.3)
    )
    check_jacobians(room, values)
    check_jacobians(wall_factor(2, planes[:2], point, gtsam.noiseModel.Unit.Create(3)), values)


@pytest.mark.parametrize("seed", range(5))
@pytest.mark.parametrize("same", [True, False])
def test_relation_jacobians(seed, same):
    rng = np.random.default_rng(seed)
    values = gtsam.Values()
    first, second = (
        add_plane(values, key, random_direction(rng), rng.normal(), rng) for key in PLANES[:2]
    )
    values.insert(THICKNESS, 0.1)
    axes = rng.normal(size=(2, 3))
    one, two = (gtsam.noiseModel.Isotropic.Sigma(size, 0.4) for size in (1, 2))
    check_jacobians(parallel_factor(first, second, axes, same, two), values)
    check_jacobians(perpendicular_factor(first, second, one), values)
    point = rng.normal(size=3)
    check_jacobians(thickness_factor(first, second, THICKNESS, point, one), values)


def test_relations_are_zero_where_they_hold_and_metric_beside_it():
    values = gtsam.Values()
    east = add_plane(values, PLANES[0], (1, 0, 0), -0.1)
    west = add_plane(values, PLANES[1], (-1, 0, 0), 0.0)
    north = add_plane(values, PLANES[2], (0, np.cos(0.01), np.sin(0.01)), 0.0)
    leaning = add_plane(values, PLANES[3], (np.cos(0.02), np.sin(0.02), 0), 0.0)
    values.insert(THICKNESS, 0.09)
    one, two = (gtsam.noiseModel.Unit.Create(size) for size in (1, 2))
    axes = np.array([[0.0, 1.0, 0.0], [0.0, 0.0, 1.0]])
    assert parallel_factor(east, west, axes, False, two).unwhitenedError(values) == pytest.approx(
        [0.0, 0.0], abs=1e-9
    )
    assert parallel_factor(leaning, east, axes, True, two).unwhitenedError(values) == pytest.approx(
        [0.02, 0.0], abs=1e-5
    )
    assert perpendicular_factor(east, north, one).unwhitenedError(values) == pytest.approx(
        [0.0], abs=1e-9
    )
    assert perpendicular_factor(leaning, north, one).unwhitenedError(values) == pytest.approx(
        [0.02], abs=1e-5
    )
    point = np.array([0.05, 1.0, 1.0])
    error = thickness_factor(east, west, THICKNESS, point, one).unwhitenedError(values)
    assert error == pytest.approx([0.01], abs=1e-9)
