"""Every rule of room scoring on hand-made cases (see the house in conftest)."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from looking import see
from shapely.geometry import Polygon, box

from eval.score.rooms import RoomScore, iou, match_centres, score_rooms
from eval.score.votes import PieceVote, RoomVote, room_vote
from eval.seen import SeenFaces
from slam.core import Array, RoomProposal, pose, so3_exp
from worlds.truth import CLUTTER, NO_FACE

IN_A, IN_B, IN_C = (2.0, 1.5), (6.0, 1.5), (4.0, 3.8)
ALL = (0, 1, 2)


@pytest.fixture(scope="module")
def seen(house) -> SeenFaces:
    """All faces of the house seen, all along: A 14 m, B 14 m, C 19.2 m."""
    seen = SeenFaces(house.truth)
    for face in house.truth.faces:
        along = np.linspace(0.001, face.length - 0.001, 800)
        see(seen, house.truth, face.id, along)
    return seen


@pytest.fixture(scope="module")
def vote(house, seen):
    """vote(id, faces, centre): its pieces lie on whole faces, or on (face, low, high)."""

    def make(id: int, faces, centre, polygon: Array | None = None) -> RoomVote:
        pieces = [
            PieceVote(f, 0.0, house.truth.faces[f].length) if isinstance(f, int) else PieceVote(*f)
            for f in faces
        ]
        return room_vote(RoomProposal(id, (), polygon, np.array(centre), 1.0), pieces, seen)

    return make


@pytest.fixture(scope="module")
def score(house):
    def run(
        *votes: RoomVote, entered=ALL, polygons=None, T=None, mapped=range(12), truth=None
    ) -> RoomScore:
        return score_rooms(
            votes,
            polygons or {},
            truth or house.truth,
            np.eye(4) if T is None else T,
            entered,
            mapped,
        )

    return run


def test_all_found(vote, score) -> None:
    result = score(
        vote(0, (0, 1, 2, 3), IN_A), vote(1, (4, 5, 6, 7), IN_B), vote(2, (8, 9, 10, 11), IN_C)
    )
    assert (result.detected, result.true_positive) == (3.0, 3.0)
    assert (result.precision, result.recall, result.piece_f1) == (1.0, 1.0, 1.0)
    assert (result.centre_precision, result.centre_recall) == (1.0, 1.0)
    assert result.matches == {0: 0, 1: 1, 2: 2}
    assert (result.over_segmented, result.under_segmented) == (0, 0)


def test_exactly_half_of_the_faces_is_not_a_majority(vote, score) -> None:
    result = score(vote(0, (0, 1, 4, 5), IN_A))
    assert (result.precision, result.recall) == (0.0, 0.0)
    assert result.centre_precision == 1.0


def test_one_more_is_a_majority(vote, score) -> None:
    result = score(vote(0, (0, 1, 2, 4, 5), IN_A))
    assert result.precision == 1.0
    assert result.recall == pytest.approx(1 / 3)
    # 3 of 5 pieces are right; 3 of the 12 mapped faces have a right piece: 2 * .6 * .25 / .85
    assert result.piece_f1 == pytest.approx(2 * 0.6 * 0.25 / 0.85)


def test_pieces_of_pillars_and_jambs_are_wrong_pieces(vote, score) -> None:
    assert score(vote(0, (0, 1, 2, CLUTTER, NO_FACE), IN_A)).precision == 1.0
    assert score(vote(0, (0, 1, CLUTTER, NO_FACE), IN_A)).precision == 0.0


def test_half_of_the_seen_length_is_enough_and_less_is_not(vote, score) -> None:
    """A has 14 m of seen faces: south, 4 m, north, 1 m, and west, 2 m, make 7."""
    exact = vote(0, (0, (2, 0.0, 0.99), (3, 0.0, 1.99)), IN_A)
    assert exact.coverage == pytest.approx(0.5)
    assert score(exact).precision == 1.0
    short = vote(0, (0, (2, 0.0, 0.99), (3, 0.0, 1.94)), IN_A)
    assert short.coverage == pytest.approx(6.95 / 14.0)
    assert score(short).precision == 0.0


def test_pieces_of_other_rooms_cover_nothing(vote) -> None:
    assert vote(0, (0, 1, 2, 4), IN_A).coverage == pytest.approx(11 / 14)


def test_unseen_faces_do_not_count_against_a_room(house, vote, score) -> None:
    """Only the south face of A has been seen: a detection of it alone covers all there is."""
    partly = SeenFaces(house.truth)
    along = np.linspace(0.001, 3.999, 800)
    see(partly, house.truth, 0, along)
    proposal = RoomProposal(0, (), None, np.array(IN_A), 1.0)
    only = room_vote(proposal, [PieceVote(0, 0.0, 4.0)], partly)
    assert only.coverage == 1.0
    assert score(only).true_positive == 0.5


def test_the_centre_must_lie_in_the_room(vote, score) -> None:
    assert score(vote(0, (0, 1, 2, 3), (4.05, 1.5))).precision == 0.0
    assert score(vote(0, (0, 1, 2, 3), IN_B)).precision == 0.0
    assert score(vote(0, (0, 1, 2, 3), (4.0, 1.5))).precision == 1.0


def test_in_a_room_that_is_not_convex_the_centre_is_moved_inside(house, vote, score) -> None:
    """A as an L: the geometric centre of its outline is outside, a point of its polygon is not."""
    corner = Polygon([(0, 0), (4, 0), (4, 0.5), (0.5, 0.5), (0.5, 3), (0, 3)])
    rooms = (dataclasses.replace(house.truth.rooms[0], polygon=corner), *house.truth.rooms[1:])
    truth = dataclasses.replace(house.truth, rooms=rooms)
    outline = np.array(corner.exterior.coords)[:-1]
    outside = vote(0, (0, 1, 2, 3), IN_A, polygon=outline)
    assert score(outside, truth=truth).precision == 1.0
    assert score(vote(0, (0, 1, 2, 3), IN_A), truth=truth).precision == 0.0
    # In a convex room no such help is given.
    moved = outline + np.array([0.0, 20.0])
    assert score(vote(0, (0, 1, 2, 3), (2.0, 21.5), polygon=moved)).precision == 0.0
    shifted = vote(0, (0, 1, 2, 3), (2.0, 9.0), polygon=outline)
    assert score(shifted).precision == 0.0


def test_two_faces_earn_half_in_both_numerators_and_in_the_denominator(vote, score) -> None:
    """A corridor seen as its two long sides alone: 0.5 / 0.5, and half a room recalled of three."""
    result = score(vote(0, (8, 10), IN_C))
    assert (result.true_positive, result.detected) == (0.5, 0.5)
    assert result.precision == 1.0
    assert result.recall == pytest.approx(0.5 / 3)


def test_the_paper_s_seven_and_a_half_of_nine_and_a_half(vote, score) -> None:
    """Beside a half: one whole true and one false detection, 1.5 / 2.5; a false one weighs one."""
    result = score(vote(0, (8, 10), IN_C), vote(1, (0, 1, 2), IN_A), vote(2, (4, 1), IN_B))
    assert (result.true_positive, result.detected) == (1.5, 2.5)
    assert result.precision == pytest.approx(0.6)
    assert result.recall == pytest.approx(0.5)


def test_three_pieces_on_two_faces_earn_half(vote, score) -> None:
    result = score(vote(0, ((8, 0.0, 4.0), (8, 4.0, 8.1), 10), IN_C))
    assert result.true_positive == 0.5


def test_wrong_faces_do_not_lift_a_half(vote, score) -> None:
    """Two faces of C and one of A are three distinct faces, but only two are C's."""
    assert score(vote(0, (8, 10, 2), IN_C)).true_positive == 0.5


def test_a_duplicate_is_one_true_and_one_false(vote, score) -> None:
    small, large = vote(0, (0, 1, 2), IN_A), vote(1, (0, 1, 2, 3), IN_A)
    for votes in ((small, large), (large, small)):
        result = score(*votes)
        assert (result.true_positive, result.detected) == (1.0, 2.0)
        assert result.matches == {1: 0}
        assert result.over_segmented == 1
    assert result.centre_precision == 0.5


def test_a_detection_over_two_rooms_is_false(vote, score) -> None:
    result = score(vote(0, range(8), (4.05, 1.5)))
    assert (result.precision, result.under_segmented) == (0.0, 1)
    assert result.centre_precision == 0.0


def test_precision_counts_over_all_rooms_recall_over_the_entered(vote, score) -> None:
    """A was entered; B was only looked into, and found: true, but no recall is due for it."""
    result = score(vote(0, (4, 5, 6, 7), IN_B), entered=(0,))
    assert (result.precision, result.recall) == (1.0, 0.0)
    assert (result.centre_precision, result.centre_recall) == (1.0, 0.0)
    both = score(vote(0, (4, 5, 6, 7), IN_B), vote(1, (0, 1, 2, 3), IN_A), entered=(0,))
    assert (both.precision, both.recall, both.truth, both.entered) == (1.0, 1.0, 3, 1)


def test_nothing_detected_has_no_precision(score) -> None:
    result = score()
    assert result.precision is None
    assert result.centre_precision is None
    assert (result.recall, result.centre_recall, result.detected) == (0.0, 0.0, 0.0)
    assert result.mean_iou is None
    assert score(entered=()).recall is None


def test_detections_without_pieces_have_the_centre_rule_alone(vote, score) -> None:
    square = np.array(box(0, 0, 4, 1.5).exterior.coords)[:-1]
    result = score(
        vote(0, (), IN_A), vote(1, (), (2.1, 1.0)), vote(2, (), (4.05, 1.0)), polygons={0: square}
    )
    assert (result.precision, result.recall, result.piece_f1) == (None, None, None)
    assert (result.detected, result.true_positive) == (None, None)
    assert (result.over_segmented, result.under_segmented) == (None, None)
    assert result.centre_precision == pytest.approx(1 / 3)
    assert result.centre_recall == pytest.approx(1 / 3)
    assert result.mean_iou == pytest.approx(0.5)


def test_mean_iou_is_over_true_detections(vote, score) -> None:
    """A's polygon half as high: 0.5; B's exact: 1; a false one does not count."""
    polygons = {
        0: np.array(box(0, 0, 4, 1.5).exterior.coords)[:-1],
        1: np.array(box(4.1, 0, 8.1, 3).exterior.coords)[:-1],
        2: np.array(box(50, 50, 51, 51).exterior.coords)[:-1],
    }
    votes = vote(0, (0, 1, 2, 3), IN_A), vote(1, (4, 5, 6, 7), IN_B), vote(2, (1, 7), IN_C)
    assert score(*votes, polygons=polygons).mean_iou == pytest.approx(0.75)


def test_iou_by_hand() -> None:
    assert iou(box(0, 0, 2, 2), box(1, 0, 3, 2)) == pytest.approx(1 / 3)
    bow = Polygon([(0, 0), (2, 2), (2, 0), (0, 2)])
    assert 0.0 < iou(bow, box(0, 0, 2, 2)) <= 0.5


def test_piece_f1_by_hand(vote, score) -> None:
    """A with 3 of its 4 faces and one of B's; no B. 3 of 4 pieces right, 3 of 8 faces held."""
    result = score(vote(0, (0, 1, 2, 4), IN_A), entered=(0, 1))
    assert result.piece_f1 == pytest.approx(2 * 0.75 * 0.375 / 1.125)
    # Faces that the map does not hold are not the detector's fault: 3 of 3.
    mapped = score(vote(0, (0, 1, 2, 4), IN_A), entered=(0,), mapped=(0, 1, 2))
    assert mapped.piece_f1 == pytest.approx(2 * 0.75 / 1.75)
    # A right piece of a face that is held too little to be due is right, and no more.
    assert score(vote(0, (0, 1, 2), IN_A), entered=(0,), mapped=(0, 3)).piece_f1 == pytest.approx(
        2 * 0.5 / 1.5
    )


def test_storeys_limit_the_centre_rule(house, vote) -> None:
    upper = dataclasses.replace(house.truth.rooms[0], id=3, storey=1)
    truth = dataclasses.replace(house.truth, rooms=(*house.truth.rooms, upper))
    detection = [vote(0, (), IN_A)]
    for storeys, expected in (({1}, {3}), ({0}, {0})):
        result = score_rooms(detection, {}, truth, np.eye(4), expected, (), storeys)
        assert result.centre_recall == 1.0


def test_of_rooms_above_each_other_a_centre_is_in_the_one_whose_faces_it_has(house, vote) -> None:
    upper = dataclasses.replace(house.truth.rooms[0], id=3, storey=1, faces=())
    rooms = [*house.truth.rooms, upper]
    lower_first = match_centres([vote(0, (0, 1, 2, 3), IN_A)], rooms, np.eye(4))
    upper_first = match_centres([vote(0, (0, 1, 2, 3), IN_A)], rooms[::-1], np.eye(4))
    assert lower_first == upper_first == {0: 0}


MIXES = st.lists(
    st.tuples(
        st.lists(st.integers(-1, 11), max_size=6),
        st.tuples(st.floats(0.0, 8.0), st.floats(0.0, 4.5)),
    ),
    max_size=6,
)


@given(MIXES, st.randoms(use_true_random=False))
@settings(max_examples=60, deadline=None)
def test_order_and_frame_change_nothing(house, vote, score, mixes, random) -> None:
    votes = [vote(i, faces, centre) for i, (faces, centre) in enumerate(mixes)]
    polygons = {
        i: np.array(box(x - 1, y - 1, x + 1, y + 1).exterior.coords)[:-1]
        for i, (_, (x, y)) in enumerate(mixes)
    }
    first = score(*votes, polygons=polygons)
    shuffled = list(votes)
    random.shuffle(shuffled)
    assert score(*shuffled, polygons=polygons) == first

    # The same detections in a map that is turned and shifted, seen through its alignment.
    T = pose(so3_exp(np.array([0.0, 0.0, 0.7])), np.array([3.0, -8.0, 0.0]))
    R, t = T[:2, :2], T[:2, 3]
    turned = [
        dataclasses.replace(v, centre=tuple((np.array(v.centre) - t) @ R), inner=(0.0, 0.0))
        for v in votes
    ]
    moved = {i: (polygon - t) @ R for i, polygon in polygons.items()}
    other = score(*turned, polygons=moved, T=T)
    clear = all(
        room.polygon.exterior.distance(box(x, y, x, y).centroid) > 1e-6
        for room in house.truth.rooms
        for _, (x, y) in mixes
    )
    if clear:
        assert other.matches == first.matches
        assert other.precision == first.precision
        assert other.mean_iou == pytest.approx(first.mean_iou)


@given(MIXES)
@settings(max_examples=60, deadline=None)
def test_figures_stay_in_their_bounds(vote, score, mixes) -> None:
    votes = [vote(i, faces, centre) for i, (faces, centre) in enumerate(mixes)]
    result = score(*votes, entered=(0, 2))
    assert len(set(result.matches.values())) == len(result.matches)
    for name in ("precision", "recall", "centre_precision", "centre_recall", "piece_f1"):
        value = getattr(result, name)
        assert value is None or 0.0 <= value <= 1.0
