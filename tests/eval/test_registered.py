"""Scans that are registered where they are simulated, and sweeps that saw nothing."""

import dataclasses
import itertools
import logging

import numpy as np
import pytest

from eval import registered
from eval.config import RunConfig
from eval.labels import TruthKeeper
from eval.outputs import read_metrics
from eval.registered import RegisteredAhead
from eval.run import run
from eval.source import AHEAD_FROM, make_drive, make_source, make_world
from eval.steps import live_steps
from eval.studies.odometry import StudyCase, drive
from slam.core import InputError, RunError
from slam.frontend import FrontEnd
from slam.kiss import KissOdometry


def short():
    return drive(StudyCase("generated-3", seed=5, duration=0.5))


def empty(scan):
    none = {name: getattr(scan, name)[:0] for name in ("points", "times", "ring", "intensity")}
    return dataclasses.replace(scan, **none)


def with_gap():
    """A drive whose third sweep has no return."""
    for scan, truth in short():
        yield (empty(scan) if scan.index == 2 else scan), truth


class Standing:
    def register(self, scan):
        assert len(scan)
        return np.eye(4)


class Losing(Standing):
    def register(self, scan):
        if scan.index == 3:
            raise RunError("lost track")
        return np.eye(4)


@pytest.fixture
def here(monkeypatch):
    """Without another process, whose own tests are those of ``sim.ahead``."""

    class Here:
        def __init__(self, make, duration):
            self._make = make

        def __iter__(self):
            return iter(self._make())

        __class_getitem__ = classmethod(lambda cls, _: cls)

    monkeypatch.setattr(registered, "Ahead", Here)


def test_the_poses_are_those_of_an_odometry_here(monkeypatch):
    monkeypatch.delenv("OMP_NUM_THREADS", raising=False)
    config = RunConfig("SE1", seed=3, duration=AHEAD_FROM + 1.0)
    world = make_world(config)
    ahead, odometry = make_source(config, world, registered=True), KissOdometry()
    assert isinstance(ahead, RegisteredAhead)
    assert ahead.duration == AHEAD_FROM + 1.0
    there = iter(ahead)
    for (a, at), (b, bt) in itertools.islice(
        zip(make_drive(config, world), there, strict=False), 4
    ):
        assert np.array_equal(a.points, b.points)
        assert np.array_equal(at.T_world_base, bt.T_world_base)
        assert ahead.register(b) == pytest.approx(odometry.register(a), abs=1e-8)
        assert ahead.seconds > 0.0
    with pytest.raises(RunError, match="is not the one"):
        ahead.register(dataclasses.replace(b, index=9))
    there.close()


def test_what_the_odometry_raises_there_is_raised_here_when_it_is_asked(here):
    ahead = RegisteredAhead(short, Losing, 0.5)
    seen = []
    for scan, _ in ahead:
        seen.append(scan.index)
        if scan.index < 3:
            ahead.register(scan)
    assert seen == [0, 1, 2, 3]
    with pytest.raises(RunError, match="lost track"):
        ahead.register(scan)


def test_a_sweep_without_returns_is_skipped_and_said(here, caplog):
    for source in (list(with_gap()), RegisteredAhead(with_gap, Standing, 0.5)):
        odometry = source if isinstance(source, RegisteredAhead) else Standing()
        caplog.clear()
        with caplog.at_level(logging.WARNING):
            steps = list(live_steps(source, FrontEnd(odometry), TruthKeeper(short()._world.truth)))
        assert [step.frame.index for step in steps] == [0, 1, 3, 4]
        assert "sweeps without a single return, skipped: 1" in caplog.text


def test_a_run_counts_the_sweeps_without_returns(monkeypatch, tmp_path):
    config = RunConfig("SE1", duration=0.5, out=tmp_path / "run", detector="none")
    given = [
        (empty(scan) if scan.index == 2 else scan, truth)
        for scan, truth in make_drive(config, make_world(config))
    ]
    monkeypatch.setattr("eval.source.make_drive", lambda config, world: _Given(given))
    result = run(config)
    assert read_metrics(result.folder / "metrics.json").scans_skipped == 1


def test_a_run_in_which_nothing_was_ever_seen_fails(monkeypatch, tmp_path):
    nothing = [(empty(scan), truth) for scan, truth in short()]
    monkeypatch.setattr("eval.source.make_drive", lambda config, world: _Given(nothing))
    with pytest.raises(RunError, match="no sweep had a single return"):
        run(RunConfig("SE1", duration=1.0, out=tmp_path / "run", detector="none"))


class _Given(list):
    duration = 1.0

    class route:
        unreachable = ()


def test_a_scan_without_returns_is_none_of_an_odometry():
    with pytest.raises(InputError, match="not a single return"):
        FrontEnd(Standing()).process(empty(next(iter(short()))[0]))
