"""RunConfig refuses what no run could use; config.json and the folder keep their promises."""

from __future__ import annotations

import json
import os
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from eval.config import FACTORS, LAYERS, LOOPS, RunConfig
from eval.detectors import DETECTORS, ODOMETRIES
from eval.folder import RUN_FILES, check_folder, claim_folder, config_text, read_config
from slam.core import InputError

positive = st.floats(min_value=0.1, max_value=1e5)
texts = st.text(st.characters(categories=["L", "N"], include_characters="/.-_ +"), min_size=1)
configs = st.builds(
    RunConfig,
    scene=texts,
    seed=st.integers(0, 2**64),
    out=st.none() | texts.map(Path),
    duration=st.none() | positive,
    speed=st.none() | positive,
    storey=st.none() | st.integers(0, 50),
    start=st.none() | texts,
    detector=st.sampled_from([*DETECTORS, "package.module:Class"]),
    odometry=st.sampled_from([*ODOMETRIES, "mine:Odometry"]),
    layers=st.sampled_from(LAYERS),
    factors=st.sampled_from(FACTORS),
    loops=st.sampled_from(LOOPS),
    save=st.booleans(),
)


@pytest.mark.parametrize(
    ("field", "value", "expected"),
    [
        ("duration", 0, "duration: expected seconds above 0"),
        ("duration", -3.0, "duration: expected seconds above 0"),
        ("duration", 0.01, "duration: expected one sweep at least, 0.1 seconds, got 0.01"),
        ("speed", 1e300, "speed: expected m/s above 0 and below 1e.06"),
        ("scene", "x" * 1001, "scene: expected a text of up to 1000 characters"),
        ("start", "a\0b", "start: expected a text of up to 1000 characters"),
        ("duration", float("nan"), "duration: expected seconds above 0"),
        ("duration", float("inf"), "duration: expected seconds above 0"),
        ("duration", "60", "duration: expected a number"),
        ("speed", 0.0, "speed: expected m/s above 0"),
        ("seed", -1, "seed: expected 0 or more"),
        ("seed", 1.5, "seed: expected a whole number"),
        ("seed", True, "seed: expected a whole number"),
        ("storey", -1, "storey: expected 0 or more"),
        ("start", "", "start: expected a text"),
        ("out", 3, "out: expected a path"),
        ("save", 1, "save: expected true or false"),
        ("scene", None, "scene: expected a text"),
        (
            "detector",
            "gnn-greedi",
            "detector: unknown name 'gnn-greedi'.*did you mean 'gnn-greedy'",
        ),
        ("detector", "not a module:Class", "detector: .*expected package.module:Class"),
        ("odometry", "Kiss", "odometry: unknown name 'Kiss'.*did you mean 'kiss'"),
        ("layers", "walls", "layers: unknown name 'walls', expected one of: planes, rooms"),
        ("factors", "papers", "factors: unknown name"),
        ("loops", "yes", "loops: unknown name 'yes', expected one of: on, off"),
    ],
)
def test_a_value_no_run_could_use_is_refused_by_name(
    field: str, value: object, expected: str
) -> None:
    with pytest.raises(InputError, match=expected):
        RunConfig(**{"scene": "SE1", field: value})


def test_the_default_folder_names_scene_detector_and_seed() -> None:
    assert RunConfig("SE1").folder == Path("runs/SE1-gnn-s0")
    assert RunConfig("plans/my house.json", seed=3).folder == Path("runs/my-house-gnn-s3")
    assert RunConfig("SE1", detector="my.rooms:Finder").folder == Path(
        "runs/SE1-my.rooms-Finder-s0"
    )
    assert RunConfig("SE1", out=Path("here")).folder == Path("here")


@given(configs)
def test_the_default_folder_is_one_level_below_runs(config: RunConfig) -> None:
    folder = RunConfig(config.scene, detector=config.detector).folder
    assert len(folder.parts) == 2
    assert ".." not in folder.parts


# --- config.json ----------------------------------------------------------------------------------


@given(config=configs)
def test_config_json_comes_back_the_same(
    tmp_path_factory: pytest.TempPathFactory, config: RunConfig
) -> None:
    path = tmp_path_factory.mktemp("config") / "config.json"
    path.write_text(config_text(config), encoding="utf-8")
    assert read_config(path) == config
    assert read_config(path.parent) == config


@pytest.mark.parametrize(
    ("change", "expected"),
    [
        ({"schema": "other"}, "schema"),
        ({"seed": "zero"}, "seed: expected a whole number"),
        ({"sped": 1.0}, "sped"),
        ({"duration": -1}, "duration: expected seconds above 0"),
    ],
)
def test_a_changed_config_json_is_refused_with_file_and_field(
    tmp_path: Path, change: dict[str, object], expected: str
) -> None:
    values = json.loads(config_text(RunConfig("SE1"))) | change
    path = tmp_path / "config.json"
    path.write_text(json.dumps(values))
    with pytest.raises(InputError, match=expected) as caught:
        read_config(path)
    assert str(path) in str(caught.value)


@pytest.mark.parametrize("text", ["", "{", "[]", "3", "{}"])
def test_what_is_not_a_config_json_is_refused(tmp_path: Path, text: str) -> None:
    path = tmp_path / "config.json"
    path.write_text(text)
    with pytest.raises(InputError, match=r"config\.json"):
        read_config(path)


def test_a_config_json_that_is_absent_is_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="cannot be read"):
        read_config(tmp_path)


# --- the folder -----------------------------------------------------------------------------------


def config_for(folder: Path) -> RunConfig:
    return RunConfig("SE1", out=folder)


def test_a_new_folder_is_made_and_marked(tmp_path: Path) -> None:
    config = config_for(tmp_path / "deep" / "run")
    assert claim_folder(config) == config.folder
    assert read_config(config.folder) == config


def test_an_earlier_run_is_replaced_and_other_files_stay(tmp_path: Path) -> None:
    config = config_for(tmp_path / "run")
    claim_folder(config)
    for name in (*RUN_FILES, ".map.ply.x1.part", "notes.txt"):
        (config.folder / name).write_text("old")
    claim_folder(RunConfig("SE1", seed=1, out=config.folder))
    assert {path.name for path in config.folder.iterdir()} == {"config.json", "notes.txt"}
    assert read_config(config.folder).seed == 1


@pytest.mark.parametrize("name", ["notes.txt", "config.json"])
def test_a_folder_that_is_not_ours_is_left_alone(tmp_path: Path, name: str) -> None:
    (tmp_path / name).write_text('{"mine": true}')
    with pytest.raises(InputError, match="holds files but no config.json of a run"):
        claim_folder(config_for(tmp_path))
    assert [path.name for path in tmp_path.iterdir()] == [name]
    assert (tmp_path / name).read_text() == '{"mine": true}'


def test_a_file_in_the_place_of_the_folder_is_refused(tmp_path: Path) -> None:
    (tmp_path / "run").write_text("")
    with pytest.raises(InputError, match="is a file"):
        check_folder(tmp_path / "run")
    with pytest.raises(InputError, match="cannot be written"):
        check_folder(tmp_path / "run" / "below")


def test_checking_a_folder_changes_nothing(tmp_path: Path) -> None:
    check_folder(tmp_path / "deep" / "run")
    assert not any(tmp_path.iterdir())


@pytest.mark.skipif(os.geteuid() == 0, reason="nothing is forbidden to root")
def test_a_folder_without_permission_is_refused(tmp_path: Path) -> None:
    tmp_path.chmod(0o500)
    with pytest.raises(InputError, match="no permission"):
        check_folder(tmp_path / "run")


def test_a_place_where_nothing_can_be_made_is_refused() -> None:
    with pytest.raises(InputError, match="out: .* cannot be written"):
        claim_folder(config_for(Path("/proc/roomloop")))
