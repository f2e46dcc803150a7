"""Mapped planes on hand-made cases (see the house in conftest)."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from looking import keep

from eval.labels import TruthKeeper
from eval.score.planes import (
    LabelledPlane,
    PlaneScore,
    plane_errors,
    samples_on_plane,
    score_planes,
)
from slam.core import Array, MapPlane, pose, so3_exp, transform_plane, transform_points
from worlds.truth import CEILING, CLUTTER, FLOOR, NO_FACE, Floor


def labelled(plane: MapPlane, keeper: TruthKeeper) -> LabelledPlane:
    ids = plane.point_ids
    return LabelledPlane(plane, keeper.faces_of(ids), keeper.along_of(ids), keeper.true_points(ids))


@pytest.fixture
def stage(house):
    """A keyframe that sees every face whole, and how to score planes made from it."""
    pair = house.scan(0, 0.0, (2.0, 1.5, 0.0), house.whole(*range(12)))
    keeper = TruthKeeper(house.truth)
    keep(keeper, *pair, keyframe=True)

    def run(*planes: MapPlane, T: Array | None = None) -> PlaneScore:
        T_world_map = np.eye(4) if T is None else T
        rows = [labelled(plane, keeper) for plane in planes]
        return score_planes(rows, house.truth, keeper.seen, T_world_map)

    return pair, run


def test_a_plane_for_every_face(house, stage) -> None:
    pair, score = stage
    planes = [house.plane(i, pair, house.whole(i)) for i in range(12)]
    result = score(*planes)
    assert (result.mapped, result.mixed, result.faces_seen) == (12, 0, 12)
    assert result.completeness == 1.0
    assert result.mapped_faces == set(range(12))
    assert result.plane_rmse == pytest.approx(0.0, abs=1e-6)
    # Coplanar pairs (0, 4), (2, 6), (3, 11) and (5, 9) lie beside each other: no duplicates.
    assert result.duplicates == 0


def test_one_plane_through_two_rooms_is_not_mixed(house, stage) -> None:
    pair, score = stage
    result = score(house.plane(0, pair, house.whole(0, 4)))
    assert result.mixed == 0
    assert result.votes[0].share == 1.0
    assert result.mapped_faces == {0, 4}
    assert result.completeness == pytest.approx(2 / 12)


@pytest.mark.parametrize(("length", "mixed"), [(0.5, 0), (1.0, 0), (1.05, 1), (1.5, 1)])
def test_under_60_percent_is_mixed(house, stage, length: float, mixed: int) -> None:
    """1.5 m of face 0 and ``length`` of face 1: exactly 60 % is not mixed yet."""
    pair, score = stage
    result = score(house.plane(0, pair, {0: (0.0, 1.5), 1: (0.0, length)}))
    assert result.mixed == mixed


def test_a_mixed_plane_completes_nothing_and_has_no_error(house, stage) -> None:
    pair, score = stage
    result = score(house.plane(0, pair, {1: (0.0, 3.0), 0: (0.0, 3.0)}))
    assert result.mixed == 1
    assert result.completeness == 0.0
    assert result.plane_rmse is None


def test_other_surfaces_on_a_plane_are_not_completed(house, stage) -> None:
    """All of face 1 and 1.8 m of face 0: 62.5 % are 1's, so the plane is 1's, and only 1's."""
    pair, score = stage
    assert score(house.plane(0, pair, {1: (0.0, 3.0), 0: (0.0, 1.8)})).mapped_faces == {1}


@pytest.mark.parametrize(("length", "complete"), [(1.45, False), (1.5, True)])
def test_completeness_needs_half_of_the_seen_length(house, stage, length, complete) -> None:
    pair, score = stage
    assert (1 in score(house.plane(0, pair, {1: (0.0, length)})).mapped_faces) is complete


def test_two_thirds_on_two_planes_do_not_complete(house, stage) -> None:
    """Each plane holds a third of the face; no single one holds half."""
    pair, score = stage
    parts = [house.plane(i, pair, {1: (float(i), i + 1.0)}) for i in (0, 1)]
    result = score(*parts)
    assert result.mapped_faces == frozenset()
    assert result.duplicates == 0


def test_overlapping_planes_of_one_surface_are_duplicates(house, stage) -> None:
    pair, score = stage
    whole = house.plane(0, pair, {0: (0.0, 4.0)})
    inside = house.plane(1, pair, {0: (1.0, 2.0)}, shift=0.03)
    again = house.plane(2, pair, {0: (2.5, 3.5)}, shift=0.03)
    beside = house.plane(3, pair, house.whole(4))
    other = house.plane(4, pair, house.whole(1))
    assert score(whole, inside).duplicates == 1
    assert score(again, whole, inside, beside, other).duplicates == 2
    # The two small ones do not overlap each other.
    assert score(inside, again).duplicates == 0


def test_planes_that_meet_end_to_end_are_no_duplicates(house, stage) -> None:
    pair, score = stage
    left, right = (house.plane(i, pair, {0: (1.95 * i, 1.95 * i + 2.0)}) for i in (0, 1))
    assert score(left, right).duplicates == 0


def test_a_plane_above_another_is_no_duplicate(house, stage) -> None:
    pair, score = stage
    whole = house.plane(0, pair, {0: (0.0, 4.0)})
    low = whole.points[:, 2] < 1.0
    parts = [
        dataclasses.replace(whole, id=i, points=whole.points[m], point_ids=whole.point_ids[m])
        for i, m in enumerate((low, ~low))
    ]
    assert score(*parts).duplicates == 0


def level(house, height: float, x: tuple[float, float], step: float = 0.1) -> Array:
    xs, ys = np.meshgrid(np.arange(*x, step), np.arange(0.0, 3.0, step))
    return np.column_stack([xs.ravel(), ys.ravel(), np.full(xs.size, height)])


def test_floors_have_surfaces_too(house) -> None:
    """Two landmarks for one floor are duplicates; the ceiling and the floor above are not."""
    truth = dataclasses.replace(house.truth, floors=(Floor(0, 0.0, 2.5), Floor(1, 3.0, 5.5)))
    extra = [
        (FLOOR, level(house, 0.01, (0.0, 4.0))),
        (FLOOR, level(house, -0.01, (1.0, 8.0))),
        (CEILING, level(house, 2.5, (0.0, 4.0))),
        (FLOOR, level(house, 3.01, (0.0, 4.0))),
        (NO_FACE, level(house, 1.0, (0.0, 4.0))),
        (CLUTTER, level(house, 1.0, (0.0, 4.0))),
    ]
    pair = house.scan(0, 0.0, (2.0, 1.5, 0.0), {}, extra)
    keeper = TruthKeeper(truth)
    keep(keeper, *pair, keyframe=True)
    ends = np.cumsum([0] + [len(points) for _, points in extra])
    planes = [
        MapPlane(i, np.array([0.0, 0, 1]), 0.0, points, np.arange(*ends[i : i + 2]), np.array([0]))
        for i, (_, points) in enumerate(extra)
    ]
    result = score_planes([labelled(p, keeper) for p in planes], truth, keeper.seen, np.eye(4))
    surfaces = [(FLOOR, 0), (FLOOR, 0), (CEILING, 0), (FLOOR, 1), (NO_FACE, 0), (CLUTTER, 0)]
    assert [vote.surface for vote in result.votes] == surfaces
    labels = ["floor", "floor", "ceiling", "floor", "none", "clutter"]
    assert [vote.label for vote in result.votes] == labels
    assert (result.duplicates, result.mixed, result.plane_rmse) == (1, 0, None)


def test_plane_rmse_by_hand(house, stage) -> None:
    """A plane 2 cm off over 3 m and one in place over 3 m: sqrt((4 + 0) / 2) cm."""
    pair, score = stage
    off = house.plane(0, pair, house.whole(1), shift=0.02)
    good = house.plane(1, pair, house.whole(3))
    assert score(off).plane_rmse == pytest.approx(0.02)
    assert score(off, good).plane_rmse == pytest.approx(0.02 / np.sqrt(2))


def test_plane_rmse_of_a_turned_plane(house, stage) -> None:
    """Turned by 1 degree about the middle of its 3 m: half of it times sin(1 deg), over sqrt 3."""
    pair, score = stage
    plane = house.plane(0, pair, house.whole(1))
    middle = np.array([4.0, 1.5, 1.25])
    R = so3_exp(np.array([0.0, 0.0, np.radians(1.0)]))
    T = pose(R, middle - R @ middle)
    normal, d = transform_plane(T, plane.normal, plane.d)
    turned = dataclasses.replace(
        plane, normal=normal, d=d, points=transform_points(T, plane.points)
    )
    samples = samples_on_plane(turned)
    assert np.abs(samples @ normal + d).max() < 1e-9
    expected = 1.5 * np.sin(np.radians(1.0)) / np.sqrt(3.0)
    assert score(turned).plane_rmse == pytest.approx(expected, rel=0.05)


def test_a_face_over_two_wall_bodies_is_measured_body_by_body(house) -> None:
    """The east face's outer half was built 1 cm further out: a plane in line with the inner half is
    right over 1.5 m and 1 cm off over 1.5 m."""
    face = house.truth.faces[1]
    parts = np.array([[[4.0, 3.0], [4.0, 1.5]], [[4.01, 1.5], [4.01, 0.0]]])
    split = dataclasses.replace(face, parts=parts)
    pair = house.scan(0, 0.0, (2.0, 1.5, 0.0), house.whole(1))
    errors = plane_errors(house.plane(0, pair, house.whole(1)), [split], np.eye(4))
    assert np.unique(np.round(errors, 6)).tolist() == [0.0, 0.01]
    assert np.sqrt((errors**2).mean()) == pytest.approx(0.01 / np.sqrt(2), rel=0.05)


def test_a_leaning_face_is_measured_with_its_lean(house) -> None:
    """A face that leans by 10 mrad against an upright plane: 12 mm off at foot and top."""
    lean = np.array([-np.cos(0.01), 0.0, np.sin(0.01)])
    middle = np.array([4.0, 1.5, 1.25])
    face = dataclasses.replace(house.truth.faces[1], normal=lean, d=-float(lean @ middle))
    pair = house.scan(0, 0.0, (2.0, 1.5, 0.0), house.whole(1))
    errors = plane_errors(house.plane(0, pair, house.whole(1)), [face], np.eye(4))
    assert np.allclose(np.sort(np.unique(np.round(np.abs(errors), 4))), [0.0, 0.0115])


def test_a_rigid_motion_of_the_map_changes_nothing(house, stage) -> None:
    pair, score = stage
    T_map_world = pose(so3_exp(np.array([0.002, -0.001, 2.0])), np.array([30.0, -7.0, 0.4]))
    build = [(i, {"shift": 0.01 * i}) for i in range(3)]
    here = [house.plane(i, pair, house.whole(i), **shift) for i, shift in build]
    there = [
        house.plane(i, pair, house.whole(i), T_map_world=T_map_world, **shift) for i, shift in build
    ]
    first, second = score(*here), score(*there, T=np.linalg.inv(T_map_world))
    assert second.plane_rmse == pytest.approx(first.plane_rmse, abs=1e-5)
    assert second.mapped_faces == first.mapped_faces
    assert score(*here[::-1]).plane_rmse == pytest.approx(first.plane_rmse)


def test_no_planes_and_no_alignment(house, stage) -> None:
    _, score = stage
    result = score()
    assert (result.mapped, result.completeness, result.plane_rmse) == (0, 0.0, None)
    keeper = TruthKeeper(house.truth)
    blind = score_planes([], house.truth, keeper.seen, None)
    assert (blind.faces_seen, blind.completeness) == (0, None)


def test_completeness_is_over_the_seen_faces(house) -> None:
    pair = house.scan(0, 0.0, (2.0, 1.5, 0.0), house.whole(0, 1))
    keeper = TruthKeeper(house.truth)
    keep(keeper, *pair, keyframe=True)
    rows = [labelled(house.plane(0, pair, house.whole(0)), keeper)]
    result = score_planes(rows, house.truth, keeper.seen, np.eye(4))
    assert (result.faces_seen, result.completeness) == (2, 0.5)
