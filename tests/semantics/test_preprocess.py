from dataclasses import replace

import numpy as np
import pytest
from houses import TWO_ROOMS_AND_A_CORRIDOR, around, plane, view
from shapely.geometry import LineString

from semantics.preprocess import Preprocessor
from slam.core import InputError, MapPlane


def lengths(planes):
    return sorted(np.round(Preprocessor()(planes).length, 1).tolist())


def test_whole_planes_stay_whole():
    pieces = Preprocessor()(view(TWO_ROOMS_AND_A_CORRIDOR).planes)
    assert len(pieces) == 12
    assert np.allclose(np.linalg.norm(pieces.normal, axis=1), 1.0)


def test_a_plane_is_cut_where_a_wall_stands_on_its_front():
    long = plane(0, ((0, 0), (10, 0)))
    wall = [plane(1, ((5.0, 0.1), (5.0, 4.0))), plane(2, ((5.2, 4.0), (5.2, 0.1)))]
    assert lengths([long, *wall]) == [3.9, 3.9, 4.8, 5.0]


def test_a_wall_behind_does_not_cut():
    long = plane(0, ((0, 0), (10, 0)))
    behind = plane(1, ((5.0, -4.0), (5.0, -0.1)))
    assert lengths([long, behind]) == [3.9, 10.0]


def with_hole(name, side, low, high):
    """A plane along x, without what is between two places."""
    whole = plane(name, side, spacing=0.05)
    points = whole.points[(whole.points[:, 0] < low) | (whole.points[:, 0] > high)]
    return replace(whole, points=points, point_ids=np.arange(len(points)))


def test_a_wall_too_short_to_be_mapped_is_known_by_the_holes_it_leaves_in_both_faces():
    right, left = ((0, 0), (12, 0)), ((12, 1.5), (0, 1.5))
    both = [with_hole(0, right, 5.0, 5.2), with_hole(1, left, 5.0, 5.2)]
    assert lengths(both) == [5.1, 5.1, 6.9, 6.9]
    (barrier,) = Preprocessor()(both).barrier
    assert barrier == pytest.approx(np.array([[5.1, 0.0], [5.1, 1.5]]), abs=0.05)
    apart = [with_hole(0, right, 5.0, 5.2), with_hole(1, left, 6.0, 6.2)]
    doors = [with_hole(0, right, 5.0, 6.0), with_hole(1, left, 5.0, 6.0)]
    back = [
        with_hole(0, ((12, 0), (0, 0)), 5.0, 5.2),
        with_hole(1, ((0, 1.5), (12, 1.5)), 5.0, 5.2),
    ]
    for planes in (both[:1], apart, doors, back):
        assert set(lengths(planes)) == {12.0}


def test_furniture_does_not_cut_the_wall_behind_it():
    wall = plane(0, ((0, 0), (10, 0)))
    cupboard = plane(1, ((5.0, 0.1), (5.0, 0.6)), height=1.2)
    assert lengths([wall, cupboard]) == [0.5, 10.0]
    stub = plane(1, ((5.0, 0.1), (5.0, 0.6)))  # as high as the wall
    assert lengths([wall, stub]) == [0.5, 5.0, 5.0]
    counter = plane(1, ((5.0, 0.1), (5.0, 2.1)), height=1.2)  # longer than any cupboard is deep
    assert lengths([wall, counter]) == [2.0, 5.0, 5.0]


def joined(*parts):
    """One plane of the points of several in line."""
    points = np.vstack([part.points for part in parts])
    ids = np.arange(len(points))
    return MapPlane(0, parts[0].normal, parts[0].d, points, ids, np.zeros(1, dtype=np.int64))


def test_how_high_a_wall_was_seen_is_told_by_the_stretch_that_is_cut():
    low, high = plane(0, ((0, 0), (10, 0)), height=1.3), plane(0, ((10, 0), (20, 0)))
    stub = plane(1, ((5.0, 0.1), (5.0, 0.6)), height=1.2)
    assert lengths([joined(low, high), stub]) == [0.5, 5.0, 15.0]
    further = plane(1, ((15.0, 0.1), (15.0, 0.6)), height=1.2)  # a cupboard there
    assert lengths([joined(low, high), further]) == [0.5, 20.0]


def test_a_wall_goes_on_across_a_door():
    corridor = [plane(0, ((0, 0), (10, 0))), plane(1, ((10, 2), (0, 2)))]
    stub = plane(2, ((5.0, 1.4), (5.0, 2.0)))
    assert lengths([*corridor, stub]) == [0.6, 5.0, 5.0, 5.0, 5.0]
    passage = [plane(0, ((0, 0), (10, 0))), plane(1, ((10, 2.5), (0, 2.5)))]
    wide = plane(2, ((5.0, 1.9), (5.0, 2.5)))
    assert lengths([*passage, wide]) == [0.6, 5.0, 5.0, 10.0]


def test_no_wall_goes_on_through_another_face():
    corridor = [plane(0, ((0, 0), (10, 0))), plane(1, ((10, 1.2), (0, 1.2)))]
    beyond = plane(2, ((5.0, 1.3), (5.0, 5.0)))
    assert lengths([*corridor, beyond]) == [3.7, 10.0, 10.0]
    assert lengths([corridor[0], beyond]) == [3.7, 5.0, 5.0]


def test_a_piece_is_as_high_as_its_own_stretch_of_the_plane_was_seen():
    long = joined(plane(0, ((0, 0), (5, 0)), height=1.3), plane(0, ((5, 0), (10, 0))))
    pieces = Preprocessor()([long, plane(1, ((5.0, 0.1), (5.0, 4.0)))])
    left, right = sorted(pieces.take(pieces.plane_id == 0).height.tolist(), key=lambda h: h[1])
    assert left == pytest.approx([0.1, 1.1], abs=0.05)
    assert right == pytest.approx([0.1, 2.3], abs=0.05)


def test_a_door_does_not_split_and_a_wide_opening_does():
    door = [plane(0, ((0, 0), (3, 0))), plane(1, ((4, 0), (8, 0)))]
    assert lengths([joined(*door)]) == [8.0]
    far = plane(1, ((5.5, 0), (8, 0)))
    assert lengths([joined(door[0], far)]) == [2.5, 3.0]


def test_a_stray_point_does_not_move_an_end():
    clean = plane(0, ((0, 0), (4, 0)))
    points = np.vstack([clean.points, [30.0, 0.0, 1.0]])
    ids = np.arange(len(points))
    stray = MapPlane(0, clean.normal, clean.d, points, ids, np.zeros(1, dtype=np.int64))
    assert lengths([stray]) == [4.0]


def test_duplicates_go_but_both_faces_of_a_thin_wall_stay():
    one = plane(0, ((0, 0), (4, 0)))
    again = plane(1, ((0.5, 0.05), (3.5, 0.05)))
    assert lengths([one, again]) == [4.0]
    other_face = plane(1, ((4, -0.06), (0, -0.06)))
    assert lengths([one, other_face]) == [4.0, 4.0]


def test_pieces_lie_on_their_planes():
    planes = view(around(1.0, 2.0, 5.0, 6.0)).planes
    pieces = Preprocessor()(planes)
    for place in range(len(pieces)):
        own = next(p for p in planes if p.id == pieces.plane_id[place])
        line = LineString(own.segment)
        assert line.hausdorff_distance(LineString(pieces.segment[place])) < 0.15


@pytest.mark.parametrize("count", [0, 1])
def test_few_planes(count):
    assert len(Preprocessor()(view(around(0, 0, 4, 4)).planes[:count])) == count


def test_planes_of_no_length_or_without_numbers():
    point = MapPlane(
        0,
        np.array([0.0, 1.0, 0.0]),
        0.0,
        np.zeros((50, 3)),
        np.arange(50),
        np.zeros(1, dtype=np.int64),
    )
    assert len(Preprocessor()([point])) == 0
    broken = MapPlane(
        7,
        np.array([0.0, 1.0, 0.0]),
        0.0,
        np.full((50, 3), np.nan),
        np.arange(50),
        np.zeros(1, dtype=np.int64),
    )
    with pytest.raises(InputError, match="plane 7"):
        Preprocessor()([broken])


def test_floors_and_ceilings_are_left_out():
    level = MapPlane(
        0,
        np.array([0.0, 0.0, 1.0]),
        0.0,
        np.random.default_rng(0).uniform(0, 5, (100, 3)),
        np.arange(100),
        np.zeros(1, dtype=np.int64),
    )
    assert len(Preprocessor()([level])) == 0


def test_a_hole_between_two_walls_is_no_piece():
    """A face with a gap of 1 m, into which two walls run: the door of a passage."""
    parts = [plane(0, ((0, 0), (3, 0))), plane(0, ((4, 0), (8, 0)))]
    points = np.vstack([part.points for part in parts])
    ids = np.arange(len(points))
    face = MapPlane(0, parts[0].normal, parts[0].d, points, ids, np.zeros(1, dtype=np.int64))
    walls = [plane(1, ((3.0, 0.1), (3.0, 3.0))), plane(2, ((4.0, 3.0), (4.0, 0.1)))]
    assert lengths([face, *walls]) == [2.9, 2.9, 3.0, 4.0]


def test_what_did_not_change_is_not_worked_out_again():
    planes = list(view(TWO_ROOMS_AND_A_CORRIDOR).planes)
    preprocess = Preprocessor()
    before = preprocess(planes)
    empty = np.full((50, 3), np.nan)
    planes[0] = replace(planes[0], points=empty)
    assert np.array_equal(preprocess(planes).segment, before.segment)
    planes[0] = replace(planes[0], points=empty, revision=1)
    with pytest.raises(InputError, match="plane 0"):
        preprocess(planes)


def test_however_the_map_has_come_about_its_pieces_are_the_same():
    """Planes that move, go, come back and change their order, against a look at all of them."""
    rng = np.random.default_rng(4)
    planes = list(view(TWO_ROOMS_AND_A_CORRIDOR).planes)
    preprocess = Preprocessor()
    for _ in range(30):
        name = int(rng.integers(len(planes)))
        there = planes[name]
        points = there.points[rng.random(len(there.points)) < 0.97] + rng.normal(0.0, 0.02, 3)
        planes[name] = replace(there, points=points, revision=there.revision + 1)
        shown = [plane for plane in planes if rng.random() < 0.8]
        shown = [shown[k] for k in rng.permutation(len(shown))]
        kept, fresh = preprocess(shown), Preprocessor()(shown)
        for column in ("plane_id", "segment", "normal", "height", "barrier"):
            assert np.array_equal(getattr(kept, column), getattr(fresh, column)), column


def test_points_that_are_far_apart_are_no_wall():
    there = plane(3, ((0, 0), (4, 0)))
    points = np.vstack([there.points, [1e9, 0.0, 1.0]])
    ids = np.arange(len(points))
    far = MapPlane(3, there.normal, there.d, points, ids, np.zeros(1, dtype=np.int64))
    with pytest.raises(InputError, match="plane 3"):
        Preprocessor()([far])
