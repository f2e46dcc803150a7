"""Causes of missed and false rooms, each made by hand in the hand-drawn house."""

from __future__ import annotations

from dataclasses import asdict

import numpy as np
import pytest

from eval.labels import TruthKeeper
from eval.score.failures import Evidence, Fates, Fault, Linked, linked_rooms, room_fates
from eval.score.votes import PieceVote, RoomVote, room_vote
from eval.seen import SeenFaces
from slam.core import Links, MapPlane, PlanePiece, Proposals, RoomProposal

CENTRES = ((2.0, 1.5), (6.1, 1.5), (4.0, 3.8))
A, B, C = ((0, 1, 2, 3), (4, 5, 6, 7), (8, 9, 10, 11))


def seen_of(house, *faces: int) -> SeenFaces:
    seen = SeenFaces(house.truth)
    for face in faces:
        points = house.returns(face, 0.0, house.truth.faces[face].length)
        labels = np.full(len(points), face, dtype=np.int32)
        for _ in range(3):
            seen.apply(seen.digest(labels, points, np.ones(len(points))), 0.0)
    return seen


def fates(house, seen, votes=(), mapped=range(12), linked=None, entered=(0, 1, 2)) -> Fates:
    """linked: rooms of which the edges join all pieces."""
    rooms = [face.room for face in house.truth.faces]
    parts = {vote.id: [rooms[face] if face >= 0 else -1 for face in vote.faces] for vote in votes}
    evidence = Evidence(
        seen,
        None if mapped is None else frozenset(mapped),
        None if linked is None else Linked({room: room for room in linked}, parts),
    )
    return room_fates(votes, house.truth, np.eye(4), entered, evidence)


def counts(*of: object, **known: object) -> dict[str, int]:
    found = fates(*of, **known).count()
    return {name: count for name, count in asdict(found).items() if count}


def vote(house, seen, faces, centre, id: int = 0) -> RoomVote:
    pieces = [PieceVote(f, 0.0, house.truth.faces[f].length if f >= 0 else 0.0) for f in faces]
    return room_vote(RoomProposal(id, (), None, np.array(centre), 1.0), pieces, seen)


def test_a_missed_room_has_the_first_cause_that_holds(house) -> None:
    seen = seen_of(house, *A, *B, 8, 9)
    assert counts(house, seen) == {"missed_unseen": 1, "missed_clustering": 2}
    assert counts(house, seen, entered=(0,)) == {"missed_clustering": 1}
    only_a = {"missed_unseen": 1, "missed_planes": 1, "missed_clustering": 1}
    assert counts(house, seen, mapped=A) == only_a
    edges = {"missed_unseen": 1, "missed_edges": 1, "missed_clustering": 1}
    assert counts(house, seen, linked=(1,)) == edges


def test_a_map_with_less_than_half_of_what_was_seen_lacks_planes(house) -> None:
    seen = seen_of(house, *C)
    assert counts(house, seen, mapped=(8, 9, 11), entered=(2,)) == {"missed_clustering": 1}
    assert counts(house, seen, mapped=(8, 9), entered=(2,)) == {"missed_planes": 1}


def test_a_room_that_is_found_is_no_failure(house) -> None:
    seen = seen_of(house, *A)
    assert counts(house, seen, [vote(house, seen, A, CENTRES[0])], entered=(0,)) == {}


def test_false_rooms(house) -> None:
    seen = seen_of(house, *A, *B, *C)

    def false(*votes: RoomVote, **known: object):
        found = counts(house, seen, votes, entered=(), **known)
        return {name.removeprefix("false_"): count for name, count in found.items()}

    assert false(vote(house, seen, (0, 1, -4, -5), CENTRES[0])) == {"planes": 1}
    two = vote(house, seen, (0, 1, 4, 5), CENTRES[0])
    assert false(two, linked=()) == {"edges": 1}
    assert false(two, linked=(0,)) == {"clustering": 1}
    assert false(two, mapped=B) == {"planes": 1}
    whole, again = vote(house, seen, A, CENTRES[0]), vote(house, seen, (0, 1, 2), CENTRES[0], 1)
    assert false(whole, again, linked=(0,)) == {"clustering": 1}


def test_what_lies_on_no_face_is_asked_before_what_was_seen(house) -> None:
    seen = seen_of(house, 0, 1)
    rubbish, ghost = (vote(house, seen, f, (20.0, 20.0)) for f in ((0, 1, -4, -5), (0, 1, -4)))
    assert counts(house, seen, [rubbish], entered=()) == {"false_planes": 1}
    assert counts(house, seen, [ghost], entered=()) == {"false_unseen": 1}


def test_without_planes_the_centre_rule_counts(house) -> None:
    seen = seen_of(house, *A)
    inside, outside = (vote(house, seen, (), centre) for centre in (CENTRES[0], (20.0, 20.0)))
    found = counts(house, seen, [inside, outside], mapped=None)
    assert found == {"missed_unseen": 2, "false_clustering": 1}


def test_rooms_are_named(house) -> None:
    """A is found, B is missed, one detection is made of B's faces and one of nobody's."""
    seen = seen_of(house, *A, *B)
    votes = [
        vote(house, seen, A, CENTRES[0], 5),
        vote(house, seen, (4, 5, -4), CENTRES[2], 6),
        vote(house, seen, (-4, -5), (20.0, 20.0), 7),
    ]
    judged = fates(house, seen, votes, entered=(0, 1))
    assert judged.found == {0: 5}
    assert judged.faults == (
        Fault(1, None, "clustering"),
        Fault(1, 6, "clustering"),
        Fault(None, 7, "planes"),
    )


@pytest.mark.parametrize(
    ("pairs", "rooms"),
    [
        ([(0, 1), (1, 2), (2, 3)], {0}),
        ([(0, 1)], {0}),  # half of its length
        ([(1, 3)], set()),
        ([(0, 1), (1, 2), (2, 3), (3, 4)], {0}),
        ([(0, 1), (1, 2), (2, 3), (3, 4), (4, 5)], set()),  # most of it is one room's: two in one
        ([(0, 1), (1, 2), (2, 3), (3, 4), (4, 5), (5, 6), (6, 7)], set()),
        ([], set()),
    ],
)
def test_rooms_of_edges(house, pairs, rooms) -> None:
    keeper, planes = mapped_house(house, *(house.whole(face) for face in range(8)))
    found = linked_rooms(links_of(house, planes, pairs), planes, keeper.voter, Proposals())
    assert found.rooms.keys() == rooms


def mapped_house(house, *stretches) -> tuple[TruthKeeper, list[MapPlane]]:
    """All is seen; a plane for each of these {face: (low, high)}."""
    keeper = house.keeper(house.whole(*range(12)), house.whole(*range(12)))
    pair = house.scan(0, 0.0, (2.0, 1.5, 0.0), house.whole(*range(12)))
    return keeper, [house.plane(i, pair, stretch) for i, stretch in enumerate(stretches)]


def links_of(house, planes, pairs) -> Links:
    return Links(tuple(map(house.piece, planes)), np.array(pairs, dtype=np.int64).reshape(-1, 2))


@pytest.mark.parametrize(
    ("pairs", "cause"),
    [
        ([(0, 1), (1, 2), (3, 4)], "edges"),  # 9 m of the room, and the 5 m that are told of
        ([(0, 1), (1, 2)], "edges"),
        ([(0, 1), (1, 2), (2, 3), (3, 4)], "clustering"),
        ([(0, 1), (1, 2), (2, 3)], "clustering"),  # half of the fragment is the room's
    ],
)
def test_a_fragment_is_the_fault_of_edges_that_left_it_apart(house, pairs, cause) -> None:
    """A room's outline in two detections, the second of which is false."""
    stretches = [house.whole(0), house.whole(1), {2: (0.0, 2.0)}, {2: (2.0, 4.0)}, house.whole(3)]
    keeper, planes = mapped_house(house, *stretches)
    pieces = [house.piece(plane) for plane in planes]
    proposals = Proposals(
        tuple(
            RoomProposal(id, tuple(pieces[place] for place in own), None, np.array(CENTRES[0]), 1.0)
            for id, own in ((5, (0, 1, 2)), (6, (3, 4)))
        )
    )
    votes, _ = keeper.voter.vote(planes, proposals)
    linked = linked_rooms(links_of(house, planes, pairs), planes, keeper.voter, proposals)
    evidence = Evidence(keeper.seen, frozenset(range(12)), linked)
    judged = room_fates(votes, house.truth, np.eye(4), (0,), evidence)
    assert judged == Fates({0: 5}, (Fault(0, 6, cause),))


def test_pieces_that_the_edges_do_not_know_tell_nothing(house) -> None:
    """A room that was kept though one of its planes is looked at no more, and the other has grown
    since."""
    keeper, planes = mapped_house(house, *(house.whole(face) for face in range(4)))
    old = PlanePiece(1, planes[1].points[:2, :2])
    kept = Proposals((RoomProposal(3, (old, PlanePiece(99, old.segment)), None, np.zeros(2), 1.0),))
    links = links_of(house, planes, [(0, 1), (1, 2)])
    found = linked_rooms(links, planes, keeper.voter, kept)
    assert found.parts == {3: [found.rooms[0], -1]}
