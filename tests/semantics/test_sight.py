"""What is seen from where, in rooms simple enough to work it out by hand."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest
from shapely.geometry import MultiPolygon, Point, Polygon, box

from semantics.sight import SightConfig, Surfaces, seen, walk
from slam.core import Array
from worlds.conditions import IDEAL
from worlds.plan import Opening, Plan, RoomOutline, Storey
from worlds.truth import Truth
from worlds.world import Mesh, true_mesh

CONFIG = SightConfig(rays=1800)
CUPBOARD = box(1.0, 1.0, 1.2, 2.0)


@cache
def _building(*standing: Polygon) -> tuple[Truth, Mesh]:
    """Two rooms of 4 x 4 m side by side, a door from y = 1 to y = 2 in the wall between them, and
    what stands in them."""
    outlines = [box(0.0, 0.0, 4.0, 4.0), box(4.2, 0.0, 8.2, 4.0)]
    walls = box(-0.2, -0.2, 8.4, 4.2).difference(MultiPolygon(outlines))
    rooms = tuple(RoomOutline(f"r{k}", f"r{k}", "room", o) for k, o in enumerate(outlines))
    door = Opening("door", box(3.99, 1.0, 4.21, 2.0), 0.0, 2.1)
    storey = Storey("0", 0.0, 2.5, rooms, MultiPolygon([walls, *standing]), (door,))
    return true_mesh(Plan("two rooms", (storey,)), np.random.SeedSequence(0), IDEAL)


def _seen(stop: tuple[float, float], *standing: Polygon) -> dict[tuple[float, float], Array]:
    """Places that were seen (H, 3), by room (0, 1; -1: of no room) and the side they are on:
    (room, heading of the normal in quarter turns)."""
    truth, mesh = _building(*standing)
    surfaces = Surfaces(truth, mesh, CONFIG)
    patch, place = seen(surfaces, np.array([stop]), np.random.default_rng(0), CONFIG)
    rooms = np.array([face.room for face in truth.faces] + [-1])[surfaces.face]
    side = np.round(np.arctan2(surfaces.normal[:, 1], surfaces.normal[:, 0]) / (np.pi / 2)) % 4
    return {(int(rooms[p]), int(side[p])): place[patch == p] for p in np.unique(patch).tolist()}


def test_from_the_middle_of_a_room_all_of_it_is_seen_and_of_the_next_what_the_door_lets() -> None:
    found = _seen((2.0, 1.5))
    own = {side: found[0, side] for side in range(4)}
    assert {key for key in found if key[0] == 1} == {(1, 2)}
    assert own[0][:, 1].min() == pytest.approx(0.0, abs=0.05)  # the wall at x = 0, facing +x
    assert own[0][:, 1].max() == pytest.approx(4.0, abs=0.05)
    beside = own[2][:, 1]  # the wall at x = 4, with the door in it
    assert not ((beside > 1.02) & (beside < 1.98)).any()
    # Through the door, 2 m away, its far edge at 2.2 m and 1 m wide, onto a wall 6.2 m away.
    half = 0.5 * 6.2 / 2.2
    assert found[1, 2][:, 1].min() == pytest.approx(1.5 - half, abs=0.05)
    assert found[1, 2][:, 1].max() == pytest.approx(1.5 + half, abs=0.05)


def test_how_high_a_wall_is_seen_depends_on_its_distance() -> None:
    found = _seen((2.0, 1.5))
    top = CONFIG.height + 2.0 * np.tan(CONFIG.elevation)
    near = found[0, 0][np.abs(found[0, 0][:, 1] - 1.5) < 0.1]
    assert near[:, 2].max() == pytest.approx(top, abs=0.01)
    assert found[1, 2][:, 2].max() > top + 0.5


def test_what_stands_in_the_way_is_seen_itself_and_hides_what_is_behind() -> None:
    found = _seen((2.0, 1.5), CUPBOARD)
    assert found[-1, 0][:, 0] == pytest.approx(1.2, abs=1e-3)
    # Shadow of 1 m at 0.8 m, on a wall at 2 m: 2.5 m of it.
    behind = found[0, 0][:, 1]
    assert not ((behind > 1.5 - 1.2) & (behind < 1.5 + 1.2)).any()


def test_nothing_is_seen_from_within_something_nor_of_what_is_short() -> None:
    truth, mesh = _building(CUPBOARD)
    surfaces = Surfaces(truth, mesh, CONFIG)
    stops = np.array([[1.1, 1.5], [4.1, 3.0]])  # in the cupboard, in the wall
    assert not len(seen(surfaces, stops, np.random.default_rng(0), CONFIG)[0])
    patch, _ = seen(surfaces, np.array([[2.0, 3.0]]), np.random.default_rng(0), CONFIG)
    assert (surfaces.face[patch] == -1).any()  # the cupboard's front, but not its ends of 0.2 m
    assert (np.abs(surfaces.normal[patch[surfaces.face[patch] == -1], 1]) < 0.1).all()


def test_walks_are_in_rooms_and_doors() -> None:
    truth, _ = _building()
    for seed in range(20):
        stops = walk(truth, np.random.default_rng(seed), CONFIG)
        assert len(stops) >= 1
        for stop in stops:
            inside = any(room.polygon.covers(Point(stop)) for room in truth.rooms)
            assert inside or np.allclose(stop, [4.1, 1.5])
