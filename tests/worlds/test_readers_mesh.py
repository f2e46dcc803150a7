import contextlib
import logging
from pathlib import Path

import buildings
import numpy as np
import pytest
import shapely
import trimesh
from buildings import DOOR, HEIGHT, LEFT, RIGHT, WALLS, WINDOW

from slam.core import InputError
from worlds.conditions import IDEAL
from worlds.plan import UNLABELLED
from worlds.readers import ReaderOptions, read_building
from worlds.readers.meshfile import Mesh
from worlds.readers.slices import lines_at, solid_in, winding_numbers
from worlds.world import build_world

SHARED = Path(__file__).parents[2].parent / "shared" / "data"
WILLOW = SHARED / "meshes" / "willowgarage" / "collision.dae"
METRES = ReaderOptions(unit="m", up="z")


def saved(mesh, folder, suffix):
    path = folder / f"building.{suffix}"
    mesh.export(path)
    return path


def assert_is_the_building(plan, tolerance=0.01):
    """Walls, openings and heights as they were drawn, to 1 % of the wall's area."""
    (storey,) = plan.storeys
    assert storey.z_floor == pytest.approx(0.0, abs=1e-3)
    assert storey.z_ceiling == pytest.approx(HEIGHT, abs=1e-3)
    wrong = storey.walls.symmetric_difference(WALLS).area
    assert wrong < tolerance * WALLS.area
    found = sorted((o.z_min, o.z_max, o.footprint) for o in storey.openings)
    assert [(a, b) for a, b, _ in found] == [
        (0.0, pytest.approx(2.1, abs=0.01)),
        (pytest.approx(0.9, abs=0.01), pytest.approx(2.0, abs=0.01)),
    ]
    for (_, _, footprint), drawn in zip(found, (DOOR, WINDOW), strict=True):
        assert footprint.symmetric_difference(drawn).area < 0.03 * drawn.area
    rooms = sorted(storey.rooms, key=lambda room: room.outline.centroid.x)
    assert [room.kind for room in rooms] == [UNLABELLED, UNLABELLED]
    for room, drawn in zip(rooms, (LEFT, RIGHT), strict=True):
        assert room.outline.symmetric_difference(drawn).area < 0.01 * drawn.area


@pytest.mark.parametrize("suffix", ["obj", "stl", "ply"])
def test_walls_doors_and_windows_of_a_mesh_are_those_drawn(suffix, tmp_path):
    assert_is_the_building(read_building(saved(buildings.building(), tmp_path, suffix), METRES))


def test_it_says_that_there_is_no_room_truth(tmp_path):
    plan = read_building(saved(buildings.building(), tmp_path, "stl"), METRES)
    assert "no room truth" in plan.notes


def test_what_was_read_can_be_built(tmp_path):
    plan = read_building(saved(buildings.building(), tmp_path, "ply"), METRES)
    world = build_world(plan, np.random.SeedSequence(0), IDEAL)
    assert [tuple(sorted(d.rooms)) for d in world.truth.doors] == [(0, 1)]


def test_glb_is_y_up_and_in_metres_by_its_standard(tmp_path, caplog):
    path = saved(buildings.y_up(buildings.building()), tmp_path, "glb")
    assert_is_the_building(read_building(path))
    assert not caplog.records


def test_dae_is_placed_by_its_nodes_and_scaled_by_its_unit(tmp_path, caplog):
    inches = buildings.building()
    inches.apply_scale(1.0 / 0.0254)
    unit, up = '<unit meter="0.0254" name="inch"/>', "<up_axis>Z_UP</up_axis>"
    assert_is_the_building(read_building(buildings.dae(inches, tmp_path, unit, up)))
    turned = buildings.y_up(buildings.building())
    metre = '<unit meter="1"/>'
    path = buildings.dae(turned, tmp_path, metre, "<up_axis>Y_UP</up_axis>")
    assert_is_the_building(read_building(path))
    assert not caplog.records


def test_options_override_unit_and_axis(tmp_path):
    feet = buildings.y_up(buildings.building())
    feet.apply_scale(1.0 / 0.3048)
    path = saved(feet, tmp_path, "obj")
    assert_is_the_building(read_building(path, ReaderOptions(unit="ft", up="y")))


@pytest.mark.parametrize("kind", ["both sides", "inside out", "at random"])
def test_no_orientation_is_needed(kind, tmp_path):
    mesh = buildings.building()
    flipped = mesh.faces[:, ::-1]
    if kind == "both sides":
        mesh.faces = np.concatenate([mesh.faces, flipped])
    elif kind == "inside out":
        mesh.faces = flipped
    else:
        swap = np.random.default_rng(0).random(len(mesh.faces)) < 0.5
        mesh.faces = np.where(swap[:, None], flipped, mesh.faces)
    assert_is_the_building(read_building(saved(mesh, tmp_path, "ply"), METRES))


def test_single_sheets_become_thin_walls(tmp_path):
    corners = np.array([[0, 0], [6, 0], [6, 4], [0, 4.0]])
    sheets = []
    for a, b in zip(corners, np.roll(corners, -1, axis=0), strict=True):
        quad = [[*a, 0], [*b, 0], [*b, 2.5], [*a, 2.5]]
        sheets.append(trimesh.Trimesh(quad, [[0, 1, 2], [0, 2, 3]], process=False))
    path = saved(trimesh.util.concatenate(sheets), tmp_path, "stl")
    storey = read_building(path, METRES).storeys[0]
    assert storey.walls.area == pytest.approx(20.0 * 0.04, rel=0.02)
    assert storey.rooms[0].outline.area == pytest.approx(5.96 * 3.96, rel=0.01)


def test_two_storeys_are_told_apart(tmp_path):
    both = trimesh.util.concatenate([buildings.building(), buildings.building(HEIGHT + 0.2)])
    plan = read_building(saved(both, tmp_path, "stl"), METRES)
    assert [round(s.z_floor, 3) for s in plan.storeys] == [0.0, 2.8]
    assert [round(s.z_ceiling, 3) for s in plan.storeys] == [2.6, 5.4]
    for storey in plan.storeys:
        assert storey.walls.symmetric_difference(WALLS).area < 0.01 * WALLS.area
        assert len(storey.openings) == 2


def test_a_building_far_from_the_origin_is_moved_there(tmp_path):
    mesh = buildings.building()
    mesh.apply_translation([512_300.0, 5_403_200.0, 0.0])
    # An OBJ carries digits enough; the formats in single precision do not.
    plan = read_building(saved(mesh, tmp_path, "obj"), METRES)
    assert_is_the_building(plan)
    assert "Moved by (-512300, -5.4032e+06, 0) m" in plan.notes


def test_slices_tell_solid_from_free():
    boxes = buildings.pieces()
    mesh = trimesh.util.concatenate(boxes[:10])
    lines = lines_at(Mesh(np.asarray(mesh.vertices), np.asarray(mesh.faces)), 1.0)
    expected = WALLS.difference(shapely.union_all([DOOR, WINDOW]))
    assert solid_in(lines).symmetric_difference(expected).area < 1e-3
    inside = np.array([[0.0, 3.0], [2.0, 2.0], [20.0, 2.0]])
    np.testing.assert_allclose(winding_numbers(inside, lines.ends), [1.0, 0.0, 0.0], atol=1e-9)


# --- units ---------------------------------------------------------------------------------------


def test_an_undeclared_unit_is_taken_as_metres_with_a_warning(tmp_path, caplog):
    with caplog.at_level(logging.WARNING):
        read_building(saved(buildings.building(), tmp_path, "obj"), ReaderOptions(up="z"))
    assert "8.2 x 5.2 x 3.0 m" in caplog.text


def test_undeclared_inches_are_warned_of_with_the_size_that_metres_imply(tmp_path, caplog):
    mesh = buildings.building()
    mesh.apply_scale(1.0 / 0.0254)
    with caplog.at_level(logging.WARNING), contextlib.suppress(InputError):
        read_building(saved(mesh, tmp_path, "stl"), ReaderOptions(up="z"))
    assert "322.8 x 204.7 x 118.1 m" in caplog.text
    assert "in (8.2 x 5.2 x 3.0 m)" in caplog.text


def test_a_size_that_no_building_has_is_refused_with_units_that_would_do(tmp_path):
    mesh = buildings.building()
    mesh.apply_scale(1000.0)
    with pytest.raises(InputError, match=r"unit.*mm \(8.2 x 5.2 x 3.0 m\)"):
        read_building(saved(mesh, tmp_path, "stl"), ReaderOptions(up="z"))


@pytest.mark.parametrize("unit", ["furlong", "-1", "nan", "0"])
def test_an_unknown_unit_is_refused(unit, tmp_path):
    with pytest.raises(InputError, match="unit"):
        read_building(saved(buildings.building(), tmp_path, "stl"), ReaderOptions(unit=unit))


def test_a_mesh_on_its_side_is_doubted(tmp_path, caplog):
    path = saved(buildings.y_up(buildings.building()), tmp_path, "obj")
    with caplog.at_level(logging.WARNING), contextlib.suppress(InputError):
        read_building(path, ReaderOptions(unit="m"))
    assert "no up axis declared" in caplog.text


# --- what is wrong -------------------------------------------------------------------------------

BOMB = '<!DOCTYPE x [<!ENTITY a "aaaa"><!ENTITY b "&a;&a;&a;&a;">]>'
EXTERNAL = '<!DOCTYPE x [<!ENTITY f SYSTEM "file:///etc/hostname">]>'


@pytest.mark.parametrize("head", [BOMB, EXTERNAL, "<!doctype x>", '<!DOCTYPE x SYSTEM "y.dtd">'])
def test_document_types_and_entities_are_refused(head, tmp_path):
    with pytest.raises(InputError, match=r"building\.dae: expected COLLADA"):
        read_building(buildings.dae(buildings.building(), tmp_path, head=head))


def test_an_entity_hidden_by_an_encoding_is_refused_too(tmp_path):
    path = buildings.dae(buildings.building(), tmp_path, head=BOMB)
    text = path.read_text().replace("utf-8", "utf-16")
    path.write_bytes(text.encode("utf-16"))
    with pytest.raises(InputError, match=r"building\.dae"):
        read_building(path)
    start, rest = text.replace("utf-16", "cp037").split("?>", 1)
    path.write_bytes((start + "?>").encode() + rest.encode("cp037"))
    with pytest.raises(InputError, match=r"building\.dae"):
        read_building(path)


def edited(old, new):
    return lambda text: text.replace(old, new, 1)


@pytest.mark.parametrize(
    ("spoil", "named"),
    [
        (edited("</COLLADA>", ""), "expected COLLADA"),
        (edited('url="#g"', 'url="#nowhere"'), "nowhere"),
        (edited('url="#s"', 'url="#nowhere"'), "nowhere"),
        (edited("1 2 0<", "1 2<"), "translate"),
        (edited("1 2 0<", "1 two 0<"), "translate"),
        (edited("1 2 0<", "nan 2 0<"), "finite"),
        (edited("1 2 0<", "inf 2 0<"), "finite"),
        (edited('offset="0"', 'offset="zero"'), "offset"),
        (edited('stride="3"', 'stride="2"'), "three coordinates"),
        (edited("<p>", "<p>1000000 "), "triangles"),
        (edited("<p>", "<p>1000000 0 0 "), "indices below"),
        (edited("<p>", "<p>-1 0 0 "), "whole numbers"),
        (edited("<asset>", '<asset><unit meter="0"/>'), "asset/unit"),
        (edited("<asset>", '<asset><unit meter="inch"/>'), "asset/unit"),
        (edited("<asset>", "<asset><up_axis>X_UP</up_axis>"), "up_axis"),
        (edited("<asset>", '<asset><unit meter="0.0254"/>'), "asset/unit"),
        (edited("<scene>", "<scenery>"), "expected COLLADA"),
        (edited('semantic="VERTEX"', 'semantic="NORMAL"'), "VERTEX"),
    ],
)
def test_a_broken_dae_is_refused(spoil, named, tmp_path):
    path = buildings.dae(buildings.building(), tmp_path)
    path.write_text(spoil(path.read_text()))
    with pytest.raises(InputError, match=named) as refused:
        read_building(path)
    assert "\n" not in str(refused.value)
    assert str(path) in str(refused.value)


def test_nodes_that_contain_themselves_are_refused(tmp_path):
    path = buildings.dae(buildings.building(), tmp_path)
    nested = path.read_text().replace("<node>", '<node id="n"><instance_node url="#n"/>', 1)
    path.write_text(nested)
    with pytest.raises(InputError, match="without end"):
        read_building(path)


@pytest.mark.parametrize("suffix", ["obj", "stl", "ply", "glb", "dae"])
@pytest.mark.parametrize(
    "content",
    [
        b"",
        b"\x00" * 300,
        b"hello, this is not a mesh\n" * 20,
        b"%PDF-1.7\n",
        b'{"a": 1}',
        b"\xff" * 99,
    ],
)
def test_foreign_content_is_refused(suffix, content, tmp_path):
    path = tmp_path / f"building.{suffix}"
    path.write_bytes(content)
    with pytest.raises(InputError) as refused:
        read_building(path)
    assert "\n" not in str(refused.value)
    assert str(path) in str(refused.value)


@pytest.mark.parametrize("suffix", ["stl", "ply", "glb", "dae"])
def test_a_file_that_is_cut_off_is_refused(suffix, tmp_path):
    if suffix == "dae":
        path = buildings.dae(buildings.building(), tmp_path)
    else:
        path = saved(buildings.building(), tmp_path, suffix)
    path.write_bytes(path.read_bytes()[: path.stat().st_size * 2 // 3])
    with pytest.raises(InputError, match=str(path)):
        read_building(path, METRES)


@pytest.mark.parametrize("value", ["nan", "inf", "1e400"])
def test_coordinates_that_are_not_finite_are_refused(value, tmp_path):
    path = saved(buildings.building(), tmp_path, "obj")
    lines = path.read_text().splitlines()
    first = next(i for i, line in enumerate(lines) if line.startswith("v "))
    lines[first] = f"v {value} 0 0"
    path.write_text("\n".join(lines))
    with pytest.raises(InputError, match="finite"):
        read_building(path, METRES)


def test_points_without_triangles_are_refused(tmp_path):
    path = tmp_path / "cloud.ply"
    trimesh.PointCloud(np.random.default_rng(0).random((50, 3))).export(path)
    with pytest.raises(InputError, match="triangles"):
        read_building(path, METRES)


def test_more_triangles_than_a_building_has_are_refused(tmp_path, monkeypatch):
    monkeypatch.setattr("worlds.readers.meshfile.MAX_TRIANGLES", 100)
    with pytest.raises(InputError, match="at most 100"):
        read_building(saved(buildings.building(), tmp_path, "stl"), METRES)
    with pytest.raises(InputError, match="at most 100"):
        read_building(buildings.dae(buildings.building(), tmp_path))


def test_a_heap_of_triangles_is_refused_before_it_is_united(tmp_path):
    rng = np.random.default_rng(0)
    corners = rng.uniform(0.0, 1.0, (60_000, 3)) * [30.0, 30.0, 3.0]
    heap = trimesh.Trimesh(corners, np.arange(60_000).reshape(-1, 3), process=False)
    with pytest.raises(InputError, match=r"slice at .* cross without end"):
        read_building(saved(heap, tmp_path, "stl"), METRES)


def test_a_mesh_without_walls_is_refused(tmp_path):
    bounds = [[[0, 0, z], [10, 10, z + 0.2]] for z in (-0.2, 2.5)]
    bounds += [[[x, y, 0], [x + 0.3, y + 0.3, 2.5]] for x in (0, 9.7) for y in (0, 9.7)]
    pavilion = trimesh.util.concatenate([trimesh.creation.box(bounds=b) for b in bounds])
    with pytest.raises(InputError, match="walls"):
        read_building(saved(pavilion, tmp_path, "stl"), METRES)


def test_other_encodings_in_comments_do_not_matter(tmp_path):
    path = saved(buildings.building(), tmp_path, "obj")
    path.write_bytes("# Gebäude\n".encode("latin-1") + path.read_bytes())
    assert_is_the_building(read_building(path, METRES))


# --- a real one ----------------------------------------------------------------------------------


@pytest.mark.skipif(not WILLOW.is_file(), reason="the meshes are not beside the repository")
def test_willow_garage_has_its_size(caplog):
    plan = read_building(WILLOW)
    (storey,) = plan.storeys
    x0, y0, x1, y1 = storey.walls.bounds
    assert (round(x1 - x0, 1), round(y1 - y0, 1)) == (58.6, 45.7)
    assert storey.z_ceiling - storey.z_floor == pytest.approx(2.84, abs=0.01)
    assert storey.rooms[0].outline.area > 1900.0
    assert {room.kind for room in storey.rooms} == {UNLABELLED}
    assert not caplog.records
