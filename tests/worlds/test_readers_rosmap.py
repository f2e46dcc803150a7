import logging
from pathlib import Path

import buildings
import numpy as np
import pytest
import shapely
from buildings import DOOR, LEFT, RIGHT, WALLS
from PIL import Image
from shapely import affinity

from sim.route import plan_route
from slam.core import InputError
from worlds.catalogue import scene_sha256
from worlds.conditions import AS_BUILT
from worlds.plan import UNLABELLED
from worlds.readers import ReaderOptions, read_building
from worlds.world import build_world

OPEN = WALLS.difference(DOOR)


def test_walls_of_a_map_are_those_drawn_and_it_says_that_there_is_no_room_truth(tmp_path):
    plan = read_building(buildings.rosmap(tmp_path, buildings.drawn_map(OPEN)))
    (storey,) = plan.storeys
    assert "No room truth" in plan.notes
    # Half a pixel to each side is what pixels can tell.
    assert storey.walls.symmetric_difference(OPEN).area < 0.02 * OPEN.length
    assert {room.kind for room in storey.rooms} == {UNLABELLED}
    assert sum(r.outline.area for r in storey.rooms) == pytest.approx(37.44, rel=0.03)


def test_a_wall_between_pixels_is_exact_where_pixels_can_be(tmp_path):
    path = buildings.rosmap(tmp_path, buildings.drawn_map(OPEN, 0.1), 0.1)
    walls = read_building(path).storeys[0].walls
    assert walls.symmetric_difference(OPEN).area < 1e-6


def test_origin_and_yaw_place_the_map(tmp_path):
    path = buildings.rosmap(
        tmp_path, buildings.drawn_map(OPEN, 0.1), 0.1, origin=[3.0, 1.0, np.pi / 6]
    )
    drawn = affinity.rotate(affinity.translate(OPEN, 4.0, 2.0), 30.0, origin=(3.0, 1.0))
    walls = read_building(path).storeys[0].walls
    assert walls.symmetric_difference(drawn).area < 1e-3


def test_a_slanting_wall_is_straight(tmp_path):
    turned = affinity.rotate(OPEN, 10.0, origin=(4.0, 2.5))
    walls = read_building(buildings.rosmap(tmp_path, buildings.drawn_map(turned))).storeys[0].walls
    assert walls.symmetric_difference(turned).area < 0.02 * turned.length
    assert len(shapely.get_coordinates(walls)) < 60


def labelled(folder, colours, **more):
    """A map with an image of labels: the two rooms in these colours."""
    pixels = np.full((*buildings.drawn_map().shape, np.size(colours[0])), 255, np.uint8)
    x, y = -0.975 + 0.05 * np.arange(pixels.shape[1]), -0.975 + 0.05 * np.arange(pixels.shape[0])
    for room, colour in zip((LEFT, RIGHT), colours, strict=True):
        inside = shapely.contains_xy(room.buffer(-0.1), *np.meshgrid(x, y[::-1]))
        pixels[inside] = colour
    Image.fromarray(pixels.squeeze()).save(folder / "rooms.png")
    return buildings.rosmap(folder, buildings.drawn_map(OPEN), labels="rooms.png", **more)


@pytest.mark.parametrize("colours", [([200, 10, 10], [10, 10, 200]), ([1], [2])])
def test_labels_are_room_truth(colours, tmp_path):
    plan = read_building(labelled(tmp_path, colours))
    rooms = sorted(plan.storeys[0].rooms, key=lambda room: room.outline.centroid.x)
    assert [room.kind for room in rooms] == ["room", "room"]
    assert "No room truth" not in plan.notes
    free = [room.outline.difference(plan.storeys[0].walls) for room in rooms]
    for shape, drawn in zip(free, (LEFT, RIGHT), strict=True):
        assert shape.symmetric_difference(drawn).area < 0.03 * drawn.area
    world = build_world(plan, np.random.SeedSequence(0), AS_BUILT)
    assert world.truth.rooms_known
    assert len(plan_route(world).rooms) == 2


def test_what_was_run_is_named_by_the_images_too(tmp_path):
    path = labelled(tmp_path, ([1], [2]))
    hashes = {scene_sha256(str(path))}
    for name in ("floor.pgm", "rooms.png"):
        with (tmp_path / name).open("ab") as file:
            file.write(b" ")
        hashes.add(scene_sha256(str(path)))
    assert len(hashes) == 3


def test_negate(tmp_path):
    path = buildings.rosmap(tmp_path, 254 - buildings.drawn_map(OPEN), negate=1)
    assert read_building(path).storeys[0].walls.area == pytest.approx(OPEN.area, rel=0.05)


# --- what is wrong -------------------------------------------------------------------------------


def yaml_map(folder, text):
    buildings.rosmap(folder, buildings.drawn_map())
    path = folder / "floor.yaml"
    path.write_text(text)
    return path


SOUND = "image: floor.pgm\nresolution: 0.05\norigin: [0, 0, 0]\nnegate: 0\n"
BOMB = "image: &a [x, x]\n" + "".join(f"k{k}: &b{k} [*a, *a]\n" for k in range(9))


@pytest.mark.parametrize(
    ("text", "named"),
    [
        (SOUND.replace("resolution: 0.05\n", ""), '"resolution" is missing'),
        (SOUND.replace("0.05", "-1"), "resolution"),
        (SOUND.replace("0.05", ".nan"), "resolution: expected a finite number"),
        (SOUND.replace("0.05", ".inf"), "resolution: expected a finite number"),
        (SOUND.replace("0.05", "1.0e-9"), "resolution: the building would measure"),
        (SOUND.replace("0.05", "900"), "resolution: the building would measure"),
        (SOUND.replace("[0, 0, 0]", "[0, 0]"), "origin"),
        (SOUND.replace("[0, 0, 0]", "[0, 0, x]"), r"origin\[2\]"),
        (SOUND.replace("negate: 0", "negate: maybe"), "negate"),
        (SOUND + "occupied_thresh: 65\n", "occupied_thresh"),
        (SOUND + "free_thresh: 0.9\n", "free_thresh"),
        (SOUND.replace("floor.pgm", "lost.pgm"), "lost.pgm"),
        (SOUND.replace("floor.pgm", "/etc/hostname"), "image: expected a file in the same folder"),
        (SOUND.replace("floor.pgm", "../floor.pgm"), "image: expected a file in the same folder"),
        (SOUND + "labels: ../rooms.png\n", "labels: expected a file in the same folder"),
        (SOUND.replace("floor.pgm", "floor.yaml"), "expected an image"),
        (SOUND.replace("floor.pgm", "[1]"), "image: expected a text"),
        (SOUND + "x: !!python/object/apply:os.system ['touch owned']\n", "expected the yaml"),
        (BOMB, "aliases"),
        ("image: [\n" + "[" * 5000, "expected the yaml"),
        ("image: x: y", "expected the yaml"),
        ("- image: floor.pgm", "image, resolution and origin"),
        ("", "empty"),
    ],
)
def test_what_is_wrong_in_the_yaml_is_named(text, named, tmp_path):
    path = yaml_map(tmp_path, text)
    with pytest.raises(InputError, match=named) as refused:
        read_building(path)
    assert str(tmp_path) in str(refused.value)
    assert "\n" not in str(refused.value)
    assert not Path("owned").exists()


def test_a_link_that_leads_out_of_the_folder_is_refused(tmp_path):
    inner = tmp_path / "inner"
    inner.mkdir()
    (tmp_path / "secret.pgm").write_bytes(b"P5 1 1 255 x")
    path = yaml_map(inner, SOUND.replace("floor.pgm", "link.pgm"))
    (inner / "link.pgm").symlink_to(tmp_path / "secret.pgm")
    with pytest.raises(InputError, match="same folder"):
        read_building(path)


def test_an_image_bomb_is_refused_before_its_pixels_are_read(tmp_path):
    path = yaml_map(tmp_path, SOUND)
    for side in (6000, 60000):
        (tmp_path / "floor.pgm").write_bytes(b"P5 %d %d 255\n" % (side, side) + b"\0" * 100)
        with pytest.raises(InputError, match="pixels"):
            read_building(path)


@pytest.mark.parametrize("part", [0.0, 0.001, 0.5, 0.99])
def test_an_image_that_is_cut_off_is_refused(part, tmp_path):
    path = buildings.rosmap(tmp_path, buildings.drawn_map())
    image = tmp_path / "floor.pgm"
    image.write_bytes(image.read_bytes()[: int(part * image.stat().st_size)])
    with pytest.raises(InputError, match=r"floor\.pgm: expected an image"):
        read_building(path)


def test_other_kinds_of_image_are_refused(tmp_path):
    path = yaml_map(tmp_path, SOUND)
    Image.fromarray(buildings.drawn_map()).save(tmp_path / "floor.pgm", format="TIFF")
    with pytest.raises(InputError, match=r"floor\.pgm: expected an image"):
        read_building(path)


@pytest.mark.parametrize(("value", "named"), [(254, "occupied pixels"), (0, "no free space")])
def test_a_map_of_one_colour_is_refused(value, named, tmp_path):
    image = np.full((100, 100), value, np.uint8)
    with pytest.raises(InputError, match=named):
        read_building(buildings.rosmap(tmp_path, image))


def test_noise_is_refused(tmp_path):
    noise = np.random.default_rng(0).choice(np.array([0, 254], np.uint8), (900, 900))
    with pytest.raises(InputError, match="too ragged"):
        read_building(buildings.rosmap(tmp_path, noise))


def test_labels_of_another_size_are_refused(tmp_path):
    path = labelled(tmp_path, ([1], [2]))
    Image.fromarray(np.ones((9, 7), np.uint8)).save(tmp_path / "rooms.png")
    with pytest.raises(InputError, match="the size of the map, 200 x 140, found 7 x 9"):
        read_building(path)


def test_a_photograph_for_labels_is_refused(tmp_path):
    path = labelled(tmp_path, ([1], [2]))
    noise = np.random.default_rng(0).integers(0, 256, (140, 200, 3), dtype=np.uint8)
    Image.fromarray(noise).save(tmp_path / "rooms.png")
    with pytest.raises(InputError, match="a colour for each room"):
        read_building(path)


def test_a_map_takes_no_unit(tmp_path):
    with pytest.raises(InputError, match="--unit: ROS map files do not take it"):
        read_building(buildings.rosmap(tmp_path, buildings.drawn_map()), ReaderOptions(unit="m"))


def test_nothing_is_warned_of_in_a_sound_map(tmp_path, caplog):
    with caplog.at_level(logging.WARNING):
        read_building(labelled(tmp_path, ([1], [2])))
    assert not caplog.records
