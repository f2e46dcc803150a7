from dataclasses import replace

import numpy as np
import pytest
from boxworld import single_room

from sim.base import Base, BaseConfig, base_poses
from sim.wheels import GRAVITY, Encoders, WheelConfig, Wheels
from slam.core import InputError, inverse, yaw_of

PERFECT = WheelConfig(
    radius_tolerance=0.0,
    radius_mismatch=0.0,
    track_tolerance=0.0,
    rolling=0.0,
    patches=0.0,
    tread=0.0,
)
STEP = BaseConfig().timestep


def driven(wheels=PERFECT, speed=0.4, turn_rate=0.3, seconds=3.0, seed=0):
    """Truth and odometry, a pose each 0.1 s, of a base that is asked for constant rates."""
    config = BaseConfig(wheels=wheels)
    base = Base(single_room(8.0, 8.0).spec, 0.0, (4.0, 3.0, 0.4), config, _rng(seed))
    encoders = Encoders(wheels, config.timestep)
    coordinates, odometry, counts = [], [], [base.wheels.counts]
    for step in range(round(seconds / config.timestep)):
        ramp = min(step * config.timestep / 0.8, 1.0)
        base.step(ramp * speed, ramp * turn_rate)
        counts.append(base.wheels.counts)
        if step % 20 == 19:
            odometry.append(encoders.read(base.time, np.array(counts[-21:])))
            coordinates.append(base.coordinates)
    start = base_poses(np.array([[4.0, 3.0, 0.4, 0.0, 0.0, 0.0]]), 0.0)[0]
    truth = inverse(start) @ base_poses(np.array(coordinates), 0.0)
    return truth, odometry


def _rng(seed):
    return np.random.default_rng(seed)


def test_perfect_wheels_say_where_the_base_is():
    truth, odometry = driven()
    T = odometry[-1].T_odom_base
    assert truth[-1, :2, 3] == pytest.approx(T[:2, 3], abs=0.012)  # the creep of one run-up
    assert yaw_of(truth[-1]) == pytest.approx(yaw_of(T), abs=0.012)
    assert odometry[-1].stamp == pytest.approx(3.0)
    assert odometry[-1].twist == pytest.approx([0.4, 0, 0, 0, 0, 0.3], abs=0.02)


def test_dead_reckoning_is_an_arc_in_closed_form():
    config = replace(PERFECT, counts=2_000_000)
    speed, turn_rate, n = 0.5, 0.8, 400
    rims = np.array([speed - 0.15 * turn_rate, speed + 0.15 * turn_rate]) * STEP
    counts = np.arange(n + 1)[:, None] * rims * config.counts / (2.0 * np.pi * config.radius)
    T = Encoders(config, STEP).read(2.0, np.floor(counts).astype(np.int64)).T_odom_base
    turned, radius = turn_rate * n * STEP, speed / turn_rate
    expected = [radius * np.sin(turned), radius * (1.0 - np.cos(turned)), 0.0]
    assert T[:3, 3] == pytest.approx(expected, abs=1e-4)
    assert yaw_of(T) == pytest.approx(turned, abs=1e-4)


def test_a_larger_wheel_goes_further_than_the_odometry_believes():
    off = [
        np.linalg.norm(truth[-1, :2, 3]) / np.linalg.norm(odometry[-1].T_odom_base[:2, 3]) - 1.0
        for truth, odometry in (
            driven(replace(PERFECT, radius_tolerance=0.05), turn_rate=0.0, seed=seed)
            for seed in range(3)
        )
    ]
    drawn = [0.05 * float(_rng(seed).standard_normal(7)[0]) for seed in range(3)]
    assert off == pytest.approx(drawn, abs=0.01)


def test_real_wheels_drift_within_what_a_calibrated_base_does():
    off = []
    for seed in range(6):
        truth, odometry = driven(WheelConfig(), seed=seed, seconds=4.0)
        off.append(truth[-1, :2, 3] - odometry[-1].T_odom_base[:2, 3])
    share = np.linalg.norm(off, axis=1) / 1.5
    assert 0.002 < np.sqrt(np.mean(share**2)) < 0.05


def test_the_push_ends_at_the_friction_limit_and_slides():
    config, mass = replace(PERFECT, friction=0.3), 30.0
    wheels = Wheels(config, mass, STEP, _rng(0))
    limit = 0.3 * mass * GRAVITY
    ahead, left, moment = wheels.push(50.0, 0.0, (0.0, 20.0, 0.0))
    assert np.hypot(ahead, left) == pytest.approx(limit, rel=0.02)
    assert ahead > 0.0 > left
    assert moment == pytest.approx(0.0, abs=1e-9)
    gentle = wheels.push(0.001, 0.0, (0.0, 0.0, 0.0))[0]
    assert gentle == pytest.approx(0.001 * mass / config.grip, rel=0.05)


def test_ice_lets_the_wheels_spin():
    ice = replace(PERFECT, friction=0.005)
    truth, odometry = driven(ice, turn_rate=0.0, seconds=2.0)
    went, believed = truth[-1, 0, 3], odometry[-1].T_odom_base[0, 3]
    assert believed == pytest.approx(0.4 * 1.6, abs=0.01)
    assert went < 0.2 * believed
    assert went < 0.5 * 0.005 * GRAVITY * 2.0**2 + 1e-3


def test_a_standing_base_counts_nothing_and_stays():
    truth, odometry = driven(WheelConfig(), speed=0.0, turn_rate=0.0, seconds=1.0)
    assert np.array_equal(odometry[-1].T_odom_base, np.eye(4))
    assert np.abs(truth[-1] - np.eye(4)).max() < 1e-3  # the suspension settles


def test_the_same_seed_is_the_same_unit_on_the_same_floor():
    one, two, other = (driven(WheelConfig(), seed=s, seconds=0.5)[0][-1] for s in (1, 1, 2))
    assert np.array_equal(one, two)
    assert not np.array_equal(one[:2, 3], other[:2, 3])


@pytest.mark.parametrize(
    "change",
    [
        {"track": 0.0},
        {"radius": float("nan")},
        {"counts": 0},
        {"rolling": -0.1},
        {"radius_tolerance": 0.2},
        {"tread": -0.001},
        {"grip": float("inf")},
    ],
)
def test_wheels_that_make_no_sense_are_refused(change):
    with pytest.raises(InputError, match=next(iter(change))):
        WheelConfig(**change)


def test_a_grip_too_stiff_for_the_physics_step_is_refused():
    with pytest.raises(InputError, match=r"wheels\.grip"):
        BaseConfig(wheels=WheelConfig(grip=0.001))
