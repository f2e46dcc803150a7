"""Where a run's scans come from."""

import itertools

import numpy as np

from eval.config import RunConfig
from eval.source import AHEAD_FROM, make_drive, make_source, make_world
from sim.ahead import Ahead
from sim.drive import Drive


def test_a_short_drive_is_simulated_where_it_is_used():
    config = RunConfig("SE1", duration=10.0)
    assert isinstance(make_source(config, make_world(config)), Drive)


def test_a_long_drive_is_simulated_ahead_and_is_the_same():
    config = RunConfig("SE1", seed=3, duration=AHEAD_FROM + 1.0)
    world = make_world(config)
    here, ahead = make_drive(config, world), make_source(config, world)
    assert isinstance(ahead, Ahead)
    assert ahead.duration == here.duration == AHEAD_FROM + 1.0
    there = iter(ahead)
    for (a, at), (b, bt) in itertools.islice(zip(here, there, strict=True), 4):
        assert np.array_equal(a.points, b.points)
        assert np.array_equal(at.T_world_base, bt.T_world_base)
        assert np.array_equal(at.face, bt.face)
    there.close()
