"""Every reader: which one is chosen, and that bad files end in one line, never in an exception."""

import json
from collections.abc import Callable
from pathlib import Path

import buildings
import numpy as np
import pytest
from buildings import LEFT, RIGHT, WALLS
from drawings import house, write
from shapely.geometry import box

from eval.cli import main
from slam.core import InputError
from worlds.readers import ReaderOptions, read_building
from worlds.readers.options import AXES

METRES = ReaderOptions(unit="m", up="z")


def mesh_file(suffix: str) -> Callable[[Path], Path]:
    def made(folder: Path) -> Path:
        path = folder / f"building.{suffix}"
        buildings.building().export(path)
        return path

    return made


FILES: dict[str, Callable[[Path], Path]] = {
    "plan": lambda folder: write(house(), folder),
    "floor plan": lambda folder: buildings.saved(buildings.floorplan(), folder),
    "map": lambda folder: buildings.rosmap(folder, buildings.drawn_map()),
    "dae": lambda folder: buildings.dae(buildings.building(), folder),
    **{suffix: mesh_file(suffix) for suffix in ("obj", "stl", "ply", "glb")},
}


@pytest.mark.parametrize("name", FILES)
def test_a_file_under_another_suffix_is_refused_by_what_it_is(name, tmp_path):
    path = FILES[name](tmp_path)
    other = path.rename(path.with_suffix(".ifc"))
    with pytest.raises(InputError, match="expected IFC by its suffix"):
        read_building(other)


@pytest.mark.parametrize("name", ["dae", "ply", "glb", "plan"])
def test_a_file_of_no_known_suffix_is_known_by_its_content(name, tmp_path):
    path = FILES[name](tmp_path)
    assert read_building(path.rename(tmp_path / "building.bin")).storeys


@pytest.mark.parametrize("suffix", ["json", "ifc", "dae", "obj", "stl", "ply", "glb", "yaml"])
def test_empty_files_are_refused(suffix, tmp_path):
    path = tmp_path / f"empty.{suffix}"
    path.write_bytes(b"")
    with pytest.raises(InputError, match="found an empty file"):
        read_building(path)


@pytest.mark.parametrize("suffix", ["json", "ifc", "dae", "obj", "stl", "ply", "glb", "yaml"])
def test_a_gigabyte_is_refused_by_its_size(suffix, tmp_path):
    path = tmp_path / f"huge.{suffix}"
    with path.open("wb") as file:
        file.truncate(1_000_000_000)
    with pytest.raises(InputError, match=r"1000 MB, expected .* of at most"):
        read_building(path)


def test_the_command_says_one_line_and_exits_with_2(tmp_path, capsys):
    path = tmp_path / "broken.dae"
    path.write_text("<COLLADA>")
    for command in (["run", str(path)], ["scenes", "--show", str(path)]):
        assert main(command) == 2
        (line,) = capsys.readouterr().err.splitlines()
        assert line.startswith(f"roomloop: {path}: expected COLLADA")


def test_a_file_can_be_drawn_with_its_unit_and_axis(tmp_path, capsys):
    mesh = buildings.y_up(buildings.building())
    mesh.apply_scale(1.0 / 0.0254)
    mesh.export(tmp_path / "house.obj")
    out = tmp_path / "house.png"
    command = ["scenes", "--show", str(tmp_path / "house.obj"), "--out", str(out)]
    assert main([*command, "--unit", "in", "--up", "y"]) == 0
    assert out.is_file()
    assert "no room truth" in capsys.readouterr().err


@pytest.mark.parametrize(("name", "value"), [("unit", "furlong"), ("up", "x"), ("up", "Z up")])
def test_unknown_options_are_refused(name, value):
    with pytest.raises(InputError, match=f'{name} "{value}": expected'):
        ReaderOptions(**{name: value})
    assert AXES == ("y", "z")


@pytest.mark.parametrize("name", ["unit", "up"])
def test_a_plan_takes_no_options(name, tmp_path):
    option = ReaderOptions(**{name: {"unit": "m", "up": "z"}[name]})
    with pytest.raises(InputError, match=f"--{name}: JSON files do not take it"):
        read_building(FILES["plan"](tmp_path), option)


@pytest.mark.parametrize(
    ("scale", "ceiling", "said"),
    [(1.0, 300.0, "9 x 6 m, 300 m high"), (1000.0, 2.6, r"9\d\d\d x 6\d\d\d m, 3 m high")],
)
def test_what_is_larger_than_any_building_is_refused(tmp_path, scale, ceiling, said):
    plan = house()
    (storey,) = plan["storeys"]
    storey["z_ceiling"] = ceiling
    for thing in (*storey["rooms"], *storey["walls"], *storey["doors"]):
        for key in thing.keys() & {"outline", "from", "to", "at"}:
            thing[key] = (scale * np.array(thing[key])).tolist()
    with pytest.raises(InputError, match=rf"storeys\[0\]: {said}, expected a building of at most"):
        read_building(write(plan, tmp_path))


# --- JSON ----------------------------------------------------------------------------------------


def test_walls_of_part_height_are_open_above_or_below(tmp_path):
    low = {"solid": [buildings.as_polygon(box(2, 2, 3, 2.2))], "z_min": 0.0, "z_max": 1.1}
    hung = {"solid": [buildings.as_polygon(box(2, 3, 3, 3.2))], "z_min": 2.1, "z_max": 2.6}
    flat = {"solid": [buildings.as_polygon(box(2, 4, 3, 4.2))], "z_min": 2.6, "z_max": 9.0}
    tree = buildings.floorplan(walls=[{"solid": [buildings.as_polygon(WALLS)]}, low, hung, flat])
    (storey,) = read_building(buildings.saved(tree, tmp_path)).storeys
    found = {round(o.footprint.centroid.y, 1): (o.z_min, o.z_max) for o in storey.openings[2:]}
    assert found == {2.1: pytest.approx((1.1, 2.6)), 3.1: pytest.approx((0.0, 2.1))}
    assert storey.walls.area == pytest.approx(WALLS.area + 0.4)


def test_windows_have_glass_and_columns_are_solid(tmp_path):
    column = {"polygon": [[3, 2], [3.3, 2], [3.3, 2.3], [3, 2.3]]}
    tree = buildings.floorplan(columns=[column])
    (storey,) = read_building(buildings.saved(tree, tmp_path)).storeys
    assert {o.kind: o.glass for o in storey.openings} == {"door": False, "window": True}
    assert storey.walls.area == pytest.approx(WALLS.area + 0.09)


def rooms(*shapes):
    return [
        {"id": str(k), "name": f"room-{k}", "polygons": [buildings.as_polygon(shape)]}
        for k, shape in enumerate(shapes)
    ]


CROSS = {"outer": [[0, 0], [5, 5], [5, 0], [0, 5]], "holes": []}


@pytest.mark.parametrize(
    ("tree", "named"),
    [
        (buildings.floorplan(rooms=rooms(LEFT, LEFT)), "overlap by 23.0 m2"),
        (buildings.floorplan(rooms=rooms(LEFT.union(RIGHT).convex_hull)), "a wall runs through"),
        (buildings.floorplan(walls=[{"solid": [CROSS]}]), r"walls\[0\].solid\[0\].outer.*cross"),
        (buildings.floorplan(openings=[buildings.opening("door", LEFT, 2.0, 1.0)]), "z_max above"),
        (buildings.floorplan() | {"units": "inch"}, "units: expected metre"),
        (buildings.floorplan() | {"units": 5}, "units: expected metre"),
        (buildings.floorplan(walls=7), "walls: expected a list"),
        (buildings.floorplan(rooms=[7]), r"rooms\[0\]: expected an object"),
        (buildings.floorplan(z_floor=1e300), "z_floor: expected metres"),
        (buildings.floorplan(z_floor=10**400), "z_floor"),
        (buildings.floorplan(name=["x"]), "name: expected a text"),
        ('{"storeys": ' * 3000, "too deeply|expected JSON"),
        ('{"storeys": [], "storeys": []}', "stands twice"),
        ('{"storeys": [' + "[0,0]," * 300_000 + "[0,0]]}", "300001 corners"),
        ('{"storeys": [{"z_floor": NaN}]}', "storey"),
        ("[" * 100_000, "too deeply|expected JSON"),
        ("[1, 2]", "an object"),
        ("{}", "format"),
    ],
)
def test_what_is_wrong_in_a_floor_plan_is_named(tree, named, tmp_path):
    with pytest.raises(InputError, match=named) as refused:
        read_building(buildings.saved(tree, tmp_path))
    assert "\n" not in str(refused.value)
    assert len(str(refused.value)) < 400


def test_a_plan_whose_walls_cross_without_end_is_refused(tmp_path):
    rng = np.random.default_rng(0)
    ends = rng.uniform(0.0, 100.0, (20_000, 2, 2)).tolist()
    plan = house()
    plan["storeys"][0]["walls"] = [{"from": a, "to": b, "thickness": 0.1} for a, b in ends]
    with pytest.raises(InputError, match="cross without end"):
        read_building(write(plan, tmp_path))


def test_a_floor_plan_in_inches_is_refused_by_its_size(tmp_path):
    tree = buildings.floorplan(
        rooms=[{"name": "x", "polygons": [buildings.as_polygon(LEFT, 1000.0)]}],
        walls=[{"solid": [buildings.as_polygon(WALLS, 1000.0)]}],
        openings=[],
    )
    with pytest.raises(InputError, match=r"would measure 8200.0 x 5200.0 m"):
        read_building(buildings.saved(json.loads(json.dumps(tree)), tmp_path))
