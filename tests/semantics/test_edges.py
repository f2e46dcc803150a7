from dataclasses import replace

import numpy as np
import pytest
from houses import around, plane

from semantics.detector import CONSERVATIVE, WEIGHTS
from semantics.edges import EdgeModel, LocalEdges
from semantics.network import Checkpoint, EdgeClassifier, NetworkConfig, save
from semantics.preprocess import Preprocessor
from slam.core import InputError


def rooms(side):
    """side x side rooms of 5 x 4 m."""
    sides = [
        wall
        for a in range(side)
        for b in range(side)
        for wall in around(a * 5.2, b * 4.2, a * 5.2 + 5, b * 4.2 + 4)
    ]
    return [plane(name, wall, spacing=0.2) for name, wall in enumerate(sides)]


def moved(planes, name, shift):
    there = planes[name]
    points = there.points + shift
    d = there.d - float(there.normal @ shift)
    changed = replace(there, points=points, d=d, revision=there.revision + 1)
    return [*planes[:name], changed, *planes[name + 1 :]]


def told(edges):
    return {tuple(pair): p for pair, p in zip(edges.pairs.tolist(), edges.room, strict=True)}


@pytest.fixture(scope="module")
def model():
    return EdgeModel(CONSERVATIVE.weights)


def test_the_first_look_is_at_everything(model):
    pieces = Preprocessor()(rooms(3))
    assert told(LocalEdges(model)(pieces)) == told(model(pieces))


def test_nothing_changed_nothing_asked(model):
    local, pieces = LocalEdges(model), Preprocessor()(rooms(3))
    first = told(local(pieces))
    local._model = None
    assert told(local(pieces)) == first


def test_a_building_far_away_is_not_part_of_this_one(model):
    """Where there are few pieces, the closest ones are there; what is far is not answered for."""
    here = rooms(1)
    far = 45.0
    there = [
        plane(len(here) + name, wall + np.array([far, 0.0]), spacing=0.2)
        for name, wall in enumerate(np.array(around(0.0, 0.0, 5.0, 4.0)))
    ]
    pieces = Preprocessor()([*here, *there])
    pairs = model(pieces).pairs
    across = (pieces.plane_id[pairs] < len(here)).sum(axis=1) == 1
    assert len(pairs) == 12
    assert not across.any()


def test_around_a_change_the_answer_is_nearly_that_of_a_look_at_everything(model):
    planes = rooms(8)
    local, preprocess = LocalEdges(model), Preprocessor()
    local(preprocess(planes))
    planes = moved(planes, 130, np.array([0.1, 0.0, 0.0]))
    planes.pop(7)
    pieces = preprocess(planes)
    found, whole = told(local(pieces)), told(model(pieces))
    assert found.keys() == whole.keys()
    off = np.array([abs(found[pair] - whole[pair]) for pair in whole])
    assert (off > 0.02).mean() < 0.01
    assert ((off == 0.0).mean()) > 0.3


def test_a_change_is_asked_about_where_it_is(model):
    planes = rooms(8)
    local, preprocess = LocalEdges(model), Preprocessor()
    local(preprocess(planes))
    asked = []
    local._model = lambda pieces: asked.append(len(pieces)) or model(pieces)
    local(preprocess(moved(planes, 0, np.array([0.0, 0.1, 0.0]))))
    assert len(asked) == 1
    assert asked[0] < 0.6 * len(planes)
    local(preprocess(moved(planes, 0, np.array([0.0, 0.11, 0.0]))))
    assert len(asked) == 1


def test_everything_may_go_and_come_again(model):
    local, preprocess = LocalEdges(model), Preprocessor()
    assert len(local(preprocess([])).pairs) == 0
    first = told(local(preprocess(rooms(2))))
    assert len(local(preprocess([])).pairs) == 0
    assert told(local(preprocess(rooms(2)))) == first


def test_networks_that_do_not_go_together_are_refused(tmp_path):
    def network(name, relations, features, sizes):
        config = NetworkConfig(relations, features, *sizes)
        save(tmp_path / name, EdgeClassifier(config), Checkpoint(config))
        return tmp_path / name

    room = network("room.npz", ("same_room",), "invariant", (2, 16))
    wall = network("wall.npz", ("same_wall",), "paper", (3, 3))
    with pytest.raises(InputError, match="same_wall"):
        EdgeModel([room])
    with pytest.raises(InputError, match="features"):
        EdgeModel([room, wall])
    with pytest.raises(InputError, match=r"no such weights"):
        EdgeModel([WEIGHTS / "none.npz"])
