import numpy as np
import pytest
import shapely
from drawings import house, write
from shapely import STRtree
from shapely.geometry import Polygon, box

from slam.core import InputError
from worlds import fields
from worlds.drafting import DEEPER, CentreLine, as_multipolygon, door_footprint, draw_bodies
from worlds.planfile import read_plan


def line(start, end, thickness):
    return CentreLine(np.array(start, dtype=float), np.array(end, dtype=float), thickness)


def test_polygons_are_found_in_collections_of_collections():
    inner = shapely.MultiPolygon([box(0, 0, 1, 1), box(2, 0, 3, 1)])
    mixed = shapely.GeometryCollection(
        [inner, shapely.LineString([(0, 0), (5, 5)]), box(4, 0, 5, 1)]
    )
    assert as_multipolygon(mixed).area == pytest.approx(3.0)


def test_a_corner_of_two_walls_is_filled():
    walls = shapely.union_all(
        draw_bodies([line((0, 0), (4, 0), 0.3), line((0, 0), (0, 3), 0.1)], [])
    )
    expected = box(-0.05, -0.15, 4, 0.15).union(box(-0.05, -0.15, 0.05, 3))
    assert walls.symmetric_difference(expected).area < 1e-12


@pytest.mark.parametrize("angle", [20.0, 75.0, 90.0, 135.0, 170.0])
def test_a_mitred_corner_is_that_of_a_buffered_line(angle):
    turn = np.radians(angle)
    tip = 3.0 * np.array([np.cos(turn), np.sin(turn)])
    walls = shapely.union_all(draw_bodies([line((3, 0), (0, 0), 0.2), line((0, 0), tip, 0.2)], []))
    drawn = shapely.LineString([(3, 0), (0, 0), tip])
    whole = drawn.buffer(0.1, cap_style="flat", join_style="mitre", mitre_limit=3.0)
    bevelled = drawn.buffer(0.1, cap_style="flat", join_style="bevel")
    assert walls.is_valid
    assert walls.difference(whole.buffer(1e-9)).area < 1e-9
    assert bevelled.difference(walls.buffer(1e-9)).area < 1e-9


@pytest.mark.parametrize("angle", np.radians([0.0, 17.0, 45.0, 90.0, 133.0]))
def test_a_door_cuts_through_a_wall_of_any_direction(angle):
    u = np.array([np.cos(angle), np.sin(angle)])
    wall = line(-3 * u, 3 * u, 0.25)
    footprint = door_footprint(0.5 * u, 0.9, STRtree([wall.body()]))
    assert footprint is not None
    assert footprint.area == pytest.approx(0.9 * (0.25 + 2 * DEEPER))
    assert len(shapely.get_parts(wall.body().difference(footprint))) == 2


@pytest.mark.parametrize(("at", "width"), [((2.8, 0.0), 0.9), ((0.0, 1.0), 0.9), ((0.0, 0.0), 7.0)])
def test_a_door_that_is_not_within_one_wall_is_none(at, width):
    wall = line((-3, 0), (3, 0), 0.25)
    assert door_footprint(np.array(at), width, STRtree([wall.body()])) is None


def test_a_door_in_a_wall_drawn_as_an_outline(tmp_path):
    tree = house()
    storey = tree["storeys"][0]
    outer, hole = [[-1, -1], [10, -1], [10, 7], [-1, 7]], [[-0.1, -0.1], [9.1, -0.1], [9.1, 6.1]]
    storey["walls"][:4] = [{"outline": outer, "holes": [[*hole, [-0.1, 6.1]]]}]
    storey["walls"].append({"from": [4.5, -0.9], "to": [4.5, 0.0], "thickness": 0.1})
    (found,) = read_plan(write(tree, tmp_path)).storeys
    assert isinstance(found.walls.geoms[0], Polygon)
    assert found.openings[0].footprint.area == pytest.approx(0.9 * (0.1 + 2 * DEEPER))


@pytest.mark.parametrize(
    ("change", "named"),
    [
        ({"head": 3.0}, "ceiling"),
        ({"height": None, "head": 2.0, "sill": 2.1}, "sill"),
        ({"head": 2.0}, "found both"),
        ({"kind": "gate"}, "kind"),
        ({"at": [0.1, 2]}, r"doors\[0\]\.at"),
    ],
)
def test_doors_that_cannot_be(change, named, tmp_path):
    tree = house()
    spec = tree["storeys"][0]["doors"][0]
    if "found both" not in named:
        del spec["height"]
    spec.update({key: value for key, value in change.items() if value is not None})
    with pytest.raises(InputError, match=named):
        read_plan(write(tree, tmp_path))


def test_json_that_is_nested_too_deeply_is_refused(tmp_path):
    with pytest.raises(InputError, match=r"house\.json"):
        read_plan(write("[" * 200_000, tmp_path))


def test_a_field_that_stands_twice_is_refused(tmp_path):
    with pytest.raises(InputError, match='"name" stands twice'):
        read_plan(write('{"name": "a", "name": "b"}', tmp_path))


def test_a_file_that_is_too_big_is_not_even_read(tmp_path, monkeypatch):
    monkeypatch.setattr(fields, "MAX_BYTES", 100)
    with pytest.raises(InputError, match="MB"):
        read_plan(write(house(), tmp_path))
