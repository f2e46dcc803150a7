"""The run never waits for who watches it."""

from __future__ import annotations

import logging
import threading

import numpy as np
import pytest

from eval.config import RunConfig
from eval.sinks import NullSink
from eval.view.live import LiveSink
from slam.core import Frame, MapView, Proposals, Scan

NO_POINTS = np.zeros((0, 3))
SCAN = Scan(0, 0.0, NO_POINTS, np.zeros(0), np.zeros(0, np.int16), np.zeros(0))


class Slow(NullSink):
    """Takes nothing on until it may."""

    def __init__(self) -> None:
        self.may = threading.Event()
        self.heard: list[object] = []

    def started(self, *_: object) -> None:
        self.heard.append("started")

    def frame(self, frame: Frame, *_: object) -> None:
        assert self.may.wait(30.0)
        self.heard.append(frame.index)

    def finished(self) -> None:
        self.heard.append("finished")


def frames(sink: LiveSink, count: int) -> None:
    for index in range(count):
        frame = Frame(index, 0.1 * index, np.eye(4), np.eye(4), None)
        sink.frame(frame, SCAN, np.eye(4))


def test_a_slow_viewer_loses_the_oldest_and_holds_up_nothing() -> None:
    slow = Slow()
    sink = LiveSink(slow, length=4)
    sink.started(RunConfig("SE1"), None)
    frames(sink, 100)  # returns although nothing is taken on: else this test would not end
    slow.may.set()
    sink.finished()
    assert slow.heard[0] == "started"
    assert slow.heard[-1] == "finished"
    numbers = [index for index in slow.heard if isinstance(index, int)]
    assert numbers == sorted(numbers)
    assert numbers[-4:] == [96, 97, 98, 99]
    assert len(numbers) <= 5


def test_a_quick_viewer_gets_everything_in_order() -> None:
    slow = Slow()
    slow.may.set()
    sink = LiveSink(slow, length=1000)
    sink.started(RunConfig("SE1"), None)
    frames(sink, 50)
    sink.finished()
    assert slow.heard == ["started", *range(50), "finished"]


class Failing(NullSink):
    def updated(self, view: MapView, proposals: Proposals) -> None:
        raise OSError("gone")


class FailingAtOnce(NullSink):
    def started(self, *_: object) -> None:
        raise OSError("gone")


@pytest.mark.parametrize("inner", [Failing(), FailingAtOnce()])
def test_a_failing_viewer_is_a_warning(inner: NullSink, caplog: pytest.LogCaptureFixture) -> None:
    sink = LiveSink(inner)
    with caplog.at_level(logging.WARNING):
        sink.started(RunConfig("SE1"), None)
        for _ in range(3):
            sink.updated(MapView(0.0, (), ()), Proposals())
        sink.finished()
    lines = [record.getMessage() for record in caplog.records]
    assert lines == ["view: the viewer was lost (gone); the run goes on"]


def test_a_viewer_that_is_closed_is_a_warning(caplog: pytest.LogCaptureFixture) -> None:
    shown = Slow()
    shown.may.set()
    alive = iter([True, False])
    sink = LiveSink(shown, alive=lambda: next(alive))
    with caplog.at_level(logging.WARNING):
        sink.started(RunConfig("SE1"), None)
        frames(sink, 5)
        sink.finished()
    lines = [record.getMessage() for record in caplog.records]
    assert lines == ["view: the viewer was closed; the run goes on"]
    assert shown.heard == ["started", 0]
