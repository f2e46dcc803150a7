"""The truth's file: what is written is read back, and whatever else is refused."""

import json

import numpy as np
import pytest

from slam.core import InputError
from worlds.catalogue import load_scene
from worlds.conditions import conditions_named
from worlds.truth import LABELS
from worlds.truthfile import TruthFile, adjacency, read_truth, write_truth
from worlds.world import build_world


@pytest.fixture(scope="module")
def truth():
    seed = np.random.SeedSequence(1)
    return build_world(load_scene("SE1"), seed, conditions_named("unfinished+furniture")).truth


@pytest.fixture
def path(truth, tmp_path):
    path = tmp_path / "truth.json"
    write_truth(TruthFile(truth, "SE1", 1, "unfinished+furniture"), path)
    return path


def test_what_is_written_is_read_back_exactly(truth, path):
    file = read_truth(path)
    assert (file.scene, file.seed, file.conditions) == ("SE1", 1, "unfinished+furniture")
    assert file.truth.walls == truth.walls
    assert file.truth.floors == truth.floors
    for a, b in zip(file.truth.faces, truth.faces, strict=True):
        assert (a.id, a.room, a.d, a.z_range, a.surface) == (
            b.id,
            b.room,
            b.d,
            b.z_range,
            b.surface,
        )
        for name in ("normal", "segment", "parts"):
            assert np.array_equal(getattr(a, name), getattr(b, name))
    for a, b in zip(file.truth.rooms, truth.rooms, strict=True):
        assert a.polygon.equals_exact(b.polygon, 0.0)
        assert (a.id, a.name, a.kind, a.faces) == (b.id, b.name, b.kind, b.faces)
    for a, b in zip(file.truth.doors, truth.doors, strict=True):
        assert np.array_equal(a.centre, b.centre)
        assert (a.rooms, a.width, a.height) == (b.rooms, b.width, b.height)
    assert json.loads(path.read_text())["labels"] == LABELS


def test_rooms_are_adjacent_where_a_door_joins_them(truth, path):
    pairs = adjacency(truth)
    assert pairs == [tuple(pair) for pair in json.loads(path.read_text())["adjacency"]]
    assert pairs == sorted(set(pairs))
    assert {frozenset(pair) for pair in pairs} == {
        frozenset(door.rooms) for door in truth.doors if None not in door.rooms
    }


def spoilt(path, change):
    tree = json.loads(path.read_text())
    change(tree)
    path.write_text(json.dumps(tree))
    return path


@pytest.mark.parametrize(
    ("change", "match"),
    [
        (lambda t: t.update(format="roomloop-truth-9"), "format: expected one of roomloop-truth-1"),
        (lambda t: t.pop("faces"), '"faces" is missing'),
        (lambda t: t["faces"][2].update(id=7), r"faces\[2\].id: expected 2"),
        (lambda t: t["faces"][2].update(room=99), r"faces\[2\]: names a room"),
        (lambda t: t["faces"][2].update(normal=[1.0, 0.0]), r"normal: expected 3 numbers"),
        (lambda t: t["walls"][0].update(faces=[1]), r"walls\[0\].faces: expected two faces"),
        (lambda t: t["walls"][0].update(faces=[1, 400]), r"walls\[0\]: names"),
        (lambda t: t["doors"][0].update(rooms=[0, "x"]), r"rooms\[1\]: expected a whole number"),
        (lambda t: t["rooms"][0].update(outline=[[0, 0], [1, 0]]), "at least 3 points"),
        (lambda t: t.update(seed=0.5), "seed: expected a whole number"),
    ],
)
def test_bad_files_are_refused(path, change, match):
    with pytest.raises(InputError, match=match):
        read_truth(spoilt(path, change))


def test_a_folder_that_is_not_there_is_named(truth, tmp_path):
    with pytest.raises(InputError, match="cannot be written"):
        write_truth(TruthFile(truth, "SE1", 1, "ideal"), tmp_path / "absent" / "truth.json")
