import time

import numpy as np
from houses import around, view

from semantics.clusters import ClusterConfig
from semantics.cycles import cycles, has_opposed_sides, mean_centre
from semantics.preprocess import Preprocessor

CONFIG = ClusterConfig()


def groups(count, pairs, probability=None):
    p = np.full(len(pairs), 0.9) if probability is None else np.array(probability)
    found = cycles(count, np.array(pairs, dtype=np.int64).reshape(-1, 2), p, CONFIG)
    return sorted(tuple(group.tolist()) for group in found.groups())


def test_four_in_a_ring_are_a_room_and_three_are_not():
    assert groups(4, [(0, 1), (1, 2), (2, 3), (0, 3)]) == [(0, 1, 2, 3)]
    assert groups(3, [(0, 1), (1, 2), (0, 2)]) == [(0, 1)]


def test_more_cycles_through_the_same_four_come_first():
    """Piece 3 is in a ring with 4, 5, 6, but in a full set of six edges with 0, 1, 2."""
    full = [(i, j) for i in range(4) for j in range(i)]
    ring = [(3, 4), (4, 5), (5, 6), (3, 6)]
    assert groups(7, full + ring) == [(0, 1, 2, 3), (4, 5)]


def test_fours_come_before_twos_and_likelier_ones_first():
    assert groups(4, [(0, 1), (1, 2), (2, 3)], [0.8, 0.95, 0.8]) == [(1, 2)]


def test_edges_below_the_threshold_do_not_count():
    assert groups(2, [(0, 1)], [0.4]) == []


def test_a_graph_where_everything_is_joined_takes_no_longer_than_its_size():
    i, j = np.triu_indices(200, 1)
    began = time.process_time()
    found = groups(200, np.column_stack([i, j]))
    assert len({k for group in found for k in group}) == sum(map(len, found))
    assert time.process_time() - began < 20.0  # all its cycles would take longer than the universe


def test_rooms_of_two_and_four_planes_need_sides_that_face_each_other():
    square = Preprocessor()(view(around(0, 0, 4, 4)).planes)
    two = [square.take(np.array(k)) for k in ([0, 2], [0, 1])]
    assert has_opposed_sides(square, CONFIG)
    assert [has_opposed_sides(sides, CONFIG) for sides in two] == [True, False]
    assert np.allclose(mean_centre(square), [2.0, 2.0], atol=0.1)
