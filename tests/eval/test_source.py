"""What a run is asked for reaches the world and the route; where its scans come from."""

import itertools
import json
import logging
from pathlib import Path

import numpy as np
import pytest

from eval.config import RunConfig
from eval.source import AHEAD_FROM, make_drive, make_source, make_world
from sim.ahead import Ahead
from sim.drive import Drive
from slam.core import InputError


def plan_file(folder: Path, **fields: object) -> str:
    """Two rooms with a door, a third that has none, and whatever else."""
    rooms = [(0, 4), (4, 8), (8, 12)]
    storey = {
        "z_ceiling": 2.5,
        "rooms": [
            {"id": f"r{k}", "name": f"room {k}", "outline": [[a, 0], [b, 0], [b, 4], [a, 4]]}
            for k, (a, b) in enumerate(rooms)
        ],
        "walls": [
            {"from": a, "to": b, "thickness": 0.2}
            for a, b in (
                ([0, 0], [12, 0]),
                ([12, 0], [12, 4]),
                ([12, 4], [0, 4]),
                ([0, 4], [0, 0]),
                ([4, 0], [4, 4]),
                ([8, 0], [8, 4]),
            )
        ],
        "doors": [{"at": [4, 2], "width": 0.9}],
    }
    path = folder / "plan.json"
    path.write_text(json.dumps({"format": "roomloop-plan-1", "storeys": [storey], **fields}))
    return str(path)


def test_a_scene_is_built_under_its_own_conditions_unless_others_are_asked_for(
    tmp_path: Path,
) -> None:
    scene = plan_file(tmp_path, conditions="ideal")
    own, ideal, built = (
        make_world(RunConfig(scene, conditions=name)).mesh.vertices
        for name in (None, "ideal", "as-built")
    )
    assert np.array_equal(own, ideal)
    assert not np.array_equal(own, built)


def test_rooms_that_cannot_be_reached_are_told(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    config = RunConfig(plan_file(tmp_path))
    with caplog.at_level(logging.WARNING):
        make_source(config, make_world(config))
    assert "no way leads to room 2" in caplog.text


def test_a_route_of_the_scene_is_taken_on_its_own_storey_only(tmp_path: Path) -> None:
    scene = plan_file(tmp_path, routes=[{"name": "one", "rooms": ["r1"]}])
    short, whole = (
        make_source(config, make_world(config)).duration
        for config in (RunConfig(scene, route="one"), RunConfig(scene))
    )
    assert short < whole
    with pytest.raises(InputError, match="storey 1: route 'one' is on 0"):
        make_world(RunConfig(scene, route="one", storey=1))


def test_a_run_may_return_to_its_start(tmp_path: Path) -> None:
    scene = plan_file(tmp_path)
    there, back = (
        make_source(config, make_world(config)).duration
        for config in (RunConfig(scene), RunConfig(scene, closed=True))
    )
    assert back > there + 4.0


def test_a_short_drive_is_simulated_where_it_is_used():
    config = RunConfig("SE1", duration=10.0)
    assert isinstance(make_source(config, make_world(config)), Drive)


def test_a_long_drive_is_simulated_ahead_and_is_the_same(monkeypatch: pytest.MonkeyPatch):
    monkeypatch.delenv("OMP_NUM_THREADS", raising=False)
    config = RunConfig("SE1", seed=3, duration=AHEAD_FROM + 1.0)
    world = make_world(config)
    here, ahead = make_drive(config, world), make_source(config, world)
    assert isinstance(ahead, Ahead)
    assert ahead.duration == here.duration == AHEAD_FROM + 1.0
    there = iter(ahead)
    for (a, at), (b, bt) in itertools.islice(zip(here, there, strict=True), 4):
        assert np.array_equal(a.points, b.points)
        assert np.array_equal(at.T_world_base, bt.T_world_base)
        assert np.array_equal(at.face, bt.face)
    there.close()
