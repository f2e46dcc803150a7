import subprocess
import sys
from dataclasses import replace

import numpy as np
import pytest
from houses import L_ROOM, TWO_ROOMS_AND_A_CORRIDOR, around, moved, plane, view
from shapely.geometry import Point, Polygon

from semantics.detector import DetectorConfig, GnnDetector, make_detector
from slam.core import InputError, Linking, MapView


def planes_of(proposals):
    return {frozenset(p.plane_id for p in room.pieces) for room in proposals.rooms}


def walls_of(proposals):
    return {frozenset(p.plane_id for p in wall.pieces) for wall in proposals.walls}


ROOMS = {frozenset(range(4)), frozenset(range(4, 8)), frozenset(range(8, 12))}
WALLS = {frozenset((1, 7)), frozenset((2, 8)), frozenset((6, 8))}


def test_two_rooms_and_a_corridor_are_found_with_their_walls():
    found = GnnDetector().update(view(TWO_ROOMS_AND_A_CORRIDOR))
    assert planes_of(found) == ROOMS
    assert walls_of(found) == WALLS
    for room in found.rooms:
        assert Polygon(room.polygon).contains(Point(room.centre))


@pytest.mark.parametrize(("angle", "shift"), [(0.7, (0, 0)), (2.9, (100.0, -30.0))])
def test_moving_the_map_moves_the_rooms_alike(angle, shift):
    here = GnnDetector().update(view(TWO_ROOMS_AND_A_CORRIDOR))
    there = GnnDetector().update(view(moved(TWO_ROOMS_AND_A_CORRIDOR, angle, shift)))
    assert planes_of(there) == planes_of(here)
    c, s = np.cos(angle), np.sin(angle)
    R = np.array([[c, -s], [s, c]])
    for a, b in zip(here.rooms, there.rooms, strict=True):
        assert np.allclose(R @ a.centre + shift, b.centre, atol=0.15)


def test_the_order_of_the_planes_does_not_matter():
    order = np.random.default_rng(0).permutation(12).tolist()
    found = GnnDetector().update(view(TWO_ROOMS_AND_A_CORRIDOR, order))
    assert planes_of(found) == ROOMS
    assert walls_of(found) == WALLS


def test_it_tells_of_the_edges_behind_its_rooms():
    detector = GnnDetector()
    assert isinstance(detector, Linking)
    assert len(detector.links().pairs) == 0
    detector.update(view(TWO_ROOMS_AND_A_CORRIDOR))
    links = detector.links()
    joined = {frozenset(links.pieces[k].plane_id for k in pair) for pair in links.pairs.tolist()}
    assert joined
    assert all(any(pair <= room for room in ROOMS) for pair in joined)


def test_an_l_shaped_room_is_one_room():
    assert planes_of(GnnDetector().update(view(L_ROOM))) == {frozenset(range(6))}


def cupboard(name, x, y, width, depth, height):
    """The three sides of a cupboard with its back to a wall along x, as they are mapped."""
    sides = [
        ((x, y + depth), (x, y)),
        ((x + width, y + depth), (x, y + depth)),
        ((x + width, y), (x + width, y + depth)),
    ]
    turned = [(b, a) for a, b in sides]  # they are seen from without
    return [plane(name + k, side, height) for k, side in enumerate(turned)]


def test_furniture_belongs_to_no_room():
    rooms = view(TWO_ROOMS_AND_A_CORRIDOR).planes
    furniture = [
        *cupboard(20, 0.8, 0.05, 1.2, 0.5, 1.3),
        *cupboard(30, 2.6, 0.05, 0.9, 0.6, 0.9),
        *cupboard(40, 5.5, 0.05, 1.4, 0.6, 1.6),
        plane(50, ((7.0, 3.2), (8.4, 3.2)), 0.8),
        plane(51, ((8.4, 2.4), (7.0, 2.4)), 0.8),
    ]
    found = GnnDetector().update(MapView(0.0, [*rooms, *furniture], []))
    assert planes_of(found) == ROOMS
    assert walls_of(found) == WALLS


def test_ids_stay_from_one_update_to_the_next():
    detector = GnnDetector()
    first = detector.update(view(TWO_ROOMS_AND_A_CORRIDOR[:4]))
    second = detector.update(view(TWO_ROOMS_AND_A_CORRIDOR))
    assert [room.id for room in first.rooms] == [0]
    assert next(r.id for r in second.rooms if 0 in {p.plane_id for p in r.pieces}) == 0
    assert len(second.rooms) == 3


@pytest.mark.parametrize("count", [0, 1, 2])
def test_few_planes_make_no_room(count):
    planes = view(TWO_ROOMS_AND_A_CORRIDOR).planes[:count]
    assert GnnDetector().update(MapView(0.0, planes, [])).rooms == ()


def test_identical_and_parallel_planes_make_no_room():
    same = [((0.0, 0.0), (4.0, 0.0))] * 5
    assert GnnDetector().update(view(same)).rooms == ()
    parallel = [((0.0, float(k)), (4.0, float(k))) for k in range(8)]
    assert GnnDetector().update(view(parallel)).rooms == ()


def test_planes_of_no_length_make_nothing_and_do_no_harm():
    planes = view(TWO_ROOMS_AND_A_CORRIDOR).planes
    point = replace(planes[0], id=77, points=np.tile(planes[0].points[:1], (50, 1)))
    found = GnnDetector().update(MapView(0.0, [*planes, point], []))
    assert 77 not in {p.plane_id for room in found.rooms for p in room.pieces}
    assert planes_of(found) == ROOMS


def test_numbers_that_are_none_are_refused_with_the_planes_name():
    planes = list(view(TWO_ROOMS_AND_A_CORRIDOR).planes)
    for broken in (
        replace(planes[3], points=np.full((40, 3), np.nan)),
        replace(planes[3], normal=np.array([np.nan, 0.0, 0.0])),
        replace(planes[3], d=np.inf),
    ):
        with pytest.raises(InputError, match="plane 3"):
            GnnDetector().update(MapView(0.0, [*planes[:3], broken], []))


@pytest.mark.slow
def test_ten_thousand_planes_are_as_good_as_twelve():
    sides = [
        ((x0 + 6.0 * a, y0 + 5.0 * b), (x1 + 6.0 * a, y1 + 5.0 * b))
        for a in range(50)
        for b in range(50)
        for (x0, y0), (x1, y1) in around(0.0, 0.0, 5.8, 4.8)
    ]
    planes = [plane(name, side, spacing=0.3) for name, side in enumerate(sides)]
    found = GnnDetector().update(MapView(0.0, planes, []))
    assert len(planes) == 10_000
    right = {frozenset(range(k, k + 4)) for k in range(0, 10_000, 4)}
    assert len(planes_of(found) & right) > 2450


def test_the_papers_detector_finds_rooms_of_four_and_two_planes_only():
    found = make_detector("paper").update(view(TWO_ROOMS_AND_A_CORRIDOR))
    assert {len(room.pieces) for room in found.rooms} <= {2, 4}
    assert planes_of(found) & ROOMS


def test_unknown_names_and_absent_weights_are_refused(tmp_path):
    with pytest.raises(InputError, match="gnn-greedy"):
        make_detector("gnm")
    with pytest.raises(InputError, match="gnn.npz"):
        GnnDetector(DetectorConfig(weights=(tmp_path / "gnn.npz",)))


def test_inference_loads_neither_worlds_nor_sim():
    code = (
        "import sys; from semantics.detector import GnnDetector; GnnDetector();"
        "assert not [m for m in sys.modules if m.split('.')[0] in ('worlds', 'sim', 'eval')]"
    )
    subprocess.run([sys.executable, "-c", code], check=True)


@pytest.mark.parametrize("gone", range(12))
def test_only_planes_of_the_map_are_named(gone):
    detector = GnnDetector()
    whole = view(TWO_ROOMS_AND_A_CORRIDOR)
    detector.update(whole)
    left = replace(whole, planes=[plane for plane in whole.planes if plane.id != gone])
    answer = detector.update(left)
    named = [piece.plane_id for room in answer.rooms for piece in room.pieces]
    named += [piece.plane_id for wall in answer.walls for piece in wall.pieces]
    assert gone not in named
