"""Answers of detectors that nobody has tested: what is left out, and what ends a run."""

from __future__ import annotations

import logging
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from eval.config import RunConfig
from eval.guard import Guard
from eval.run import run
from slam.core import (
    InputError,
    MapPlane,
    MapView,
    PlanePiece,
    Proposals,
    RoomProposal,
    RunError,
    WallProposal,
)

SEGMENT = np.array([[0.0, 0.0], [4.0, 0.0]])
SQUARE = np.array([[0.0, 0.0], [4.0, 0.0], [4.0, 4.0], [0.0, 4.0]])


def _view(planes: int = 3) -> MapView:
    points, ids = np.zeros((1, 3)), np.zeros(1, dtype=np.int64)
    normal = np.array([0.0, 1.0, 0.0])
    return MapView(
        0.0, [MapPlane(name, normal, 0.0, points, ids, ids) for name in range(planes)], []
    )


def _room(*planes: int) -> RoomProposal:
    pieces = tuple(PlanePiece(plane, SEGMENT + plane) for plane in planes)
    return RoomProposal(7, pieces, SQUARE, np.array([2.0, 2.0]), 0.9)


def _wall(first: int, second: int) -> WallProposal:
    return WallProposal(3, (PlanePiece(first, SEGMENT), PlanePiece(second, SEGMENT)), 0.9)


class Says:
    """A detector that gives one answer; an exception it raises."""

    def __init__(self, answer: object) -> None:
        self.answer, self.asked = answer, 0

    def update(self, view: MapView) -> Proposals:
        self.asked += 1
        if isinstance(self.answer, Exception):
            raise self.answer
        return self.answer  # type: ignore[return-value]


def _passed(*rooms: RoomProposal, walls: tuple[WallProposal, ...] = ()) -> Proposals:
    return Guard(Says(Proposals(rooms, walls))).ask(_view())


def test_a_sound_answer_is_passed_on_as_it_is() -> None:
    room, wall = _room(0, 1, 2), _wall(0, 1)
    answer = _passed(room, walls=(wall,))
    assert answer.rooms[0] is room
    assert answer.walls[0] is wall
    bare = replace(room, pieces=(), polygon=None)  # of a detector that uses no planes
    assert _passed(bare).rooms == (bare,)


def test_planes_that_are_not_in_the_map_are_left_out() -> None:
    assert [p.plane_id for p in _passed(_room(0, 99, 2)).rooms[0].pieces] == [0, 2]
    assert _passed(_room(98, 99)).rooms == ()
    assert _passed(walls=(_wall(0, 99),)).walls == ()


def test_an_outline_that_is_none_and_pieces_named_twice_are_left_out() -> None:
    for outline in (np.full((4, 2), np.nan), SQUARE[:2], np.zeros(3)):
        assert _passed(replace(_room(0, 1), polygon=outline)).rooms[0].polygon is None
    assert len(_passed(_room(0, 1, 0)).rooms[0].pieces) == 2


def test_each_kind_of_fault_is_told_once(caplog: pytest.LogCaptureFixture) -> None:
    guard = Guard(Says(Proposals((_room(0, 99, 98),))))
    with caplog.at_level(logging.WARNING):
        guard.ask(_view())
        guard.ask(_view())
    assert len(caplog.records) == 1
    assert "plane 99 is not in the map" in caplog.text


@pytest.mark.parametrize(
    ("answer", "said"),
    [
        (None, "expected Proposals, got NoneType"),
        (Proposals((1,)), "expected RoomProposal, got int"),  # type: ignore[arg-type]
        (Proposals((_room(0), _room(1))), "room id 7 was proposed twice"),
        (Proposals((replace(_room(0), centre=np.array([np.nan, 0.0])),)), "room 7: centre"),
        (Proposals((replace(_room(0), centre="here"),)), "room 7: centre"),  # type: ignore[arg-type]
        (Proposals((replace(_room(0), confidence=np.nan),)), "room 7: confidence"),
        (Proposals((replace(_room(), pieces=(PlanePiece(0, SEGMENT * np.inf),)),)), "plane 0"),
        (Proposals(walls=(replace(_wall(0, 1), pieces=()),)), "wall 3: 0 pieces"),  # type: ignore[arg-type]
        (ValueError("of\nits own"), "ValueError: of"),
    ],
)  # fmt: skip
def test_what_cannot_be_used_is_one_line(answer: object, said: str) -> None:
    with pytest.raises(RunError) as raised:
        Guard(Says(answer)).ask(_view())
    assert said in str(raised.value)
    assert "\n" not in str(raised.value)


def test_a_detector_that_has_failed_is_not_asked_again() -> None:
    detector = Says(ValueError("no"))
    guard = Guard(detector)
    with pytest.raises(RunError):
        guard.ask(_view())
    assert guard.ask(_view()) == Proposals()
    assert detector.asked == 1
    with pytest.raises(InputError):  # an error of ours stays what it is
        Guard(Says(InputError("broken planes"))).ask(_view())


class Hostile:
    """Remembers planes that are long gone, and draws rooms that are none."""

    def update(self, view: MapView) -> Proposals:
        stale = tuple(_room(0, 10_000).pieces)
        return Proposals((replace(_room(), pieces=stale, polygon=np.full((4, 2), np.nan)),))


class Broken(Hostile):
    """Has no idea where its room is."""

    def update(self, view: MapView) -> Proposals:
        return Proposals((replace(_room(0), centre=np.array([np.nan, np.nan])),))


def _run(tmp_path: Path, name: str, monkeypatch: pytest.MonkeyPatch) -> Callable[[], object]:
    monkeypatch.syspath_prepend(str(__file__).rpartition("/")[0])
    config = RunConfig("SE1", duration=0.5, detector=f"test_guard:{name}", out=tmp_path)
    return lambda: run(config)


def test_a_run_with_stale_planes_leaves_its_files(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    _run(tmp_path / "out", "Hostile", monkeypatch)()
    names = {path.name for path in (tmp_path / "out").iterdir()}
    assert {"graph.json", "metrics.json", "plan.png"} <= names


def test_a_run_with_a_broken_detector_fails_and_leaves_its_files(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    with pytest.raises(RunError, match="centre"):
        _run(tmp_path / "out", "Broken", monkeypatch)()
    names = {path.name for path in (tmp_path / "out").iterdir()}
    assert {"graph.json", "metrics.json"} <= names
