"""The outline of a room from pieces of its sides, held against rooms that are known."""

from __future__ import annotations

import numpy as np
import pytest
from shapely.geometry import Point, Polygon
from shapely.geometry.polygon import orient

from semantics.outline import room_outlines
from semantics.pieces import Pieces
from slam.core import Array
from worlds.generator import GeneratorConfig, random_plan

SHAPES = {
    "square": [(0, 0), (4, 0), (4, 4), (0, 4)],
    "corridor round a corner": [(0, 0), (20, 0), (20, 20), (18, 20), (18, 2), (0, 2)],
    "T": [(0, 0), (12, 0), (12, 2), (7, 2), (7, 9), (5, 9), (5, 2), (0, 2)],
    "U": [(0, 0), (14, 0), (14, 10), (12, 10), (12, 2), (2, 2), (2, 10), (0, 10)],
    "cross": [
        *[(4, 0), (6, 0), (6, 4), (10, 4), (10, 6), (6, 6)],
        *[(6, 10), (4, 10), (4, 6), (0, 6), (0, 4), (4, 4)],
    ],
}


def _sides(polygon: Polygon, cut: float = 0.0) -> Array:
    """(K, 2, 2) the edges, the inside on their left, shorter by ``cut`` of their length at each
    end."""
    corners = np.array(orient(polygon).exterior.coords)
    start, end = corners[:-1], corners[1:]
    return np.stack([start + cut * (end - start), end - cut * (end - start)], axis=1)


def _pieces(segment: Array) -> Pieces:
    """The inside is on the left of each segment (K, 2, 2); planes keep their ends in any order."""
    run = segment[:, 1] - segment[:, 0]
    run = run / np.linalg.norm(run, axis=1, keepdims=True)
    turned = np.where((np.arange(len(segment)) % 2 == 0)[:, None, None], segment, segment[:, ::-1])
    normal = np.column_stack([-run[:, 1], run[:, 0]])
    return Pieces(np.arange(len(segment)), turned, normal, np.tile([0.0, 2.5], (len(segment), 1)))


def _likeness(segment: Array, true: Polygon) -> float:
    ((polygon, centre),) = room_outlines([_pieces(segment)])
    found = Polygon(polygon)
    assert found.is_valid
    assert found.covers(Point(centre))
    return float(found.intersection(true).area / found.union(true).area)


@pytest.mark.parametrize("name", SHAPES)
@pytest.mark.parametrize("cut", [0.0, 0.1])
def test_a_room_of_any_shape_is_found_from_its_sides_in_any_order(name: str, cut: float) -> None:
    true = Polygon(SHAPES[name])
    sides = _sides(true, cut)
    for seed in range(5):
        order = np.random.default_rng(seed).permutation(len(sides))
        assert _likeness(sides[order], true) > 1.0 - 1e-9


def test_an_unseen_side_is_closed_straight() -> None:
    true = Polygon(SHAPES["corridor round a corner"])
    sides = _sides(true)
    for missing in range(len(sides)):
        assert _likeness(np.delete(sides, missing, axis=0), true) > 0.85


def test_a_pillar_is_left_out_and_so_is_a_pier() -> None:
    true = Polygon(SHAPES["square"])
    pillar = _sides(Polygon([(1.5, 1.5), (2.0, 1.5), (2.0, 2.0), (1.5, 2.0)]))[:, ::-1]
    assert _likeness(np.concatenate([_sides(true), pillar]), true) > 1.0 - 1e-9
    pier = np.array([[[1.0, 0.3], [1.8, 0.3]]])
    assert _likeness(np.concatenate([pier, _sides(true)]), true) > 1.0 - 1e-9


def test_two_halves_of_a_corridor_seen_from_its_ends_are_one() -> None:
    true = Polygon([(0, 0), (30, 0), (30, 2), (0, 2)])
    seen = [[(0, 2), (0, 0)], [(0, 0), (4, 0)], [(26, 0), (30, 0)], [(30, 0), (30, 2)]]
    seen += [[(30, 2), (26, 2)], [(4, 2), (0, 2)]]
    assert _likeness(np.array(seen, dtype=float), true) > 1.0 - 1e-9


def test_rooms_of_random_buildings() -> None:
    config = GeneratorConfig(carve=0.4, join=0.4, chamfer=0.1)
    shares = []
    for seed in range(12):
        plan = random_plan(np.random.default_rng(seed), config)
        for room in plan.storeys[0].rooms:
            shares.append(_likeness(_sides(room.outline, 0.08), room.outline))
    assert len(shares) > 80
    assert np.mean(shares) > 0.98
    assert np.mean(np.array(shares) < 0.9) < 0.03


def test_many_rooms_at_once_are_as_each_alone() -> None:
    rooms = [_pieces(_sides(Polygon(corners), 0.05)) for corners in SHAPES.values()]
    rooms.insert(2, _pieces(np.array([[[0.0, 0.0], [2.0, 0.0]]])))
    for pieces, (polygon, centre) in zip(rooms, room_outlines(rooms), strict=True):
        ((alone, its_centre),) = room_outlines([pieces])
        np.testing.assert_array_equal(polygon, alone)
        np.testing.assert_array_equal(centre, its_centre)
    assert room_outlines([]) == []


def test_no_polygon_makes_a_hull() -> None:
    ((polygon, centre),) = room_outlines([_pieces(np.array([[[0.0, 0.0], [2.0, 0.0]]]))])
    assert Polygon(polygon).covers(Point(centre))
    assert Polygon(polygon).area < 0.3
