import numpy as np
import pytest
from houses import TWO_ROOMS_AND_A_CORRIDOR, view

from semantics.clusters import Clusters
from semantics.edges import Edges
from semantics.habit import Habit
from semantics.preprocess import Preprocessor

PAIRS = np.array([[0, 1], [0, 4], [0, 8], [9, 10]])


def edges(*probability):
    p = np.array(probability)
    return Edges(PAIRS, p, np.zeros(len(p)))


def pieces():
    return Preprocessor()(view(TWO_ROOMS_AND_A_CORRIDOR).planes)


def test_nothing_is_known_at_first():
    p = Habit(1.0).lean(pieces(), edges(0.2, 0.5, 0.9, 1.0))
    assert p == pytest.approx([0.2, 0.5, 0.9, 1.0])


def test_one_room_leans_to_one_and_two_to_two_by_the_same_odds():
    habit = Habit(np.log(3.0))
    # 0-3 one room, 4-7 another, 8 alone, 9-11 in none
    label = np.array([0, 0, 0, 0, 1, 1, 1, 1, 2, -1, -1, -1])
    habit.remember(pieces(), Clusters(label, np.ones(3)))
    p = habit.lean(pieces(), edges(0.5, 0.5, 0.5, 0.5))
    assert p == pytest.approx([0.75, 0.25, 0.5, 0.5])


def test_pieces_that_are_new_are_met_without_a_lean():
    habit = Habit(1.0)
    habit.remember(pieces().take(np.arange(4)), Clusters(np.zeros(4, np.int64), np.ones(1)))
    p = habit.lean(pieces(), edges(0.5, 0.5, 0.5, 0.5))
    assert p[0] > 0.7
    assert p[1:] == pytest.approx([0.5, 0.5, 0.5])
