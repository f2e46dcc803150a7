"""When a face counts as seen, how much of it, and when a room counts as entered."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from looking import see
from shapely.geometry import box

from eval.seen import RoomVisits, SeenFaces
from worlds.truth import FLOOR, Floor


def test_a_face_needs_100_returns_over_half_a_metre(house) -> None:
    seen = SeenFaces(house.truth)
    see(seen, house.truth, 0, np.linspace(0.01, 0.49, 99))
    assert not seen.seen[0]
    assert seen.length(0) == 0.0
    see(seen, house.truth, 0, np.array([0.2]), stamp=1.0)
    assert seen.seen[0]
    assert seen.since[0] == 1.0
    assert seen.length(0) == pytest.approx(0.5)


def test_many_returns_on_a_short_stretch_are_not_enough(house) -> None:
    seen = SeenFaces(house.truth)
    see(seen, house.truth, 0, np.linspace(0.01, 0.44, 1000))
    assert not seen.seen[0]
    see(seen, house.truth, 0, np.array([0.46]))
    assert seen.seen[0]


def test_returns_from_beyond_15_m_do_not_count(house) -> None:
    seen = SeenFaces(house.truth)
    labels = np.zeros(500, np.int32)
    points = np.column_stack([np.linspace(0.1, 3.9, 500), np.zeros(500), np.ones(500)])
    seen.apply(seen.digest(labels, points, np.full(500, 15.01)), 0.0)
    assert not seen.seen.any()
    seen.apply(seen.digest(labels, points, np.full(500, 15.0)), 0.0)
    assert seen.seen.tolist() == [True] + [False] * 11


def test_length_counts_bins_with_returns_only(house) -> None:
    """A door gap of 0.9 m in a face of 4 m gives no returns: 3.1 m are seen, however often."""
    seen = SeenFaces(house.truth)
    along = np.concatenate([np.arange(0.025, 1.0, 0.05), np.arange(1.925, 4.0, 0.05)])
    for stamp in range(4):
        see(seen, house.truth, 0, along, float(stamp))
    assert seen.length(0) == pytest.approx(3.1)
    assert seen.room_length(0) == pytest.approx(3.1)
    assert seen.room_length(1) == 0.0
    assert seen.covered(0, [(0.0, 4.0)]) == pytest.approx(3.1)
    assert seen.covered(0, [(0.0, 0.99)]) == pytest.approx(1.0)
    assert seen.covered(0, [(1.1, 1.8)]) == 0.0


def test_a_room_s_length_is_that_of_its_seen_faces(house) -> None:
    seen = SeenFaces(house.truth)
    see(seen, house.truth, 0, np.linspace(0.001, 3.999, 400))
    see(seen, house.truth, 1, np.linspace(0.001, 2.999, 99))
    assert seen.room_length(0) == pytest.approx(4.0)
    see(seen, house.truth, 1, np.array([0.5]))
    assert seen.room_length(0) == pytest.approx(7.0)


def test_overlapping_stretches_cover_once(house) -> None:
    seen = SeenFaces(house.truth)
    see(seen, house.truth, 1, np.linspace(0.001, 2.999, 600))
    assert seen.covered(1, [(0.01, 1.49), (1.01, 1.99)]) == pytest.approx(2.0)
    assert seen.covered(1, []) == 0.0


def test_an_unseen_face_covers_nothing(house) -> None:
    seen = SeenFaces(house.truth)
    see(seen, house.truth, 1, np.linspace(0.001, 2.999, 60))
    assert seen.covered(1, [(0.0, 3.0)]) == 0.0


def test_along_is_measured_from_the_first_end(house) -> None:
    seen = SeenFaces(house.truth)
    labels = np.array([0, 1, FLOOR], dtype=np.int32)
    points = np.array([[3.0, 0.02, 1.0], [4.0, 1.0, 2.0], [1.0, 1.0, 0.0]])
    along = seen.along(labels, points)
    assert along[:2].tolist() == pytest.approx([1.0, 2.0])  # from (4, 0) and from (4, 3)
    assert np.isnan(along[2])


def test_labels_that_are_no_faces_are_passed_over(house) -> None:
    seen = SeenFaces(house.truth)
    points = np.column_stack([np.linspace(0.1, 3.9, 500), np.zeros(500), np.zeros(500)])
    seen.apply(seen.digest(np.full(500, FLOOR, np.int32), points, np.ones(500)), 0.0)
    assert not seen.seen.any()
    assert seen.returns.sum() == 0


def test_noise_beyond_the_ends_falls_into_the_end_bins(house) -> None:
    seen = SeenFaces(house.truth)
    see(seen, house.truth, 0, np.concatenate([np.linspace(0.0, 0.5, 120), [-0.03, 4.02]]))
    assert seen.length(0) == pytest.approx(0.6)
    assert seen.since[1] == np.inf


def visit(visits: RoomVisits, *steps: tuple[float, float, float]) -> None:
    for stamp, x, y in steps:
        visits.add(stamp, np.array([x, y, 0.0]))


def test_a_room_is_entered_after_one_second_inside(house) -> None:
    visits = RoomVisits(house.truth)
    visit(visits, (0.0, 2.0, 1.5), (0.5, 2.0, 1.5), (0.9, 2.0, 1.5))
    assert visits.entered == {}
    visit(visits, (1.0, 2.0, 1.5), (9.0, 2.0, 1.5))
    assert visits.entered == {0: 0.0}


def test_a_look_in_at_the_door_does_not_enter(house) -> None:
    """0.8 s in B, back to A, 0.8 s in B again: never a whole second."""
    visits = RoomVisits(house.truth)
    visit(visits, (0.0, 5.0, 1.0), (0.8, 5.0, 1.0), (0.9, 2.0, 1.0), (1.0, 5.0, 1.0))
    visit(visits, (1.8, 5.0, 1.0), (1.9, 4.05, 1.0))
    assert visits.entered == {}


def test_entering_counts_from_the_start_of_the_stay(house) -> None:
    visits = RoomVisits(house.truth)
    visit(visits, (0.0, 5.0, 1.0), (0.4, 4.05, 1.0), (2.0, 5.0, 1.0), (3.0, 5.0, 1.0))
    assert visits.entered == {1: 2.0}


def test_storeys_are_told_apart_by_height(house) -> None:
    upper = dataclasses.replace(house.truth.rooms[0], id=3, storey=1, polygon=box(0, 0, 4, 3))
    truth = dataclasses.replace(
        house.truth, rooms=(*house.truth.rooms, upper), floors=(Floor(0, 0, 2.5), Floor(1, 3, 5.5))
    )
    visits = RoomVisits(truth)
    for stamp in (0.0, 1.0):
        visits.add(stamp, np.array([2.0, 1.0, 2.98]))
    assert visits.entered == {3: 0.0}
    assert visits.storeys == {1}
