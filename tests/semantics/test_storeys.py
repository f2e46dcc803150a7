"""One detector for each storey: rooms above one another do not know of each other."""

from __future__ import annotations

from dataclasses import replace
from functools import partial

import numpy as np
from houses import TWO_ROOMS_AND_A_CORRIDOR, view

from semantics.detector import GnnDetector, make_detector
from semantics.storeys import STRIDE, by_storey
from slam.core import Linking, MapView, Proposals

UP = np.array([0.0, 0.0, 2.9])


def _stacked() -> MapView:
    """The house twice, one above the other; planes 0 to 11 and 100 to 111."""
    below = view(TWO_ROOMS_AND_A_CORRIDOR).planes
    above = [
        replace(plane, id=100 + plane.id, points=plane.points + UP, storey=1) for plane in below
    ]
    return MapView(0.0, [*below, *above], ())


def _planes(proposals: Proposals, storey: int) -> set[frozenset[int]]:
    return {
        frozenset(piece.plane_id for piece in room.pieces)
        for room in proposals.rooms
        if room.storey == storey
    }


def test_a_single_storey_is_asked_as_it_is() -> None:
    house = view(TWO_ROOMS_AND_A_CORRIDOR)
    plain, wrapped = GnnDetector().update(house), by_storey(GnnDetector).update(house)
    assert [room.id for room in wrapped.rooms] == [room.id for room in plain.rooms]
    assert _planes(wrapped, 0) == _planes(plain, 0)


def test_storeys_above_one_another_are_found_alike() -> None:
    detector = by_storey(GnnDetector)
    found = detector.update(_stacked())
    below, above = _planes(found, 0), _planes(found, 1)
    assert len(below) == 3
    assert above == {frozenset(100 + plane for plane in room) for room in below}
    ids = [room.id for room in found.rooms]
    assert len(set(ids)) == 6
    assert {i // STRIDE for i in ids} == {0, 1}
    assert len({wall.id for wall in found.walls}) == len(found.walls) == 6
    again = detector.update(_stacked())
    assert [room.id for room in again.rooms] == ids
    assert all(a is b for a, b in zip(found.rooms, again.rooms, strict=True))
    assert all(a is b for a, b in zip(found.walls, again.walls, strict=True))


def test_one_map_of_both_would_confuse_them() -> None:
    flat = MapView(0.0, [replace(plane, storey=0) for plane in _stacked().planes], ())
    assert len(_planes(GnnDetector().update(flat), 0)) < 6


def test_rooms_of_the_first_storey_keep_their_ids_when_there_is_a_second() -> None:
    detector = by_storey(GnnDetector)
    first = detector.update(view(TWO_ROOMS_AND_A_CORRIDOR))
    both = detector.update(_stacked())
    assert {room.id for room in first.rooms} < {room.id for room in both.rooms}


def test_links_of_all_storeys() -> None:
    detector = by_storey(partial(make_detector, "gnn"))
    assert isinstance(detector, Linking)
    assert len(detector.links().pairs) == 0
    detector.update(view(TWO_ROOMS_AND_A_CORRIDOR))
    count = len(detector.links().pairs)
    detector.update(_stacked())
    links = detector.links()
    assert len(links.pairs) == 2 * count
    storey = np.array([piece.plane_id >= 100 for piece in links.pieces])
    assert (storey[links.pairs[:, 0]] == storey[links.pairs[:, 1]]).all()


def test_a_detector_without_links_stays_one() -> None:
    class Nothing:
        def update(self, view: MapView) -> Proposals:
            return Proposals()

    assert not isinstance(by_storey(Nothing), Linking)
