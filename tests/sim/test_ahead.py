import gc
import os
import signal
import subprocess
import sys
import time
from functools import partial
from pathlib import Path

import numpy as np
import pytest
from boxworld import flat

from sim.ahead import Ahead
from sim.drive import Drive
from sim.route import Route, plan_route
from sim.sensorfile import sensor_named
from slam.core import InputError, RunError

HERE = str(Path(__file__).parent)


def drive(duration=1.0):
    world = flat()
    return Drive(world, sensor_named("vlp16"), plan_route(world), seed=4, duration=duration)


def crash():
    """A drive that touches a wall."""
    into_the_wall = Route(np.array([[3.0, 3.5], [3.9, 3.5]]), ("Left",), ())
    return Drive(flat(), sensor_named("ideal"), into_the_wall)


def refuse():
    raise InputError("scene: no such thing")


def fault():
    raise ZeroDivisionError("of all things")


def die():
    os._exit(7)


@pytest.fixture(autouse=True)
def _importable(monkeypatch):
    """The other process finds this module by its name."""
    monkeypatch.syspath_prepend(HERE)
    monkeypatch.setitem(sys.modules, "test_ahead", sys.modules[__name__])
    for made in (drive, crash, refuse, fault, die):
        monkeypatch.setattr(made, "__module__", "test_ahead")


def gone(process):
    """Whether it ended and was waited for."""
    return process.returncode is not None


def test_the_scans_are_the_same_to_the_bit():
    here, there = list(drive()), list(Ahead(drive))
    assert len(here) == len(there) == 10
    for (a, at), (b, bt) in zip(here, there, strict=True):
        assert (a.index, a.stamp) == (b.index, b.stamp)
        for name in ("points", "times", "ring", "intensity", "T_base_lidar"):
            assert np.array_equal(getattr(a, name), getattr(b, name))
            assert getattr(a, name).dtype == getattr(b, name).dtype
        assert np.array_equal(a.wheels.T_odom_base, b.wheels.T_odom_base)
        assert np.array_equal(at.T_world_base, bt.T_world_base)
        assert np.array_equal(at.face, bt.face)
        assert np.array_equal(at.points_world, bt.points_world)


@pytest.mark.parametrize(
    ("make", "error", "says"),
    [
        (crash, RunError, "touched a wall at t="),
        (refuse, InputError, "no such thing"),
        (fault, RuntimeError, r"(?s)in fault.*ZeroDivisionError: of all things"),
        (die, RunError, "ended with status 7"),
    ],
)
def test_errors_come_through_as_what_they_are(make, error, says):
    with pytest.raises(error, match=says):
        list(Ahead(make))


def test_no_process_is_left_whichever_way_it_ends():
    stopped = Ahead(partial(drive, 60.0))
    for _, _ in stopped:
        break
    gc.collect()  # ends the iteration
    assert gone(stopped._process)
    with pytest.raises(InputError, match="once"):
        next(iter(stopped))
    closed = Ahead(partial(drive, 60.0))
    process = closed._process
    closed.close()
    assert gone(process)
    forgotten = Ahead(partial(drive, 60.0))
    process = forgotten._process
    del forgotten
    gc.collect()
    assert gone(process)


@pytest.mark.slow
def test_it_does_not_outlive_a_user_that_is_killed():
    user = f"""
import sys
sys.path[:] = {[HERE, *sys.path]!r}
from test_ahead import *
ahead = Ahead(partial(drive, 60.0))
next(iter(ahead))
print(ahead._process.pid, flush=True)
sys.stdin.read()
"""
    with subprocess.Popen(
        [sys.executable, "-c", user], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
    ) as process:
        pid = int(process.stdout.readline())
        process.send_signal(signal.SIGKILL)
    for _ in range(100):
        if not alive(pid):
            break
        time.sleep(0.1)
    assert not alive(pid)


def alive(pid):
    """Whether a process runs; one that ended and that nobody has waited for does not."""
    try:
        state = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0]
    except FileNotFoundError:
        return False
    return state != "Z"
