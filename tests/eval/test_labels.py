"""Point ids decode to the truth, and votes follow from labels alone."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from looking import keep

from eval.labels import TruthKeeper
from eval.score.votes import inside, majority, strict_owner
from slam.core import (
    InputError,
    MapView,
    PlanePiece,
    Proposals,
    RoomProposal,
    RunError,
    WallProposal,
    point_ids,
)
from worlds.truth import CLUTTER, FLOOR, NO_FACE


def room(id: int, *pieces: PlanePiece, centre=(2.0, 1.5), polygon=None) -> RoomProposal:
    return RoomProposal(id, pieces, polygon, np.array(centre), 1.0)


def test_ids_decode_to_labels_and_true_points(house) -> None:
    keeper = TruthKeeper(house.truth)
    pairs = [house.scan(k, 0.1 * k, (2, 1.5, 0), house.whole(0, k)) for k in (1, 2, 3)]
    for (scan, truth), keyframe in zip(pairs, (True, False, True), strict=True):
        keep(keeper, scan, truth, keyframe)
    for scan, truth in (pairs[2], pairs[0]):
        pick = np.random.default_rng(0).permutation(len(scan))[:50]
        ids = point_ids(scan.index, pick)
        assert np.array_equal(keeper.faces_of(ids), truth.face[pick])
        assert np.array_equal(keeper.true_points(ids), truth.points_world[pick])
    assert keeper.keyframe_scans == [0, 2]
    assert len(keeper.trajectory) == 3
    with pytest.raises(InputError, match="not of a keyframe"):
        keeper.faces_of(point_ids(2, np.array([0])))
    with pytest.raises(InputError, match="not of a keyframe"):
        keeper.faces_of(point_ids(9, np.array([0])))


def test_only_the_named_returns_are_kept(house) -> None:
    keeper = TruthKeeper(house.truth)
    scan, truth = house.scan(4, 0.4, (2, 1.5, 0), house.whole(0, 1))
    keep(keeper, scan, truth, True, point_index=np.array([700, 3, 3, 12]))
    kept = np.array([3, 12, 700])
    assert np.array_equal(keeper.faces_of(point_ids(4, kept)), truth.face[kept])
    with pytest.raises(InputError, match="not of a keyframe"):
        keeper.faces_of(point_ids(4, np.array([4])))


def test_a_scan_twice_is_refused(house) -> None:
    keeper = house.keeper(house.whole(0))
    with pytest.raises(InputError, match="twice"):
        keep(keeper, *house.scan(0, 0.0, (2, 1.5, 0), house.whole(0)), keyframe=True)


def test_the_start_is_that_of_the_first_sweep(house) -> None:
    keeper = TruthKeeper(house.truth)
    for k in (1, 2):
        keep(keeper, *house.scan(k, 0.1 * k, (2, 1.5, 0), house.whole(0)), keyframe=False)
    assert keeper.start == pytest.approx(0.0)


def test_majority_by_hand() -> None:
    assert majority(np.array([5, 5, 2], np.int32)) == (5, pytest.approx(2 / 3))
    assert majority(np.array([5, 2], np.int32)) == (2, 0.5)
    assert majority(np.array([7, CLUTTER], np.int32)) == (CLUTTER, 0.5)
    assert majority(np.array([FLOOR, FLOOR, 1], np.int32))[0] == FLOOR
    assert majority(np.array([], np.int32)) == (NO_FACE, 0.0)


@pytest.mark.parametrize(
    ("rooms", "owner"),
    [
        ([0, 0, 0], 0),
        ([0, 0, 1], 0),
        ([0, 0, 1, 1], None),
        ([0, None], None),
        ([0, 0, None], 0),
        ([None, None, 0], None),
        ([0, 1, 2], None),
        ([], None),
    ],
)
def test_strict_owner(rooms: list[int | None], owner: int | None) -> None:
    assert strict_owner(rooms) == owner
    assert strict_owner(rooms[::-1]) == owner


def test_a_piece_is_judged_by_its_own_points_not_by_its_plane(house) -> None:
    """South of A and of B are one plane; cut at x = 4.05, each piece has one room."""
    looks = house.whole(0, 4)
    pair = house.scan(0, 0.0, (2, 1.5, 0), looks)
    keeper = TruthKeeper(house.truth)
    keep(keeper, *pair, keyframe=True)
    plane = house.plane(0, pair, looks)
    left = PlanePiece(0, np.array([[-1.0, 0.0], [4.05, 0.0]]))
    right = PlanePiece(0, np.array([[4.05, 0.0], [8.1, 0.0]]))
    beside = PlanePiece(0, np.array([[20.0, 0.0], [30.0, 0.0]]))
    view = house.view(plane)
    (first, second), _ = keeper.votes(view, Proposals((room(0, left), room(1, right, beside))))
    assert first.faces == (0,)
    assert first.owner == 0
    assert first.coverage == pytest.approx(1.0)
    assert second.faces == (4, NO_FACE)
    assert second.owner is None


def test_labels_ignore_where_the_map_has_drifted_to(house) -> None:
    """A map 100 m off votes as one in place: labels need no alignment."""
    looks = house.whole(0, 1)
    pair = house.scan(0, 0.0, (2, 1.5, 0), looks)
    keeper = TruthKeeper(house.truth)
    keep(keeper, *pair, keyframe=True)
    T = np.eye(4)
    T[:3, 3] = 100.0, -50.0, 3.0
    planes = [house.plane(i, pair, {i: looks[i]}, T_map_world=T) for i in (0, 1)]
    proposal = room(0, *map(house.piece, planes))
    (vote,), _ = keeper.votes(house.view(*planes), Proposals((proposal,)))
    assert vote.faces == (0, 1)
    assert vote.coverage == pytest.approx(1.0)


def test_a_piece_of_an_unknown_plane_is_wrong(house) -> None:
    keeper = house.keeper(house.whole(0))
    piece = PlanePiece(77, np.array([[0.0, 0.0], [1.0, 0.0]]))
    (vote,), (wall,) = keeper.votes(
        house.view(), Proposals((room(0, piece),), (WallProposal(0, (piece, piece), 1.0),))
    )
    assert vote.faces == (NO_FACE,)
    assert wall.faces == (NO_FACE, NO_FACE)


def test_a_repeated_id_is_a_failed_run(house) -> None:
    with pytest.raises(RunError, match="room id 3"):
        house.keeper().votes(house.view(), Proposals((room(3), room(3))))


def test_votes_follow_a_plane_that_grows(house) -> None:
    """The same plane id with another revision and more points is voted on afresh."""
    looks = house.whole(0, 4)
    pair = house.scan(0, 0.0, (2, 1.5, 0), looks)
    keeper = TruthKeeper(house.truth)
    keep(keeper, *pair, keyframe=True)
    wide = PlanePiece(0, np.array([[-1.0, 0.0], [9.0, 0.0]]))
    small = house.plane(0, pair, {4: (0.0, 1.0)})
    grown = dataclasses.replace(house.plane(0, pair, {0: (0.0, 4.0), 4: (0, 1)}), revision=1)
    faces = [
        keeper.votes(house.view(plane), Proposals((room(0, wide),)))[0][0].faces
        for plane in (small, grown)
    ]
    assert faces == [(4,), (0,)]


def test_an_instant_uses_what_was_seen_by_then(house) -> None:
    """Two faces of A known: a whole room then; once all of A has been seen, 3 m of 14 m."""
    first = house.scan(0, 0.0, (2, 1.5, 0), house.whole(1))
    keeper = TruthKeeper(house.truth)
    keep(keeper, *first, keyframe=True)
    plane = house.plane(0, first, house.whole(1))
    proposals = Proposals((room(0, house.piece(plane)),))
    keeper.snapshot(0.0, 0.01, house.view(plane), proposals)
    keep(keeper, *house.scan(1, 0.1, (2, 1.5, 0), house.whole(0, 2, 3)), keyframe=True)
    keeper.snapshot(0.1, 0.01, house.view(plane), proposals)
    coverages = [instant.rooms[0].coverage for instant in keeper.instants]
    assert coverages == pytest.approx([1.0, 3.0 / 14.0])


def test_unchanged_votes_are_shared_between_instants(house) -> None:
    pair = house.scan(0, 0.0, (2, 1.5, 0), house.whole(1))
    keeper = TruthKeeper(house.truth)
    keep(keeper, *pair, keyframe=True)
    plane = house.plane(0, pair, house.whole(1))
    for stamp in (0.0, 0.1):
        view = MapView(stamp, (plane,), ())
        keeper.snapshot(stamp, 0.0, view, Proposals((room(0, house.piece(plane)),)))
    assert keeper.instants[0].rooms[0] is keeper.instants[1].rooms[0]


def test_a_centre_outside_its_own_polygon_gets_a_point_inside(house) -> None:
    corner = np.array([[0, 0], [4, 0], [4, 1], [1, 1], [1, 4], [0, 4.0]])
    keeper = house.keeper()
    rooms = (
        room(0, centre=(2.0, 2.0), polygon=corner),
        room(1, centre=(0.5, 0.5), polygon=corner),
        room(2, centre=(9.0, 9.0)),
    )
    votes, _ = keeper.votes(house.view(), Proposals(rooms))
    x, y = votes[0].inner
    assert (0 < x < 1 and 0 < y < 4) or (0 < x < 4 and 0 < y < 1)
    assert votes[0].centre == (2.0, 2.0)
    assert votes[1].inner == (0.5, 0.5)
    assert votes[2].inner == (9.0, 9.0)


def test_inside_by_hand() -> None:
    corner = np.array([[0, 0], [4, 0], [4, 1], [1, 1], [1, 4], [0, 4.0]])
    for outline in (corner, corner[::-1]):
        assert inside(outline, 0.5, 3.0)
        assert inside(outline, 3.0, 0.5)
        assert not inside(outline, 2.0, 2.0)
        assert not inside(outline, -1.0, 0.5)
        assert not inside(outline, 5.0, 0.5)


def test_a_piece_covers_only_its_own_face(house) -> None:
    """Half of A's south and, by mistake, some of its east: the half of south, 2 m of 7."""
    looks = house.whole(0, 1)
    pair = house.scan(0, 0.0, (2, 1.5, 0), looks)
    keeper = TruthKeeper(house.truth)
    keep(keeper, *pair, keyframe=True)
    plane = house.plane(0, pair, {0: (2.0, 4.0), 1: (0.0, 1.0)})
    wide = PlanePiece(0, np.array([[-1.0, 0.0], [9.0, 0.0]]))
    (vote,), _ = keeper.votes(house.view(plane), Proposals((room(0, wide),)))
    assert vote.faces == (0,)
    assert vote.coverage == pytest.approx(2.0 / 7.0)
