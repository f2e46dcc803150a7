import logging
import subprocess
import sys
from pathlib import Path

import buildings
import numpy as np
import pytest
import shapely
from buildings import DOOR, HEIGHT, LEFT, RIGHT, WALLS, WINDOW, IfcFile

from sim.route import plan_route
from slam.core import InputError
from worlds.conditions import AS_BUILT, IDEAL
from worlds.plan import UNLABELLED
from worlds.readers import ReaderOptions, read_building
from worlds.world import build_world

pytest.importorskip("ifcopenshell", reason="needs the extra ifc")

SHARED = Path(__file__).parents[2].parent / "shared" / "data"
DUPLEX = SHARED / "ifc" / "duplex.ifc"
METRES = {"length": {"is_metric": True, "raw": "METERS"}}
MILLIMETRES = {"length": {"is_metric": True, "raw": "MILLIMETERS"}}


def assert_is_the_building(storey, z=0.0):
    assert (storey.z_floor, storey.z_ceiling) == pytest.approx((z, z + HEIGHT))
    assert storey.walls.symmetric_difference(WALLS).area < 1e-6
    door, window = sorted(storey.openings, key=lambda o: o.z_min)
    assert (door.kind, door.glass, window.kind, window.glass) == ("door", False, "window", True)
    assert (door.z_min, door.z_max) == pytest.approx((0.0, 2.1))
    assert (window.z_min, window.z_max) == pytest.approx((0.9, 2.0))
    for opening, drawn in ((door, DOOR), (window, WINDOW)):
        cut = opening.footprint.intersection(storey.walls)
        assert cut.symmetric_difference(drawn).area < 1e-6


def test_walls_spaces_doors_and_windows_are_those_drawn(tmp_path):
    (storey,) = read_building(buildings.ifc(tmp_path)).storeys
    assert_is_the_building(storey)
    rooms = sorted(storey.rooms, key=lambda room: room.outline.centroid.x)
    assert [(r.name, r.kind) for r in rooms] == [("office", "room"), ("corridor", "corridor")]
    for room, drawn in zip(rooms, (LEFT, RIGHT), strict=True):
        assert room.outline.symmetric_difference(drawn).area < 1e-6


def test_what_was_read_can_be_driven_through(tmp_path):
    world = build_world(read_building(buildings.ifc(tmp_path)), np.random.SeedSequence(0), AS_BUILT)
    assert [sorted(d.rooms) for d in world.truth.doors] == [[0, 1]]
    assert len(plan_route(world).rooms) == 2


def test_millimetres_are_as_good_as_metres(tmp_path):
    path = IfcFile(MILLIMETRES).furnish(scale=1000.0).saved(tmp_path)
    assert_is_the_building(read_building(path).storeys[0])


def test_without_spaces_the_rooms_are_what_walls_enclose_and_it_says_so(tmp_path, caplog):
    with caplog.at_level(logging.WARNING):
        plan = read_building(buildings.ifc(tmp_path, spaces=False))
    assert "no IfcSpace" in caplog.text
    assert "no room truth" in plan.notes
    assert_is_the_building(plan.storeys[0])
    rooms = sorted(plan.storeys[0].rooms, key=lambda room: room.outline.centroid.x)
    assert {room.kind for room in rooms} == {UNLABELLED}
    for room, drawn in zip(rooms, (LEFT, RIGHT), strict=True):
        assert room.outline.symmetric_difference(drawn).area < 0.01
    assert not build_world(plan, np.random.SeedSequence(0), IDEAL).truth.rooms_known


@pytest.mark.parametrize("spaces", [True, False])
def test_storeys_are_told_apart(spaces, tmp_path):
    path = IfcFile(METRES, floors=(0.0, 2.8)).furnish(spaces).saved(tmp_path)
    lower, upper = read_building(path).storeys
    assert_is_the_building(lower)
    assert (upper.z_floor, upper.z_ceiling) == pytest.approx((2.8, 5.4))
    assert (len(upper.rooms), len(upper.openings)) == (2, 0)


def test_an_outer_wall_through_two_storeys_bounds_both(tmp_path):
    file = IfcFile(METRES, floors=(0.0, 2.8))
    for name in buildings.IFC_WALLS:
        file.wall(name, height=5.4)
    for z in (0.0, 2.8):
        file.space("hall", LEFT, z)
    for storey in read_building(file.saved(tmp_path)).storeys:
        assert storey.walls.symmetric_difference(WALLS).area < 1e-6


def test_a_low_wall_is_open_above(tmp_path):
    file = IfcFile(METRES).furnish()
    low = file.box("IfcWall", "low", ((2.0, 2.0), (3.0, 2.2)), (0.0, 1.1))
    file.api.spatial.assign_container(file.model, [low], file.storeys[0.0])
    (storey,) = read_building(file.saved(tmp_path)).storeys
    (above,) = (o for o in storey.openings if o.footprint.centroid.y == pytest.approx(2.1))
    assert (above.z_min, above.z_max) == pytest.approx((1.1, HEIGHT))
    assert above.footprint.symmetric_difference(shapely.box(2.0, 2.0, 3.0, 2.2)).area < 1e-6


def test_the_plates_of_a_curtain_wall_are_glass(tmp_path):
    file = IfcFile(METRES).furnish()
    curtain = file._entity("IfcCurtainWall")
    plate = file.box("IfcPlate", "pane", ((2.0, 3.0), (4.0, 3.05)), (0.0, HEIGHT))
    file.api.aggregate.assign_object(file.model, [plate], curtain)
    (storey,) = read_building(file.saved(tmp_path)).storeys
    (pane,) = (o for o in storey.openings if o.footprint.centroid.y == pytest.approx(3.025))
    assert (pane.kind, pane.glass) == ("window", True)
    assert storey.walls.area == pytest.approx(WALLS.area + 0.1)


def test_an_undeclared_unit_is_taken_as_metres_with_a_warning(tmp_path, caplog):
    with caplog.at_level(logging.WARNING):
        plan = read_building(IfcFile().furnish().saved(tmp_path))
    assert "IfcUnitAssignment: no unit declared" in caplog.text
    assert "8.2 x 5.2 x 2.6 m" in caplog.text
    assert_is_the_building(plan.storeys[0])


def test_the_unit_asked_for_wins(tmp_path):
    path = IfcFile(METRES).furnish(scale=1.0 / 0.3048).saved(tmp_path)
    assert_is_the_building(read_building(path, ReaderOptions(unit="ft")).storeys[0])


# --- what is wrong -------------------------------------------------------------------------------


def test_no_walls(tmp_path):
    file = IfcFile(METRES)
    file.space("office", LEFT)
    with pytest.raises(InputError, match="IfcWall: expected at least one wall, found none"):
        read_building(file.saved(tmp_path))


def test_overlapping_spaces(tmp_path):
    file = IfcFile(METRES).furnish()
    file.space("twin", LEFT)
    with pytest.raises(InputError, match=r'storey "level 0": rooms ".*" and ".*" overlap'):
        read_building(file.saved(tmp_path))


def test_a_wall_through_a_space(tmp_path):
    file = IfcFile(METRES).furnish(spaces=False)
    file.space("hall", shapely.box(0.1, 0.1, 7.9, 4.9))
    with pytest.raises(InputError, match=r'room "hall": a wall runs through it'):
        read_building(file.saved(tmp_path))


def test_a_building_in_millimetres_that_calls_them_metres(tmp_path):
    path = IfcFile(METRES).furnish(scale=1000.0).saved(tmp_path)
    with pytest.raises(InputError, match=r"would measure 8200.0 x .* mm \(8.2 x 5.2 x 2.6 m\)"):
        read_building(path)


@pytest.mark.parametrize("part", [0.0, 0.1, 0.5, 0.9, 0.999])
def test_a_file_that_is_cut_off(part, tmp_path):
    path = buildings.ifc(tmp_path)
    path.write_bytes(path.read_bytes()[: int(part * path.stat().st_size)])
    with pytest.raises(InputError, match=r"building\.ifc: expected IFC"):
        read_building(path)


def test_coordinates_that_are_not_finite(tmp_path):
    path = buildings.ifc(tmp_path)
    path.write_text(path.read_text().replace("(8.1,", "(1.E999,"))
    with pytest.raises(InputError, match="building.ifc"):
        read_building(path)


def test_a_file_that_the_parser_never_ends_on(tmp_path, monkeypatch):
    monkeypatch.setattr("worlds.readers.ifcprocess.PATIENCE", 4.0)
    file = IfcFile(METRES).furnish()
    space = file.model.by_type("IfcSpace")[0]
    space.Decomposes[0].RelatingObject = space  # a space within itself
    with pytest.raises(InputError, match="expected sound IFC: not read in 4 s"):
        read_building(file.saved(tmp_path))


def test_a_file_that_the_parser_crashes_on(tmp_path, monkeypatch):
    crash = "import os; os.abort()"
    (tmp_path / "ifcopenshell.py").write_text(crash)
    monkeypatch.syspath_prepend(str(tmp_path))
    with pytest.raises(InputError, match="ifcopenshell crashed on it"):
        read_building(buildings.ifc(tmp_path))


def test_without_ifcopenshell_the_extra_is_named(tmp_path):
    path = buildings.ifc(tmp_path)
    code = (
        "import sys; sys.modules['ifcopenshell'] = None\n"
        "from eval.cli import main\n"
        f"sys.exit(main(['scenes', '--show', {str(path)!r}]))"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert done.returncode == 2
    assert done.stderr == f'roomloop: {path}: reading IFC needs: pip install "roomloop[ifc]"\n'


# --- a real one ----------------------------------------------------------------------------------


@pytest.mark.skipif(not DUPLEX.is_file(), reason="the IFC file is not beside the repository")
def test_the_duplex_has_the_walls_that_its_floor_plan_has_and_can_be_driven_through():
    plan = read_building(DUPLEX)
    drawn = read_building(SHARED / "floorplans" / "duplex.json")
    assert [s.name for s in plan.storeys] == ["Level 1", "Level 2", "Roof"]
    for storey, other in zip(plan.storeys, drawn.storeys, strict=True):
        assert storey.walls.symmetric_difference(other.walls).area < 0.01 * other.walls.area
        assert len(storey.rooms) == len(other.rooms)
        assert len(storey.openings) == len(other.openings)
    for index, rooms in enumerate((2, 5, 1)):
        world = build_world(plan, np.random.SeedSequence(0), AS_BUILT, index)
        route = plan_route(world, index)
        # No door joins the two flats: what is not reached is the other one.
        assert len(route.rooms) == rooms
        assert {name[-4] for name in route.rooms}.isdisjoint(n[-4] for n in route.unreachable)
