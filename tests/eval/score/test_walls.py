"""Walls on hand-made cases (see the house in conftest)."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from looking import see

from eval.score.votes import WallVote
from eval.score.walls import score_walls
from eval.seen import SeenFaces
from worlds.truth import NO_FACE


def seen_of(house, *faces: int) -> SeenFaces:
    seen = SeenFaces(house.truth)
    for face in faces:
        along = np.linspace(0.0, house.truth.faces[face].length, 400)
        see(seen, house.truth, face, along)
    return seen


def votes(*pairs: tuple[int, int]) -> list[WallVote]:
    return [WallVote(i, pair) for i, pair in enumerate(pairs)]


def test_the_two_faces_of_one_wall_in_either_order(house) -> None:
    seen = seen_of(house, *range(12))
    result = score_walls(votes((7, 1), (2, 8)), house.truth, seen)
    assert (result.truth, result.detected, result.true_positive) == (3, 2, 2)
    assert result.precision == 1.0
    assert result.recall == pytest.approx(2 / 3)
    assert result.matches == {0: 0, 1: 1}


def test_what_is_not_a_wall(house) -> None:
    """Opposite sides of a room, one face twice, faces of two walls, and no face at all."""
    seen = seen_of(house, *range(12))
    wrong = votes((0, 2), (1, 1), (2, 6), (1, NO_FACE), (NO_FACE, NO_FACE))
    result = score_walls(wrong, house.truth, seen)
    assert (result.true_positive, result.precision, result.recall) == (0, 0.0, 0.0)


def test_a_second_detection_of_a_wall_is_false(house) -> None:
    result = score_walls(votes((1, 7), (7, 1)), house.truth, seen_of(house, *range(12)))
    assert (result.true_positive, result.detected, result.precision) == (1, 2, 0.5)


def test_a_wall_counts_when_both_faces_are_seen(house) -> None:
    """Seen: 1, 7, 2 and 8, so walls 0 and 1 count. Wall 2 is true, but no recall is due for it."""
    seen = seen_of(house, 1, 7, 2, 8)
    result = score_walls(votes((1, 7), (6, 8)), house.truth, seen)
    assert (result.truth, result.precision, result.recall) == (2, 1.0, 0.5)


def test_nothing_detected_and_nothing_to_detect(house) -> None:
    result = score_walls([], house.truth, seen_of(house, *range(12)))
    assert (result.precision, result.recall) == (None, 0.0)
    assert score_walls([], house.truth, seen_of(house)).recall is None


@given(st.permutations([(1, 7), (8, 2), (1, 7), (0, 2), (6, 8)]))
def test_order_changes_no_figure(house, pairs) -> None:
    result = score_walls(votes(*pairs), house.truth, seen_of(house, *range(12)))
    assert (result.true_positive, result.precision, result.recall) == (3, 0.6, 1.0)
