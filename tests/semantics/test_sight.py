"""What is seen from where, against rooms simple enough to work it out by hand."""

from __future__ import annotations

import numpy as np
import pytest
from shapely.geometry import Point, box

from semantics.sight import SightConfig, seen, walk
from slam.core import Array
from worlds.truth import Door, Face, Room, Truth

CONFIG = SightConfig(rays=3600)


def _face(name: int, room: int, ends: Array) -> Face:
    run = ends[1] - ends[0]
    normal = np.array([-run[1], run[0], 0.0]) / np.linalg.norm(run)
    return Face(name, room, normal, 0.0, ends, ends[None], (0.0, 2.5), name)


def _two_rooms() -> Truth:
    """4 x 4 m each, side by side, a door from y = 1 to y = 2 in the wall between them."""
    corners = np.array([[0.0, 0.0], [4.0, 0.0], [4.0, 4.0], [0.0, 4.0]])
    faces = []
    for room in (0, 1):
        ring = corners + np.array([4.2 * room, 0.0])
        faces += [
            _face(4 * room + k, room, np.array([ring[k], ring[(k + 1) % 4]])) for k in range(4)
        ]
    for name in (1, 7):  # the two faces that the door is in
        face = faces[name]
        x = face.segment[0, 0]
        parts = np.array([[[x, 0.0], [x, 1.0]], [[x, 2.0], [x, 4.0]]])
        faces[name] = Face(name, face.room, face.normal, 0.0, face.segment, parts, (0.0, 2.5), name)
    rooms = tuple(
        Room(k, str(k), "room", 0, box(4.2 * k, 0, 4.2 * k + 4, 4), tuple(range(4 * k, 4 * k + 4)))
        for k in (0, 1)
    )
    door = Door(np.array([4.1, 1.5, 1.0]), (0, 1), 1.0, 2.0)
    return Truth(tuple(faces), (), rooms, (door,), ())


def test_from_the_middle_of_a_room_all_of_it_is_seen_and_of_the_next_what_the_door_lets() -> None:
    found = seen(_two_rooms(), np.array([[2.0, 1.5]]), np.zeros((0, 2, 2)), CONFIG)
    assert set(found) == {0, 1, 2, 3, 5}
    for face in (0, 2, 3):
        assert found[face] == pytest.approx(np.array([[0.0, 4.0]]), abs=0.05)
    assert found[1] == pytest.approx(np.array([[0.0, 1.0], [2.0, 4.0]]), abs=0.05)
    # Through the door, 2.2 m away and 1 m wide, onto a wall 6.2 m away.
    half = 0.5 * 6.2 / 2.2
    assert found[5] == pytest.approx(np.array([[1.5 - half, 1.5 + half]]), abs=0.06)


def test_what_stands_in_the_way_hides_what_is_behind() -> None:
    cupboard = np.array([[[1.0, 1.0], [1.0, 2.0]]])
    found = seen(_two_rooms(), np.array([[2.0, 1.5]]), cupboard, CONFIG)
    # Shadow of 1 m at 1 m, on a wall at 2 m: 2 m in the middle of the far wall (which runs down).
    assert found[3] == pytest.approx(np.array([[0.0, 1.5], [3.5, 4.0]]), abs=0.06)


def test_nobody_sees_the_back_of_a_face() -> None:
    found = seen(_two_rooms(), np.array([[4.1, 3.0]]), np.zeros((0, 2, 2)), CONFIG)
    assert not found


def test_walks_are_in_rooms_and_doors() -> None:
    truth = _two_rooms()
    for seed in range(20):
        stops = walk(truth, np.random.default_rng(seed), CONFIG)
        assert len(stops) >= 1
        for stop in stops:
            inside = any(room.polygon.covers(Point(stop)) for room in truth.rooms)
            assert inside or np.allclose(stop, [4.1, 1.5])
