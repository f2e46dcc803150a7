"""The catalogue holds what its files say, and what the paper's Table I says."""

import itertools
import json
import re
from functools import cache

import numpy as np
import pytest

from worlds.catalogue import SCENES, load_scene, scene_counts, scene_names
from worlds.conditions import IDEAL
from worlds.world import true_world

TABLE_I = {
    "SC1F1": {"L-shaped": 1, "squared": 1, "corridor": 2},
    "SC1F2": {"squared": 5, "elongated": 2, "corridor": 1},
    "SE1": {"squared": 6, "corridor": 3},
    "SE2": {"squared": 5, "elongated": 2},
    "SE3": {"squared": 22, "corridor": 4},
    "RC1F1": {"L-shaped": 1, "squared": 1, "corridor": 2},
    "RC1F2": {"squared": 5, "elongated": 2, "corridor": 1},
    "RC2F2": {"squared": 7, "L-shaped": 2, "elongated": 3},
    "RC3F2": {"squared": 9, "L-shaped": 3, "corridor": 2},
}
HARD = ["SE3", "RC1F1", "RC1F2", "RC2F2", "RC3F2"]
BEYOND = ["angled", "curved", "hotel", "identical", "open-plan", "ramp"]


@cache
def truth(name):
    return true_world(load_scene(name), np.random.SeedSequence(0), IDEAL)


def test_the_catalogue_is_complete():
    assert scene_names() == sorted([*TABLE_I, *BEYOND])


@pytest.mark.parametrize("name", TABLE_I)
def test_it_has_exactly_the_rooms_of_table_i(name):
    assert dict(scene_counts(load_scene(name)).rooms) == TABLE_I[name]
    assert len(truth(name).rooms) == sum(TABLE_I[name].values())


@pytest.mark.parametrize("name", TABLE_I)
def test_it_says_where_it_comes_from(name):
    notes = load_scene(name).notes
    assert "Reconstructed from the published description" in notes
    assert "not public" in notes


@pytest.mark.parametrize("name", [*TABLE_I, *BEYOND])
def test_its_ranges_are_those_that_it_states(name):
    stated = re.search(
        r"Ranges: walls (.+?) m thick; doors (.+?) m wide.*; ceiling (.+?) m; rooms (.+?) m2\.",
        load_scene(name).notes,
    )
    assert stated is not None
    tree = json.loads((SCENES / f"{name}.json").read_text())
    tree = json.loads((SCENES / f"{tree.get('building', name)}.json").read_text())
    storeys = tree["storeys"]
    walls = [w["thickness"] for s in storeys for w in s["walls"] if "thickness" in w]
    doors = [d["width"] for s in storeys for d in s["doors"] if d.get("kind", "door") == "door"]
    heights = [s["z_ceiling"] - s["z_floor"] for s in storeys]
    areas = [room.polygon.area for room in truth(name).rooms]
    for text, values, digits in zip(
        stated.groups(), (walls, doors, heights, areas), (2, 2, 2, 1), strict=True
    ):
        low, high = (f"{value:.{digits}f}" for value in (min(values), max(values)))
        assert text == (low if low == high else f"{low} to {high}")


@pytest.mark.parametrize("name", HARD)
def test_the_hard_ones_have_walls_and_rooms_of_many_sizes(name):
    thickness = [wall.thickness for wall in truth(name).walls]
    areas = [room.polygon.area for room in truth(name).rooms]
    outer = [w["thickness"] for w in json.loads(file_of(name).read_text())["storeys"][0]["walls"]]
    assert min(thickness) >= 0.0999
    assert max(outer) <= 0.30
    assert max(outer) - min(outer) >= 0.17
    assert min(areas) >= 6.0
    assert max(areas) <= 60.0


def file_of(name):
    building = {"RC1F1": "SC1F1", "RC1F2": "SC1F2"}.get(name, name)
    return SCENES / f"{building}.json"


def test_between_them_the_hard_ones_span_rooms_of_6_to_60_m2():
    for name in ("SE3", "RC2F2", "RC3F2"):
        areas = [room.polygon.area for room in truth(name).rooms]
        assert min(areas) < 7.5
        assert max(areas) > 45.0


@pytest.mark.parametrize("name", ["SE3", "RC1F1", "RC1F2", "RC3F2"])  # RC2F2 has no corridor
def test_a_third_of_the_corridors_faces_are_collinear_across_rooms(name):
    corridors = {room.id for room in truth(name).rooms if room.kind == "corridor"}
    faces = truth(name).faces
    own = [face for face in faces if face.room in corridors]
    shared = [
        face
        for face in own
        if any(o.surface == face.surface and o.room != face.room for o in faces)
    ]
    assert len(shared) >= len(own) / 3


@pytest.mark.parametrize("name", HARD)
def test_two_rooms_differ_by_their_door_only(name):
    rooms = truth(name).rooms
    twins = [
        (a, b)
        for a, b in itertools.combinations(rooms, 2)
        if a.kind == b.kind and np.allclose(sides(a), sides(b), atol=2e-3)
    ]
    assert any(doors(name, a) != doors(name, b) for a, b in twins)


def sides(room):
    """Lengths of the four sides of a rectangular room, sorted; of others nothing equal."""
    ring = np.asarray(room.polygon.simplify(1e-3).exterior.coords)
    lengths = np.sort(np.linalg.norm(np.diff(ring, axis=0), axis=1))
    return lengths if len(lengths) == 4 else np.full(4, np.nan)


def doors(name, room):
    """How far each door of a room is from the room's corners, to a centimetre."""
    ring = np.asarray(room.polygon.simplify(1e-3).exterior.coords)[:-1]
    own = [door for door in truth(name).doors if room.id in door.rooms]
    return {tuple(np.sort(np.linalg.norm(ring - d.centre, axis=1)).round(2)) for d in own}


@pytest.mark.parametrize(("real", "simulated"), [("RC1F1", "SC1F1"), ("RC1F2", "SC1F2")])
def test_the_real_site_and_its_simulation_share_the_building(real, simulated):
    one, other = load_scene(real), load_scene(simulated)
    assert one.conditions == "real-site"
    assert other.conditions == "as-built"
    for a, b in zip(one.storeys, other.storeys, strict=True):
        assert a == b


def test_headings_and_ceilings_are_not_one_value_everywhere():
    headings, ceilings = set(), set()
    for name in TABLE_I:
        storey = load_scene(name).storeys[0]
        ceilings.add(storey.z_ceiling)
        (x0, y0), (x1, y1) = storey.walls.geoms[0].exterior.coords[:2]
        headings.add(round(np.degrees(np.arctan2(y1 - y0, x1 - x0)) % 90.0, 1))
    assert len(ceilings) >= 4
    assert len(headings) >= 4


def test_se3_has_one_route_through_all_rooms_and_one_through_14():
    plan = load_scene("SE3")
    assert {route.name: len(route.rooms) for route in plan.routes} == {"all": 26, "fourteen": 14}


def test_no_two_walls_of_a_room_are_parallel_in_the_angled_building():
    for room in truth("angled").rooms:
        normals = [truth("angled").faces[f].normal for f in room.faces]
        for a, b in itertools.combinations(normals, 2):
            assert abs(a @ b) < np.cos(np.radians(2.0))


def test_the_rooms_of_the_row_are_identical():
    rooms = [room for room in truth("identical").rooms if room.kind == "room"]
    assert len(rooms) == 10
    for room in rooms:
        assert sides(room) == pytest.approx(sides(rooms[0]), abs=1e-6)
        assert doors("identical", room) == doors("identical", rooms[0])
