from dataclasses import replace

import numpy as np
import pytest
from houses import L_ROOM, around, view
from hypothesis import given, settings
from hypothesis import strategies as st
from shapely.geometry import Point, Polygon

from semantics.clusters import Cluster, ClusterConfig, agglomerate, is_room, walls_of
from semantics.outline import room_outline
from semantics.preprocess import Preprocessor

CONFIG = ClusterConfig()


def pieces_of(sides):
    return Preprocessor()(view(sides).planes)


def groups(count, pairs, probability):
    found = agglomerate(count, np.array(pairs), np.array(probability), CONFIG)
    return {tuple(cluster.members.tolist()) for cluster in found}


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
    assert [cluster.members.tolist() for cluster in found] == [[0], [1], [2]]


@settings(deadline=None, max_examples=25)
@given(st.integers(0, 10_000))
def test_every_piece_is_in_exactly_one_cluster(seed):
    rng = np.random.default_rng(seed)
    i, j = np.triu_indices(20, 1)
    chosen = rng.random(len(i)) < 0.4
    pairs = np.column_stack([i, j])[chosen]
    found = agglomerate(20, pairs, rng.random(len(pairs)), CONFIG)
    members = np.concatenate([cluster.members for cluster in found])
    assert sorted(members.tolist()) == list(range(20))


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
    polygon, centre = room_outline(pieces_of(sides))
    corners = [side[0] for side in (around(1, 1, 5, 4) if len(sides) < 5 else sides)]
    true = Polygon(corners)
    found = Polygon(polygon)
    assert found.intersection(true).area / found.union(true).area > 0.97
    assert found.contains(Point(centre))


def test_outlines_do_not_depend_on_the_origin():
    near, _ = room_outline(pieces_of(L_ROOM))
    away = [((a + 1000, b - 500), (c + 1000, d - 500)) for (a, b), (c, d) in L_ROOM]
    far, _ = room_outline(pieces_of(away))
    assert np.allclose(near, far - [1000, -500], atol=1e-6)


def test_a_wall_needs_two_faces_back_to_back_and_near():
    face = ((0.0, 0.0), (4.0, 0.0))
    cases = {
        "back to back": (((4.0, -0.2), (0.0, -0.2)), 1),
        "face to face": (((4.0, 3.0), (0.0, 3.0)), 0),
        "too far": (((4.0, -1.5), (0.0, -1.5)), 0),
        "beside": (((9.0, -0.2), (5.0, -0.2)), 0),
        "same side": (((0.0, -0.5), (4.0, -0.5)), 0),
    }
    for name, (other, expected) in cases.items():
        pieces = pieces_of([face, other])
        found = walls_of(pieces, np.array([[0, 1]]), np.array([0.99]), [], CONFIG)
        assert len(found) == expected, name
    pieces = pieces_of([face, cases["back to back"][0]])
    assert walls_of(pieces, np.array([[0, 1]]), np.array([0.1]), [], CONFIG) == []


def test_a_face_in_two_pieces_makes_one_wall_and_two_rooms_behind_it_make_two():
    long = ((0.0, 0.0), (8.0, 0.0))
    behind = [((8.0, -0.2), (5.0, -0.2)), ((4.0, -0.2), (0.0, -0.2))]
    pieces = pieces_of([long, *behind])
    pieces = replace(pieces, plane_id=np.array([0, 1, 1]))
    pairs, sure = np.array([[0, 1], [0, 2]]), np.array([0.9, 0.9])
    one_room = [Cluster(np.array([0]), 0.9), Cluster(np.array([1, 2]), 0.9)]
    assert walls_of(pieces, pairs, sure, one_room, CONFIG) == [(0, 2, 0.9)]
    two_rooms = [Cluster(np.array([k]), 0.9) for k in range(3)]
    assert len(walls_of(pieces, pairs, sure, two_rooms, CONFIG)) == 2
