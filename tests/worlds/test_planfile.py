import json

import pytest
from drawings import house, write

from slam.core import InputError
from worlds.catalogue import load_scene, scene_counts, scene_names
from worlds.planfile import read_plan, write_plan


def test_a_plan_is_read(tmp_path):
    (storey,) = read_plan(write(house(), tmp_path)).storeys
    assert [room.name for room in storey.rooms] == ["left", "right", "hall"]
    # 30 m of outer walls and, between their inner faces, 8.8 m and 3.85 m of inner ones
    assert storey.walls.area == pytest.approx(30 * 0.2 + 8.8 * 0.1 + 3.85 * 0.1)
    assert [opening.kind for opening in storey.openings] == ["door", "door"]


def test_a_ceiling_that_is_not_given_is_at_2_7_m(tmp_path):
    tree = house()
    del tree["storeys"][0]["z_ceiling"]
    assert read_plan(write(tree, tmp_path)).storeys[0].z_ceiling == 2.7


@pytest.mark.parametrize("name", ["SE1"])
def test_written_and_read_again_it_is_the_same_building(name, tmp_path):
    plan = load_scene(name)
    write_plan(plan, tmp_path / "again.json")
    again = read_plan(tmp_path / "again.json")
    for one, two in zip(plan.storeys, again.storeys, strict=True):
        assert one.walls.symmetric_difference(two.walls).area < 1e-9
        assert [r.name for r in one.rooms] == [r.name for r in two.rooms]
        for a, b in zip(one.rooms, two.rooms, strict=True):
            assert a.outline.symmetric_difference(b.outline).area < 1e-9
        for a, b in zip(one.openings, two.openings, strict=True):
            assert (a.kind, a.z_min, a.z_max) == (b.kind, b.z_min, b.z_max)
            assert a.footprint.symmetric_difference(b.footprint).area < 1e-9


def spoilt(**changes):
    """The house with one thing wrong in its storey: {field: function of the storey}."""
    tree = house()
    for change in changes.values():
        change(tree["storeys"][0])
    return tree


BAD = {
    "crossing": lambda s: s["rooms"][0].update(outline=[[0, 2], [4, 6], [4, 2], [0, 6]]),
    "thickness": lambda s: s["walls"][0].update(thickness=0.0),
    "negative": lambda s: s["walls"][0].update(thickness=-0.1),
    "no length": lambda s: s["walls"][0].update(to=[0, 0]),
    "door beside": lambda s: s["doors"][0].update(at=[2, 4]),
    "overlap": lambda s: s["rooms"][0].update(outline=[[0, 2], [6, 2], [6, 6], [0, 6]]),
    "unknown key": lambda s: s["walls"][0].update(thicknes=0.1),
    "missing": lambda s: s["rooms"][0].pop("outline"),
    "type": lambda s: s["walls"][0].update(thickness="thick"),
    "boolean": lambda s: s["walls"][0].update(thickness=True),
    "two corners": lambda s: s["rooms"][0].update(outline=[[0, 0], [1, 1]]),
    "door width": lambda s: s["doors"][0].update(width=0),
    "upside down": lambda s: s.update(z_ceiling=-1.0),
}
NAMES = {
    "crossing": "rooms[0].outline",
    "thickness": "walls[0].thickness",
    "negative": "walls[0].thickness",
    "no length": "walls[0]",
    "door beside": "doors[0]",
    "overlap": "overlap",
    "unknown key": "thickness",
    "missing": "outline",
    "type": "walls[0].thickness",
    "boolean": "walls[0].thickness",
    "two corners": "rooms[0].outline",
    "door width": "doors[0].width",
    "upside down": "z_ceiling",
}


@pytest.mark.parametrize("case", BAD)
def test_what_is_wrong_is_named_with_file_and_field(case, tmp_path):
    path = write(spoilt(it=BAD[case]), tmp_path)
    with pytest.raises(InputError) as refused:
        read_plan(path)
    message = str(refused.value)
    assert "house.json" in message
    assert NAMES[case] in message
    assert "\n" not in message


@pytest.mark.parametrize(
    "text",
    [
        "",
        "{",
        "[1, 2",
        "null",
        "[]",
        '"plan"',
        "{}",
        '{"format": "other"}',
        json.dumps(house()).replace("2.6", "NaN"),
        json.dumps(house()).replace("2.6", "Infinity"),
        json.dumps(house()).replace("2.6", "1e999"),
        "\x00\x01",
    ],
)
def test_files_that_are_no_plans_are_refused(text, tmp_path):
    with pytest.raises(InputError, match=r"house\.json"):
        read_plan(write(text, tmp_path))


def test_bytes_that_are_no_text_are_refused(tmp_path):
    (tmp_path / "house.json").write_bytes(b"\xff\xfe\x00{")
    with pytest.raises(InputError, match=r"house\.json"):
        read_plan(tmp_path / "house.json")


def test_a_plan_with_a_million_corners_is_refused_quickly(tmp_path):
    tree = house()
    ring = [[k * 1e-5, 2 + (k % 2) * 1e-3] for k in range(400_000)]
    tree["storeys"][0]["rooms"][0]["outline"] = ring
    with pytest.raises(InputError, match=r"house\.json"):
        read_plan(write(tree, tmp_path))


def test_unknown_scenes_name_the_nearest():
    with pytest.raises(InputError, match="SE1"):
        load_scene("SE11")
    with pytest.raises(InputError, match="no/such/plan"):
        load_scene("no/such/plan.json")


def test_se1_has_the_rooms_of_table_i():
    assert "SE1" in scene_names()
    kinds = [room.kind for room in load_scene("SE1").storeys[0].rooms]
    assert kinds.count("room") == 6
    assert kinds.count("corridor") == 3
    assert scene_counts(load_scene("SE1")) is not None
