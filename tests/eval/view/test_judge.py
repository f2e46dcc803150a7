"""The quick word on a run: found, false and missed rooms, walls, and the error so far."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from eval.view.judge import Judge
from slam.core import Array, MapView, Proposals, WallProposal, pose
from worlds.truth import Truth


@pytest.fixture
def judge(truth: Truth, T_world_base: Array) -> Judge:
    judge = Judge(truth)
    judge.see(np.eye(4), T_world_base)
    return judge


@pytest.fixture
def normals(view: MapView) -> dict[int, Array]:
    return {plane.id: plane.normal for plane in view.planes}


def test_nothing_is_said_before_anything_was_seen(truth: Truth, proposals: Proposals) -> None:
    assert Judge(truth).judge(proposals, {}) is None


def test_true_and_false_rooms(
    judge: Judge, proposals: Proposals, normals: dict[int, Array]
) -> None:
    said = judge.judge(proposals, normals)
    assert said is not None
    assert said.rooms == {7: 0, 8: None}
    assert said.missed == frozenset()
    assert said.ate is None  # one pose cannot be aligned


def test_a_room_is_found_once(judge: Judge, proposals: Proposals) -> None:
    twice = replace(proposals.rooms[0], id=9)
    said = judge.judge(Proposals((proposals.rooms[0], twice)), {})
    assert said is not None
    assert said.rooms == {7: 0, 9: None}


def test_a_room_entered_and_not_found_is_missed(judge: Judge) -> None:
    said = judge.judge(Proposals(), {})
    assert said is not None
    assert said.missed == {0}


def test_walls(judge: Judge, proposals: Proposals, normals: dict[int, Array]) -> None:
    def right(answer: Proposals, known: dict[int, Array]) -> int:
        said = judge.judge(answer, known)
        assert said is not None
        return said.walls_right

    assert right(proposals, normals) == 1
    assert right(proposals, {**normals, 0: -normals[0]}) == 0
    assert right(proposals, {}) == 0
    south, north = proposals.walls[0].pieces
    off = replace(north, segment=north.segment + 0.3)
    assert right(replace(proposals, walls=(WallProposal(0, (south, off), 0.8),)), normals) == 0


def test_the_error_so_far_is_of_the_aligned_path(truth: Truth) -> None:
    judge = Judge(truth)
    rng = np.random.default_rng(1)
    turn = pose(np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]]), np.array([2, 1, 0]))
    noise = rng.normal(0.0, 0.05, size=(400, 3))
    for at, off in zip(rng.uniform(-1, 1, size=(400, 3)), noise, strict=True):
        judge.see(pose(np.eye(3), at + off), turn @ pose(np.eye(3), at))
    said = judge.judge(Proposals(), {})
    assert said is not None
    assert said.ate == pytest.approx(0.05 * np.sqrt(3), rel=0.1)
