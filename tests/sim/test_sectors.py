"""Rays by sectors against the readable version: every shot from the pose of its own instant."""

import numpy as np
import pytest

from sim.motion import Motion
from sim.sectors import Sectors
from sim.sensorfile import sensor_named
from slam.core import pose, so3_exp


def curve(turning, speed, steps=50, start=(3.0, -2.0, 0.5)):
    """A turn and a tilt while driving: angular and linear velocity are constant between steps."""
    stamps = np.linspace(0.7, 0.8, steps + 1)
    seconds = stamps - stamps[0]
    axis = np.array([0.05, -0.03, 1.0])
    rotations = so3_exp(np.outer(turning * seconds, axis))
    places = np.array(start) + np.outer(speed * seconds, [0.8, 0.6, 0.01])
    return Motion(stamps, np.array([pose(*pair) for pair in zip(rotations, places, strict=True)]))


def one_by_one(sensor, motion, stamp, phase):
    """The oracle."""
    rotations, origins = motion.at((stamp + sensor.shot_times).ravel())
    c, s = np.cos(phase), np.sin(phase)
    heads = sensor.shot_directions.reshape(-1, 3) @ np.array([[c, s, 0], [-s, c, 0], [0, 0, 1.0]])
    return origins, np.einsum("nij,nj->ni", rotations, heads)


@pytest.mark.parametrize("name", ["ideal", "os1-32"])
@pytest.mark.parametrize(("turning", "speed"), [(0.0, 0.0), (1.2, 0.6), (-3.0, 1.5)])
def test_every_shot_starts_at_the_pose_of_its_own_instant(name, turning, speed):
    sensor, motion = sensor_named(name), curve(turning, speed)
    rays = Sectors(sensor).rays(motion, 0.8, phase=-0.002)
    origins, directions = one_by_one(sensor, motion, 0.8, phase=-0.002)
    assert rays[:, :3] == pytest.approx(origins, abs=5e-6)
    assert rays[:, 3:] == pytest.approx(directions, abs=2e-6)


def test_a_motion_goes_through_its_poses_at_constant_rates():
    motion = curve(2.0, 1.0, steps=3)
    rotations, places = motion.at(motion.stamps)
    assert rotations == pytest.approx(motion.poses[:, :3, :3], abs=1e-12)
    assert places == pytest.approx(motion.poses[:, :3, 3], abs=1e-12)
    fine = curve(2.0, 1.0, steps=30)
    rotations, places = motion.at(fine.stamps)
    assert rotations == pytest.approx(fine.poses[:, :3, :3], abs=1e-12)
    assert places == pytest.approx(fine.poses[:, :3, 3], abs=1e-12)
    far = Motion(
        np.array([0.0, 1.0]),
        np.array([np.eye(4), pose(so3_exp(np.array([0, 0, 3.0])), np.zeros(3))]),
    )
    half = far.at(np.array([0.5]))[0][0]
    assert half == pytest.approx(so3_exp(np.array([0.0, 0.0, 1.5])), abs=1e-12)
