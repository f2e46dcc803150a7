"""The S-Graphs+ room segmentation: published vectors, its faults, and rooms of a small house."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from houses import TWO_ROOMS_AND_A_CORRIDOR, Side, moved, plane
from numpy.testing import assert_allclose
from shapely.geometry import Polygon, box

from semantics.freespace.places import Places
from semantics.sgraphs.clusters import clusters_of
from semantics.sgraphs.config import SgraphsConfig
from semantics.sgraphs.matching import Match, axes_of, centre_of, match, side_of, width_of
from semantics.sgraphs.outlines import proposal
from semantics.sgraphs.rooms import Known, KnownRooms
from slam.core import Array, MapPlane

CONFIG = SgraphsConfig()
FAULTS = SgraphsConfig(faults=True)
LEVEL = np.eye(2)


def grid(x0: float, y0: float, x1: float, y1: float) -> Array:
    """Vertices of free space, 0.7 m off the walls."""
    x, y = np.meshgrid(np.arange(x0 + 0.7, x1 - 0.69, 0.35), np.arange(y0 + 0.7, y1 - 0.69, 0.35))
    return np.column_stack([x.ravel(), y.ravel()])


def planes_of(sides: list[Side]) -> list[MapPlane]:
    return [plane(name, side) for name, side in enumerate(sides)]


def facing(low_x: float, high_x: float, low_y: float, high_y: float) -> list[Side]:
    return [
        ((low_x, high_y), (low_x, low_y)),
        ((high_x, low_y), (high_x, high_y)),
        ((low_x, low_y), (high_x, low_y)),
        ((high_x, high_y), (low_x, high_y)),
    ]


@pytest.mark.parametrize("config", [CONFIG, FAULTS])
def test_published_centre_of_four_planes(config: SgraphsConfig) -> None:
    x0, x1, y0, y1 = (side_of(p, LEVEL) for p in planes_of(facing(-10, 4, -6, 4)))
    assert (x0.axis, x0.high, x1.high, y0.axis, y0.high, y1.high) == (
        0,
        False,
        True,
        1,
        False,
        True,
    )
    centre = centre_of((x0, x1), (y0, y1), grid(-10, -6, 4, 4), config)
    assert_allclose(centre, [-3.0, -1.0], atol=1e-9)
    assert width_of((x0, x1), centre, config) == pytest.approx(14.0)
    assert width_of((y0, y1), centre, config) == pytest.approx(10.0)


def test_the_published_width_depends_on_the_axes_of_the_map() -> None:
    for turn, faulty in ((np.pi / 4, 4 * np.sqrt(2)), (-np.pi / 4, 0.0)):
        planes = planes_of(moved(facing(0, 4, 0, 5)[:2], turn, (8.0, 3.0)))
        pair = side_of(planes[0], LEVEL), side_of(planes[1], LEVEL)
        between = np.vstack([side.points for side in pair]).mean(axis=0)
        assert width_of(pair, between, CONFIG) == pytest.approx(4.0)
        assert width_of(pair, between, FAULTS) == pytest.approx(faulty, abs=1e-6)


@pytest.mark.parametrize("config", [CONFIG, FAULTS])
def test_published_centre_of_two_planes(config: SgraphsConfig) -> None:
    x0, x1 = (side_of(p, LEVEL) for p in planes_of(facing(-2, 6, 0, 14)[:2]))
    centre = centre_of((x0, x1), None, np.array([[-1.5, 6.0], [5.5, 8.0]]), config)
    assert_allclose(centre, [2.0, 7.0], atol=1e-9)


def test_a_corridor_through_the_origin_has_a_centre_only_without_the_fault() -> None:
    x0, x1 = (side_of(p, LEVEL) for p in planes_of(facing(-1.0, 1.0, 0, 14)[:2]))
    vertices = grid(-1.8, 0, 1.8, 14)
    assert_allclose(centre_of((x0, x1), None, vertices, CONFIG)[0], 0.0, atol=1e-9)
    x0, x1 = (side_of(p, LEVEL) for p in planes_of(facing(-1.0, 1.01, 0, 14)[:2]))
    off = centre_of((x0, x1), None, vertices + np.array([0.3, 0.0]), FAULTS)
    assert abs(off[0]) < 0.1


@pytest.mark.parametrize("angle", [0.0, 0.3, 0.78, -1.2])
def test_rooms_in_a_building_of_any_heading(angle: float) -> None:
    shift = (30.0, -12.0)
    planes = planes_of(moved(TWO_ROOMS_AND_A_CORRIDOR, angle, shift))
    axes = axes_of(planes, LEVEL)
    sides = [side_of(p, axes) for p in planes]
    c, s = np.cos(angle), np.sin(angle)
    for bounds, kind in (((0, 0, 4, 5), "room"), ((4.2, 0, 9, 5), "room")):
        cluster = grid(*bounds) @ np.array([[c, s], [-s, c]]) + shift
        found = match(cluster, axes, sides, CONFIG)
        assert found is not None
        assert found.kind == kind
        made = proposal(Known(0, found), axes)
        back = (made.polygon - np.array(shift)) @ np.array([[c, -s], [s, c]])
        truth = box(*bounds)
        assert Polygon(back).intersection(truth).area / Polygon(back).union(truth).area > 0.99
        assert len(made.pieces) == 4


def test_the_published_axes_miss_a_turned_room() -> None:
    planes = planes_of(moved(facing(0, 4, 0, 5), np.pi / 4, (8.0, 3.0)))
    turned = grid(0, 0, 4, 5) @ np.array([[1, 1], [-1, 1]]) / np.sqrt(2) + [8.0, 3.0]
    axes = axes_of(planes, LEVEL)
    right = match(turned, axes, [side_of(p, axes) for p in planes], CONFIG)
    assert right is not None
    assert right.kind == "room"
    found = match(turned, LEVEL, [side_of(p, LEVEL) for p in planes], FAULTS)
    assert found is None or found.kind != "room"


def room_match(planes: list[MapPlane], bounds: tuple[float, float, float, float]) -> Match:
    found = match(grid(*bounds), LEVEL, [side_of(p, LEVEL) for p in planes], CONFIG)
    assert found is not None
    return found


def test_two_planes_are_a_corridor_and_become_a_room() -> None:
    planes = planes_of(facing(0, 4, 0, 5))
    corridor, room = room_match(planes[:2], (0, 0, 4, 5)), room_match(planes, (0, 0, 4, 5))
    assert (corridor.kind, room.kind) == ("x", "room")
    known = KnownRooms(CONFIG)
    known.take(corridor)
    known.take(room)
    assert [(k.id, k.match.kind) for k in known] == [(0, "room")]
    known.take(corridor)
    assert len(list(known)) == 1


@pytest.mark.parametrize(("config", "count"), [(CONFIG, 1), (FAULTS, 2)])
def test_a_corridor_along_x_is_recognised_again_without_the_fault(
    config: SgraphsConfig, count: int
) -> None:
    planes = planes_of(facing(0, 12, 0, 2.5)[2:])
    corridor = room_match(planes, (0, 0, 12, 2.5))
    known = KnownRooms(config)
    known.take(corridor)
    known.take(corridor)
    assert len(list(known)) == count


def test_a_cluster_with_four_planes_that_fails_is_no_corridor_unless_asked() -> None:
    planes = planes_of(facing(0, 4, 0, 5))
    short = [*planes[:3], plane(3, ((5.2, 5), (3.2, 5)))]  # little of it before the room
    sides = [side_of(p, LEVEL) for p in short]
    cluster = grid(0, 0, 4, 5)
    assert match(cluster, LEVEL, sides, CONFIG) is None
    half = match(cluster, LEVEL, sides, replace(CONFIG, halves=True))
    assert half is not None
    assert half.kind == "x"


def test_corridors_are_one_where_their_planes_overlap() -> None:
    planes = planes_of(facing(0, 12, 0, 2.5)[2:])
    known = KnownRooms(CONFIG)
    known.take(room_match(planes, (0, 0, 12, 2.5)))
    beside = [replace(p, id=p.id + 10, d=p.d + 0.6) for p in planes]
    known.take(room_match(beside, (0, 0, 12, 2.5)))
    assert len(list(known)) == 1
    few = replace(planes[0], id=20, points=planes[0].points[:30])
    known.take(room_match([few, planes[1]], (0, 0, 3, 2.5)))
    assert len(list(known)) == 2


def test_a_room_goes_with_a_plane_that_was_merged() -> None:
    planes = planes_of(facing(0, 4, 0, 5))
    known = KnownRooms(CONFIG)
    known.take(room_match(planes, (0, 0, 4, 5)))
    known.refresh({p.id: p for p in planes}, LEVEL)
    assert len(list(known)) == 1
    known.refresh({p.id: p for p in planes[1:]}, LEVEL)
    assert not list(known)


def test_a_narrow_gap_is_no_room() -> None:
    sides = [side_of(p, LEVEL) for p in planes_of(facing(0, 0.9, 0, 5)[:2])]
    assert match(grid(-1, 0, 2, 5), LEVEL, sides, CONFIG) is None


def test_doorways_separate_clusters_and_join_the_first() -> None:
    left, right = grid(0, 0, 4, 5), grid(5, 0, 9, 5)
    door = np.array([[4.5, 2.5]])
    positions = np.vstack([left, door, right])
    n = len(left)
    clearance = np.full(len(positions), 1.0)
    clearance[n] = 0.45
    chain = np.column_stack([np.arange(len(positions) - 1), np.arange(1, len(positions))])
    skeleton = Places(
        np.column_stack([positions, 0 * positions[:, 0]]), clearance, chain, clearance[:-1]
    )
    found = clusters_of(skeleton, CONFIG)
    assert sorted(len(c) for c in found) == sorted([n + 1, len(right)])


def test_no_skeleton_no_clusters() -> None:
    nothing = Places(np.zeros((0, 3)), np.zeros(0), np.zeros((0, 2), np.int64), np.zeros(0))
    assert clusters_of(nothing, CONFIG) == []
