import numpy as np
import pytest
from houses import L_ROOM, around, view
from hypothesis import given, settings
from hypothesis import strategies as st
from shapely.geometry import Point, Polygon

from semantics.clusters import ClusterConfig, _linked, _odds, agglomerate, is_room
from semantics.outline import room_outlines
from semantics.preprocess import Preprocessor

CONFIG = ClusterConfig()


def pieces_of(sides):
    return Preprocessor()(view(sides).planes)


def groups(count, pairs, probability):
    found = agglomerate(count, np.array(pairs), np.array(probability), CONFIG)
    return {tuple(group.tolist()) for group in found.groups()}


def test_two_tight_groups_joined_by_one_weak_edge_stay_two():
    pairs = [(0, 1), (1, 2), (0, 2), (3, 4), (4, 5), (3, 5), (2, 3)]
    assert groups(6, pairs, [0.95] * 6 + [0.8]) == {(0, 1, 2), (3, 4, 5)} or groups(
        6, pairs, [0.95] * 6 + [0.3]
    ) == {(0, 1, 2), (3, 4, 5)}


def test_one_false_edge_does_not_glue_two_rooms():
    rooms = [[0, 1, 2, 3], [4, 5, 6, 7]]
    pairs, probability = [], []
    for i in range(8):
        for j in range(i + 1, 8):
            pairs.append((i, j))
            same = any(i in room and j in room for room in rooms)
            probability.append(0.98 if same or (i, j) == (3, 4) else 0.02)
    assert groups(8, pairs, probability) == {(0, 1, 2, 3), (4, 5, 6, 7)}


def test_no_edges_no_groups():
    found = agglomerate(3, np.zeros((0, 2), dtype=np.int64), np.zeros(0), CONFIG)
    assert [group.tolist() for group in found.groups()] == [[0], [1], [2]]
    assert found.confidence.tolist() == [0.0, 0.0, 0.0]


@settings(deadline=None, max_examples=25)
@given(st.integers(0, 10_000))
def test_every_piece_is_in_exactly_one_cluster(seed):
    rng = np.random.default_rng(seed)
    i, j = np.triu_indices(20, 1)
    chosen = rng.random(len(i)) < 0.4
    pairs = np.column_stack([i, j])[chosen]
    found = agglomerate(20, pairs, rng.random(len(pairs)), CONFIG)
    members = np.concatenate(found.groups())
    assert sorted(members.tolist()) == list(range(20))
    assert len(found.groups()) == len(found.confidence)


def test_what_is_a_room_and_what_is_not():
    square = around(0, 0, 4, 4)
    assert is_room(pieces_of(square), CONFIG)
    assert is_room(pieces_of(square[:3]), CONFIG)
    assert not is_room(pieces_of(square[:2]), CONFIG)
    corridor = around(0, 0, 10, 2)
    assert is_room(pieces_of([corridor[0], corridor[2]]), CONFIG)
    assert not is_room(pieces_of([square[0], square[2]]), CONFIG)


@pytest.mark.parametrize("sides", [around(1, 1, 5, 4), around(1, 1, 5, 4)[:3], L_ROOM])
def test_outlines_of_whole_rooms_and_of_rooms_with_a_side_unseen(sides):
    ((polygon, centre),) = room_outlines([pieces_of(sides)])
    corners = [side[0] for side in (around(1, 1, 5, 4) if len(sides) < 5 else sides)]
    true = Polygon(corners)
    found = Polygon(polygon)
    assert found.intersection(true).area / found.union(true).area > 0.97
    assert found.contains(Point(centre))


def test_outlines_do_not_depend_on_the_origin():
    ((near, _),) = room_outlines([pieces_of(L_ROOM)])
    away = [((a + 1000, b - 500), (c + 1000, d - 500)) for (a, b), (c, d) in L_ROOM]
    ((far, _),) = room_outlines([pieces_of(away)])
    assert np.allclose(near, far - [1000, -500], atol=1e-6)


@settings(deadline=None, max_examples=20)
@given(st.integers(0, 10_000))
def test_only_contradictions_are_thought_over_and_the_answer_is_the_same(seed):
    rng = np.random.default_rng(seed)
    count = 16
    i, j = np.triu_indices(count, 1)
    chosen = rng.random(len(i)) < 0.3
    pairs, p = np.column_stack([i, j])[chosen], rng.random(chosen.sum())
    alone = _linked(count, pairs, _odds(p, CONFIG))
    found = agglomerate(count, pairs, p, CONFIG).label
    assert np.array_equal(alone[:, None] == alone[None], found[:, None] == found[None])
