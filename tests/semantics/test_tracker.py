from dataclasses import replace

import numpy as np

from semantics.roomtracker import RoomTracker
from semantics.walltracker import WallTracker
from slam.core import PlanePiece, RoomProposal, WallProposal


def piece(plane, low=0.0, high=4.0):
    return PlanePiece(plane, np.array([[low, 0.0], [high, 0.0]]))


def room(*planes):
    return RoomProposal(-1, tuple(piece(p) for p in planes), None, np.zeros(2), 0.9)


def ids(rooms):
    return [r.id for r in rooms]


def test_a_room_keeps_its_id_while_its_walls_change_a_little():
    tracker = RoomTracker()
    assert ids(tracker.update([room(0, 1, 2, 3)])) == [0]
    assert ids(tracker.update([room(1, 2, 3, 7)])) == [0]
    assert ids(tracker.update([room(9, 10, 11), room(1, 2, 3, 7)])) == [0, 1]


def test_a_room_whose_planes_were_merged_is_known_by_where_it_is():
    def at(x, *planes):
        outline = np.array([[x, 0.0], [x + 4.0, 0.0], [x + 4.0, 3.0], [x, 3.0]])
        return replace(room(*planes), polygon=outline)

    tracker = RoomTracker()
    assert ids(tracker.update([at(0.0, 0, 1, 2), at(5.0, 3, 4, 5)])) == [0, 1]
    assert ids(tracker.update([at(0.2, 10, 11, 12), at(5.0, 3, 4, 5)])) == [0, 1]
    above = at(5.0, 13, 14, 15)  # on the next storey
    assert ids(tracker.update([at(0.2, 10, 11, 12), at(5.0, 3, 4, 5), above])) == [0, 1, 2]
    assert ids(tracker.update([at(3.5, 20, 21, 22)])) == [0, 1, 2, 3]


def test_a_room_missed_once_is_kept_and_one_missed_for_long_is_not():
    tracker = RoomTracker()
    tracker.update([room(0, 1, 2)])
    for _ in range(3):
        assert ids(tracker.update([])) == [0]
    assert tracker.update([]) == ()


def test_two_rooms_become_one_only_when_it_lasts():
    tracker = RoomTracker()
    tracker.update([room(0, 1, 2), room(3, 4, 5)])
    both = room(0, 1, 2, 3, 4, 5)
    for _ in range(3):
        assert ids(tracker.update([both])) == [0, 1]
    assert len(tracker.update([both])) == 1


def test_pieces_of_one_plane_far_apart_are_different_rooms():
    def part(low):
        pieces = (piece(0, low, low + 3.0), piece(int(low) + 1))
        return RoomProposal(-1, pieces, None, np.zeros(2), 0.9)

    tracker = RoomTracker()
    first = tracker.update([part(0.0)])
    second = tracker.update([part(0.0), part(20.0)])
    assert ids(first) == [0]
    assert ids(second) == [0, 1]


def test_walls_keep_their_ids_whichever_face_comes_first():
    tracker = WallTracker()

    def wall(a, b):
        return WallProposal(-1, (piece(a), piece(b)), 0.9)

    assert ids(tracker.update([wall(0, 1), wall(2, 3)])) == [0, 1]
    assert ids(tracker.update([wall(3, 2), wall(1, 0), wall(4, 5)])) == [0, 1, 2]


def test_a_wall_that_another_one_covers_is_given_up_at_once():
    tracker = WallTracker()
    halves = [
        WallProposal(-1, (piece(0, 0.0, 2.0), piece(1)), 0.9),
        WallProposal(-1, (piece(0, 2.0, 4.0), piece(1)), 0.9),
    ]
    assert len(tracker.update(halves)) == 2
    assert len(tracker.update([WallProposal(-1, (piece(0), piece(1)), 0.9)])) == 1


def test_a_room_that_was_given_up_and_comes_again_has_its_old_id():
    tracker = RoomTracker()
    tracker.update([room(0, 1, 2), room(3, 4, 5)])
    for _ in range(4):
        tracker.update([room(3, 4, 5)])
    assert ids(tracker.update([room(3, 4, 5)])) == [1]
    assert ids(tracker.update([room(0, 1, 2), room(3, 4, 5), room(6, 7, 8)])) == [0, 1, 2]


def test_a_neighbour_that_shares_one_long_wall_does_not_inherit_the_id():
    tracker = RoomTracker()
    tracker.update([room(0, 1, 2)])
    assert ids(tracker.update([room(2, 7, 8)])) == [0, 1]


def test_the_same_object_is_the_same_room_and_keeps_its_object():
    tracker, one = RoomTracker(), room(0, 1, 2)
    first, second = tracker.update([one]), tracker.update([one])
    assert second[0] is first[0]
