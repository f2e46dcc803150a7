from dataclasses import replace

import numpy as np
import pytest
from houses import TWO_ROOMS_AND_A_CORRIDOR, around, moved, plane, view
from hypothesis import given, settings
from hypothesis import strategies as st
from shapely.geometry import LineString

from semantics.lines import segment_gaps
from semantics.neighbours import REACH, SHORT, TOUCH, closest_segments
from semantics.pieces import Pieces
from semantics.preprocess import Preprocessor
from semantics.proximity import (
    InvariantFeatures,
    PaperFeatures,
    features_named,
    proximity_graph,
)
from slam.core import InputError


def pieces_of(sides):
    return Preprocessor()(view(sides).planes)


def random_pieces(count, seed=0):
    rng = np.random.default_rng(seed)
    start = rng.uniform(0, 60, (count, 2))
    angle = rng.uniform(-np.pi, np.pi, count)
    direction = np.column_stack([np.cos(angle), np.sin(angle)])
    end = start + rng.uniform(0.5, 6, count)[:, None] * direction
    normal = np.column_stack([-direction[:, 1], direction[:, 0]])
    height = np.tile([0.0, 2.5], (count, 1))
    return Pieces(np.arange(count), np.stack([start, end], axis=1), normal, height)


def test_every_piece_has_its_nearest_ones():
    pieces = random_pieces(60)
    i, j, gap = closest_segments(pieces, 5)
    lines = [LineString(s) for s in pieces.segment]
    joined = {frozenset(pair) for pair in zip(i.tolist(), j.tolist(), strict=True)}
    for k, line in enumerate(lines):
        others = sorted(
            ((line.distance(o) + TOUCH) / (o.length + SHORT), m)
            for m, o in enumerate(lines)
            if m != k
        )
        near = [m for _, m in others[:5] if line.distance(lines[m]) < REACH]
        assert all(frozenset((k, m)) in joined for m in near)
    assert (i < j).all()
    assert len(gap) == len(joined)


def test_a_large_map_gives_nearly_the_same_pairs_as_looking_at_all():
    pieces = random_pieces(400)
    i, j, _ = closest_segments(pieces, 15)
    a, b = np.triu_indices(400, 1)
    gap = segment_gaps(pieces.segment, a, b)
    rank = np.full((400, 400), np.inf)
    rank[a, b] = rank[b, a] = gap
    nearest = np.argsort((rank + TOUCH) / (pieces.length + SHORT), axis=1)[:, :8]
    joined = {frozenset(pair) for pair in zip(i.tolist(), j.tolist(), strict=True)}
    found = [frozenset((k, int(m))) in joined for k in range(400) for m in nearest[k]]
    assert np.mean(found) > 0.99


@settings(deadline=None)
@given(st.floats(-3.0, 3.0), st.floats(-50, 50), st.floats(-50, 50))
def test_no_motion_of_the_map_changes_our_features(angle, x, y):
    still = proximity_graph(random_pieces(12), InvariantFeatures())
    pieces = random_pieces(12)
    c, s = np.cos(angle), np.sin(angle)
    R = np.array([[c, -s], [s, c]])
    there = Pieces(
        pieces.plane_id, pieces.segment @ R.T + [x, y], pieces.normal @ R.T, pieces.height
    )
    turned = proximity_graph(there, InvariantFeatures())
    assert np.array_equal(still.source, turned.source)
    # The last feature is a yes or no about lines that cross: rounding may decide it.
    assert np.allclose(still.edge[:, :-1], turned.edge[:, :-1], atol=1e-6)
    assert np.allclose(still.node, turned.node, atol=1e-9)


def test_what_stands_about_does_not_come_between_the_walls_of_a_room():
    hall = around(0.0, 0.0, 20.0, 15.0)
    chairs = [((x, 1.0), (x + 0.4, 1.0)) for x in np.arange(1.0, 19.0, 0.9).tolist()]
    heights = [2.5] * 4 + [1.0] * len(chairs)
    planes = [
        plane(n, s, h) for n, (s, h) in enumerate(zip([*hall, *chairs], heights, strict=True))
    ]
    i, j, _ = closest_segments(Preprocessor()(planes), 5)
    joined = set(zip(i.tolist(), j.tolist(), strict=True))
    assert {(a, b) for a in range(4) for b in range(a + 1, 4)} <= joined


def test_heights_are_told_apart_wherever_the_floor_is():
    pieces = random_pieces(12)
    low = replace(pieces, height=pieces.height * np.array([1.0, 0.3]))
    sunk = replace(pieces, height=pieces.height - 7.0)
    graphs = [proximity_graph(p, InvariantFeatures()) for p in (pieces, low, sunk)]
    assert not np.allclose(graphs[0].node, graphs[1].node)
    assert np.allclose(graphs[0].node, graphs[2].node)
    assert np.allclose(graphs[0].edge, graphs[2].edge)


def test_the_papers_features_are_what_the_paper_says():
    pieces = pieces_of(TWO_ROOMS_AND_A_CORRIDOR[:2])
    graph = proximity_graph(pieces, PaperFeatures())
    assert graph.node[0] == pytest.approx([0.0, 1.0, 4.0 / 6.0], abs=0.02)
    away = (pieces.centre[1] - pieces.centre[0]) / 6.0
    assert graph.edge[0] == pytest.approx([*away, 0.0], abs=0.02)
    assert graph.edge[1] == pytest.approx([*-away, 0.0], abs=0.02)


def test_a_wall_between_two_pieces_is_noticed():
    sides = [((0, 0), (4, 0)), ((4, 6), (0, 6)), ((0, 3), (4, 3))]
    graph = proximity_graph(pieces_of(sides), InvariantFeatures())
    blocked = {tuple(p): b for p, b in zip(graph.pairs.tolist(), graph.edge[:, -1], strict=False)}
    assert blocked[0, 1] == 1.0
    assert blocked[0, 2] == 0.0


def test_a_barrier_is_between_all_on_its_two_sides():
    sides = [((0, 0), (4, 0)), ((4, 0), (9, 0)), ((9, 2), (4, 2)), ((4, 2), (0, 2))]
    pieces = replace(pieces_of(sides), barrier=np.array([[[4.0, 0.0], [4.0, 2.0]]]))
    graph = proximity_graph(pieces, InvariantFeatures())
    blocked = {tuple(p): b for p, b in zip(graph.pairs.tolist(), graph.edge[:, -1], strict=False)}
    assert {pair for pair, b in blocked.items() if b} == {(0, 1), (0, 2), (1, 3), (2, 3)}


def test_unknown_features_are_refused():
    with pytest.raises(InputError, match="expected one of"):
        features_named("magic")


@pytest.mark.parametrize("count", [0, 1])
def test_too_few_pieces_have_no_edges(count):
    graph = proximity_graph(random_pieces(count), InvariantFeatures())
    assert len(graph.source) == 0
    assert len(graph.node) == count


def test_moved_houses_are_houses():
    assert len(pieces_of(moved(TWO_ROOMS_AND_A_CORRIDOR, 0.5, (3.0, 4.0)))) == 12
