from dataclasses import replace

import numpy as np
from houses import view

from semantics.preprocess import Preprocessor
from semantics.walls import WallConfig, faces_of, walls_of

CONFIG = WallConfig()


def pieces_of(sides):
    return Preprocessor()(view(sides).planes)


def found(pieces, pairs, probability, label):
    return walls_of(
        pieces, np.array(pairs), np.array(probability), np.array(label), CONFIG
    ).tolist()


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
        assert len(found(pieces, [[0, 1]], [0.99], [0, 1])) == expected, name
    pieces = pieces_of([face, cases["back to back"][0]])
    assert found(pieces, [[0, 1]], [0.1], [0, 1]) == []


def test_a_face_in_two_pieces_makes_one_wall_and_two_rooms_behind_it_make_two():
    long = ((0.0, 0.0), (8.0, 0.0))
    behind = [((8.0, -0.2), (5.0, -0.2)), ((4.0, -0.2), (0.0, -0.2))]
    pieces = pieces_of([long, *behind])
    pieces = replace(pieces, plane_id=np.array([0, 1, 1]))
    pairs, sure = [[0, 1], [0, 2]], [0.9, 0.9]
    assert found(pieces, pairs, sure, [0, 1, 1]) == [1]
    assert found(pieces, pairs, sure, [-1, -1, -1]) == [1]


def test_one_long_face_has_a_wall_with_each_of_two_rooms_behind_it():
    sides = [((0.0, 0.0), (8.0, 0.0)), ((8.0, -0.2), (5.0, -0.2)), ((4.0, -0.2), (0.0, -0.2))]
    sides += [((5.0, -0.2), (5.0, -4.0)), ((4.0, -4.0), (4.0, -0.2))]
    pieces = pieces_of(sides)
    one_plane = replace(pieces, plane_id=np.array([0, 1, 1, 2, 3]))
    assert found(one_plane, [[0, 1], [0, 2]], [0.9, 0.9], [0, 1, 2, 1, 2]) == [0, 1]


def test_no_pairs_no_walls():
    pieces = pieces_of([((0.0, 0.0), (4.0, 0.0))])
    none = walls_of(pieces, np.zeros((0, 2), np.int64), np.zeros(0), np.zeros(1, np.int64), CONFIG)
    assert len(none) == 0


def test_a_face_is_told_once_though_it_was_mapped_twice():
    face = ((0.0, 0.0), (4.0, 0.0))
    twins = [((4.0, -0.15), (0.0, -0.15)), ((3.9, -0.3), (0.1, -0.3))]
    pieces = pieces_of([face, *twins])
    assert len(found(pieces, [[0, 1], [0, 2]], [0.9, 0.9], [0, 1, 1])) == 1


def test_a_walls_face_is_what_lies_back_to_back():
    pieces = pieces_of([((0.0, 0.0), (8.0, 0.0)), ((5.0, -0.2), (2.0, -0.2))])
    ((first, second),) = faces_of(pieces, np.array([[0, 1]]))
    assert np.allclose(np.sort(first.segment[:, 0]), [2.0, 5.0], atol=0.02)
    assert np.allclose(first.segment[:, 1], 0.0, atol=1e-9)
    assert np.allclose(np.sort(second.segment[:, 0]), [2.0, 5.0], atol=0.02)
