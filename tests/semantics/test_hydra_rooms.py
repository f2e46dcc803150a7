"""Filtration, plateau and assignment against hand-made vectors."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.testing import assert_allclose

from semantics.freespace.places import Places
from semantics.hydra.clustering import assign, by_modularity, by_widest_path
from semantics.hydra.config import RoomsConfig
from semantics.hydra.detector import rooms_of
from semantics.hydra.filtration import (
    cores,
    dilation,
    filtration,
    plateau,
    repeated,
    window,
)
from semantics.hydra.regions import RegionIds, centre, region

CHAIN = np.array([[0, 1], [1, 2], [2, 3]])


def records(counts: list[int], step: float = 1.0) -> list[tuple[float, int]]:
    return [((k + 1) * step, count) for k, count in enumerate(counts)]


def test_a_chain_falls_apart_edge_by_edge() -> None:
    found = filtration(4, CHAIN, np.array([0.4, 0.5, 0.6]), 1)
    assert found == [(0.4, 1), (0.5, 2), (0.6, 3)]


def test_small_components_do_not_count() -> None:
    found = filtration(4, CHAIN, np.array([0.4, 0.5, 0.6]), 3)
    assert found == [(0.4, 1), (0.5, 1), (0.6, 0)]


@pytest.mark.parametrize(("ratio", "expected"), [(0.1, (0.5, 2)), (0.4, (0.1, 1)), (0.0, (0.7, 3))])
def test_plateau(ratio: float, expected: tuple[float, int]) -> None:
    found = plateau(records([1, 1, 1, 1, 2, 2, 3, 2], 0.1), ratio)
    assert found is not None
    assert_allclose(found, expected)


def test_the_count_that_most_edges_in_a_row_have() -> None:
    counts = [1, 4, 2, 3, 2, 2, 5, 6, 6, 6, 9, 1, 1, 1, 2]
    assert repeated(records(counts)) == (8.0, 6)
    assert repeated(records([0, 0, 0, 2])) == (4.0, 2)
    assert repeated(records([0, 0])) is None


def test_plateau_of_nothing() -> None:
    assert plateau([], 0.5) is None
    assert plateau(records([0, 0]), 0.5) == (1.0, 0)


@pytest.mark.parametrize(("high", "expected"), [(3.1, (1, 2)), (10.1, (1, 4))])
def test_clipped_window(high: float, expected: tuple[int, int]) -> None:
    found = window(records([1, 2, 3, 4, 3, 2, 1, 0, 0, 0]), 1.1, high, clip=True)
    assert (found.start, found.stop) == expected


def test_window_without_records_in_it() -> None:
    everything = records([1, 2, 3])
    assert everything[window(everything, 5.0, 6.0)] == []
    assert everything[window(everything, 1.0, 0.5)] == everything


def two_rooms(narrow: float = 0.4) -> Places:
    """Twelve wide places each, in a row, joined over one narrow place; the end is less wide."""
    n = 25
    x = np.arange(n) * 1.0
    clearance = np.linspace(1.0, 1.5, n)
    clearance[12] = narrow
    edges = np.column_stack([np.arange(n - 1), np.arange(1, n)])
    widths = clearance[edges].min(axis=1)
    return Places(np.column_stack([x, 0 * x, 0 * x]), clearance, edges, widths)


@pytest.mark.parametrize("version", [1, 2])
def test_a_doorway_separates_two_rooms(version: int) -> None:
    rooms = rooms_of(two_rooms(), RoomsConfig(version=version, min_dilation=0.45))
    assert sorted(len(members) for members in rooms) in ([12, 12], [12, 13])


@pytest.mark.parametrize(("repeated", "count"), [(False, 2), (True, 1)])
def test_two_rooms_that_only_few_edges_tell_apart(repeated: bool, count: int) -> None:
    config = RoomsConfig(min_dilation=0.45, repeated=repeated)
    assert len(rooms_of(two_rooms(), config)) == count


def test_an_opening_as_wide_as_the_room_does_not() -> None:
    rooms = rooms_of(two_rooms(narrow=1.3), RoomsConfig())
    assert [len(members) for members in rooms] == [25]


def test_no_places_no_rooms() -> None:
    nothing = Places(np.zeros((0, 3)), np.zeros(0), np.zeros((0, 2), np.int64), np.zeros(0))
    assert rooms_of(nothing, RoomsConfig()) == []
    assert rooms_of(nothing, RoomsConfig(version=1)) == []


def test_cores_are_wider_than_the_dilation() -> None:
    found = cores(two_rooms(), 0.5, 10)
    assert [members.tolist() for members in found] == [list(range(12)), list(range(13, 25))]


def test_rooms_below_the_least_size_are_dropped() -> None:
    config = RoomsConfig(min_room=13)
    found = assign(two_rooms(), cores(two_rooms(), 0.5, 10), config)
    assert [len(members) for members in found] == [13]


def test_the_widest_way_decides() -> None:
    labels = np.array([0, -1, -1, 1])
    near = [[(1, 0.3)], [(0, 0.3), (2, 0.9)], [(1, 0.9), (3, 0.5)], [(2, 0.5)]]
    by_widest_path(labels, near)
    assert labels.tolist() == [0, 1, 1, 1]


def test_modularity_joins_a_place_to_its_stronger_neighbour() -> None:
    labels = np.array([0, 0, -1, 1, 1])
    near = [
        [(1, 1.0)],
        [(0, 1.0), (2, 0.2)],
        [(1, 0.2), (3, 0.8)],
        [(2, 0.8), (4, 1.0)],
        [(3, 1.0)],
    ]
    by_modularity(labels, near, 5, 1.0)
    assert labels.tolist() == [0, 0, 1, 1, 1]


def test_first_dilation_of_the_median_count() -> None:
    config = RoomsConfig(version=1, min_dilation=0.3, max_dilation=0.8, steps=4, min_component=5)
    assert dilation(two_rooms(0.45), config) == pytest.approx(0.5)


def test_a_centre_outside_all_spheres_moves_to_the_nearest() -> None:
    ring = np.array([[3.0, 0, 0], [-3.0, 0, 0]])
    places = Places(ring, np.array([1.0, 2.0]), np.array([[0, 1]]), np.array([0.5]))
    assert_allclose(centre(places, np.array([0, 1])), [-1.0, 0, 0])
    assert_allclose(centre(places, np.array([0])), [3.0, 0, 0])


def test_a_region_keeps_its_number_while_it_overlaps() -> None:
    places = two_rooms()
    left, right = region(places, np.arange(12)), region(places, np.arange(13, 25))
    ids = RegionIds()
    assert ids.update([left, right]) == [0, 1]
    assert ids.update([right, left]) == [1, 0]
    assert ids.update([right]) == [1]
    assert ids.update([left, right]) == [2, 1]
