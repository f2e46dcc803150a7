import json

import pytest
from drawings import house, write

from slam.core import InputError
from worlds.catalogue import load_scene, scene_counts, scene_names
from worlds.planfile import plan_text, read_plan


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
    again = read_plan(write(plan_text(plan), tmp_path))
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


def two_storeys():
    """The house twice, one on the other, with a ramp between them."""
    tree = house()
    upper = house()["storeys"][0]
    upper.update(name="1", z_floor=3.0, z_ceiling=5.6)
    tree["storeys"].append(upper)
    tree["ramps"] = [{"storey": 0, "foot": [[-4, 1.8], [-4, 0.2]], "head": [[12, 1.8], [12, 0.2]]}]
    return tree


def test_ramps_routes_and_conditions_are_read_and_written(tmp_path):
    tree = two_storeys()
    tree["conditions"] = "ideal"
    tree["routes"] = [{"name": "upstairs", "storey": 1, "rooms": ["0", "2"]}]
    plan = read_plan(write(tree, tmp_path))
    for one in (plan, read_plan(write(plan_text(plan), tmp_path))):
        assert one.conditions == "ideal"
        assert one.routes == plan.routes
        assert (one.routes[0].name, one.routes[0].rooms, one.routes[0].storey) == (
            "upstairs",
            ("0", "2"),
            1,
        )
        assert one.ramps[0].run == pytest.approx(16.0)
        assert one.ramps[0].outline.area == pytest.approx(16.0 * 1.6)


BAD_LINKS = {
    "too steep": ({"head": [[4, 1.8], [4, 0.2]]}, "slope"),
    "right end first": (
        {"foot": [[-4, 0.2], [-4, 1.8]], "head": [[12, 0.2], [12, 1.8]]},
        "left end",
    ),
    "crossed": ({"head": [[12, 0.2], [12, 1.8]]}, "rectangle"),
    "askew": ({"head": [[13, 1.8], [12, 0.2]]}, "rectangle"),
    "one end": ({"foot": [[-4, 1.8]]}, "foot"),
    "from the top": ({"storey": 1}, "storey"),
    "half a storey": ({"storey": 0.5}, "storey"),
}


@pytest.mark.parametrize("case", BAD_LINKS)
def test_bad_ramps_are_refused(case, tmp_path):
    change, named = BAD_LINKS[case]
    tree = two_storeys()
    tree["ramps"][0].update(change)
    with pytest.raises(InputError, match=rf"house\.json: ramps\[0\].*{named}"):
        read_plan(write(tree, tmp_path))


@pytest.mark.parametrize(
    ("route", "named"),
    [
        ({"name": "a", "rooms": ["cellar"]}, r"rooms\[0\]"),
        ({"name": "a", "rooms": []}, "at least one room"),
        ({"name": "a", "storey": 7, "rooms": ["0"]}, "storey"),
        ({"rooms": ["0"]}, "name"),
        ({"name": "Twice", "rooms": ["0"]}, "twice"),
    ],
)
def test_bad_routes_are_refused(route, named, tmp_path):
    tree = house()
    tree["routes"] = [{"name": "twice", "rooms": ["1"]}, route]
    with pytest.raises(InputError, match=rf"routes\[1\].*{named}"):
        read_plan(write(tree, tmp_path))


def test_a_scene_may_share_the_building_of_another(tmp_path):
    write(house(), tmp_path)
    other = {"format": "roomloop-plan-1", "name": "site", "building": "house"}
    plan = read_plan(write({**other, "conditions": "ideal"}, tmp_path, "site.json"))
    assert plan.storeys == read_plan(tmp_path / "house.json").storeys
    assert (plan.name, plan.conditions) == ("site", "ideal")
    for bad in ("no-such-plan", "../house", "site2", 3):
        write(other, tmp_path, "site2.json")
        with pytest.raises(InputError, match=r"site2\.json: building"):
            read_plan(write({**other, "building": bad}, tmp_path, "site2.json"))
