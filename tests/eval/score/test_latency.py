"""When rooms are found and how steadily, on hand-made histories."""

from __future__ import annotations

import numpy as np
import pytest

from eval.labels import Instant
from eval.score.latency import UNKNOWN_TIME, TimeScore, score_time
from eval.score.votes import RoomVote

CENTRES = {0: (2.0, 1.5), 1: (6.0, 1.5), 2: (4.0, 3.8)}


def vote(id: int, room: int, count: int = 4, coverage: float = 1.0, centre=None) -> RoomVote:
    """A detection of ``count`` faces of a room."""
    faces = tuple(range(4 * room, 4 * room + count))
    place = centre or CENTRES[room]
    return RoomVote(id, faces, room, coverage, 1, place, place)


@pytest.fixture
def score(house):
    def run(*updates: tuple[float, tuple[RoomVote, ...]], entered=None, start=0.0) -> TimeScore:
        instants = [Instant(stamp, 0.01, votes) for stamp, votes in updates]
        return score_time(instants, house.truth, np.eye(4), entered or {0: 0.0}, start)

    return run


def test_the_first_room_needs_four_true_faces(score) -> None:
    result = score((0.3, (vote(0, 0, 3),)), (0.8, (vote(0, 0, 4),)), (0.9, (vote(0, 0, 4),)))
    assert result.first_room_s == pytest.approx(0.81)
    # It was true before that, with three: the latency counts from there.
    assert result.latency_median_s == pytest.approx(0.31)


def test_time_counts_from_the_first_sweep_s_start(score) -> None:
    assert score((5.3, (vote(0, 0),)), start=5.0).first_room_s == pytest.approx(0.31)


def test_a_false_detection_is_no_first_room(score) -> None:
    result = score(
        (0.3, (vote(0, 0, coverage=0.4),)), (0.5, (vote(0, 0, centre=(50.0, 0.0)),)), (0.7, ())
    )
    assert result == TimeScore(None, None, None, 0, 0)


def test_a_room_with_three_faces_needs_only_those(house, score) -> None:
    import dataclasses

    rooms = (dataclasses.replace(house.truth.rooms[0], faces=(0, 1, 2)), *house.truth.rooms[1:])
    truth = dataclasses.replace(house.truth, rooms=rooms)
    instants = [Instant(0.3, 0.0, (vote(0, 0, 3),))]
    assert score_time(instants, truth, np.eye(4), {}, 0.0).first_room_s == pytest.approx(0.3)


def test_latency_is_from_entering_to_being_found(score) -> None:
    """A: 1.01 s after entering; B: found before it was entered: 0; C: never found, left out."""
    result = score(
        (1.0, (vote(0, 0), vote(1, 1))),
        (9.0, (vote(0, 0), vote(1, 1))),
        entered={0: 0.0, 1: 5.0, 2: 8.0},
    )
    assert result.latency_median_s == pytest.approx(1.01 / 2)
    assert result.latency_p95_s == pytest.approx(0.95 * 1.01)


def test_rooms_that_were_not_entered_have_no_latency(score) -> None:
    assert score((1.0, (vote(1, 1),))).latency_median_s is None


def test_a_true_detection_that_goes_is_retracted(score) -> None:
    true = (vote(0, 0),)
    assert score((1, true), (2, true), (3, true)).retracted_true == 0
    assert score((1, true), (2, ())).retracted_true == 1
    assert score((1, true), (2, ()), (3, true), (4, ())).retracted_true == 2


def test_a_false_detection_that_goes_is_not(score) -> None:
    assert score((1, (vote(0, 0, coverage=0.2),)), (2, ())).retracted_true == 0


def test_a_detection_covered_less_as_more_is_seen_is_kept(score) -> None:
    result = score((1, (vote(0, 0),)), (2, (vote(0, 0, coverage=0.3),)))
    assert result.retracted_true == 0


def test_a_detection_that_moves_to_another_room_is_retracted(score) -> None:
    result = score((1, (vote(0, 0),)), (2, (vote(0, 1),)))
    assert (result.retracted_true, result.id_switches) == (1, 0)


def test_another_id_for_the_same_room_is_a_switch(score) -> None:
    """0 -> 7 -> 7 -> gone -> 9: two switches, one retraction."""
    result = score(
        (1, (vote(0, 0),)), (2, (vote(7, 0),)), (3, (vote(7, 0),)), (4, ()), (5, (vote(9, 0),))
    )
    assert (result.id_switches, result.retracted_true) == (2, 1)


def test_a_duplicate_that_is_covered_better_for_once_is_no_switch(score) -> None:
    both = (vote(0, 0), vote(1, 0, coverage=0.9))
    turned = (vote(0, 0, coverage=0.8), vote(1, 0, coverage=0.9))
    assert score((1, both), (2, turned), (3, both)).id_switches == 0
    assert score((1, both), (2, turned[1:])).id_switches == 1


def test_rooms_without_pieces_have_no_times(score) -> None:
    blank = RoomVote(0, (), None, 0.0, 0, CENTRES[0], CENTRES[0])
    assert score((1, (blank,))) == UNKNOWN_TIME


def test_no_updates(score) -> None:
    assert score() == TimeScore(None, None, None, 0, 0)
