"""Scenario files: what they mean, what is refused, and what a run of one says at its end."""

from __future__ import annotations

import csv
import json
import sys
from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace

import pytest
from fakes import metrics, metrics_of
from hypothesis import given, settings
from hypothesis import strategies as st

from eval.cli import main
from eval.comparing.bounds import COMPARISONS, Bound, check_bounds, parse_bound
from eval.comparing.scenario import SHIPPED, parse_seeds, read_scenario
from eval.comparing.values import HIGHER_IS_BETTER, LOWER_IS_BETTER, metric_names, value_of
from eval.config import RunConfig
from eval.folder import claim_folder
from eval.metrics import Rooms
from eval.outputs import write_metrics
from slam.core import InputError, RunError

Capture = pytest.CaptureFixture[str]

# --- metrics by name ------------------------------------------------------------------------------


def test_every_number_of_the_metrics_has_a_name() -> None:
    names = metric_names()
    assert {"ate_m", "rooms.precision", "room_latency_s.p95", "stages.graph.total_s"} <= set(names)
    assert not {"schema", "T_world_map", "versions", "error", "rooms"} & set(names)
    assert set(names) >= HIGHER_IS_BETTER | LOWER_IS_BETTER
    assert not HIGHER_IS_BETTER & LOWER_IS_BETTER


def test_a_value_is_found_by_its_name() -> None:
    known = metrics(ate_m=0.25, rooms=Rooms(precision=0.5, truth=4))
    assert value_of(known, "ate_m") == 0.25
    assert value_of(known, "rooms.precision") == 0.5
    assert value_of(known, "rooms.truth") == 4.0
    assert value_of(known, "walls.recall") is None


# --- bounds ---------------------------------------------------------------------------------------


@settings(deadline=None, max_examples=40)
@given(
    st.sampled_from(sorted(COMPARISONS)),
    st.floats(-1e6, 1e6),
    st.sampled_from(["", " ", "  "]),
    st.booleans(),
)
def test_a_bound_is_read_as_it_is_written(sign: str, limit: float, gap: str, mean: bool) -> None:
    key = "mean(rooms.recall)" if mean else "rooms.recall"
    bound = parse_bound("file", key, f" {sign}{gap}{limit!r} ")
    assert bound == Bound("rooms.recall", sign, limit, mean)
    assert bound.name == key


@pytest.mark.parametrize(
    ("key", "text", "named"),
    [
        ("ate_n", "< 1", "did you mean 'ate_m'"),
        ("rooms.precison", "< 1", "did you mean 'rooms.precision'"),
        ("mean(ate)", "< 1", "did you mean 'ate_m'"),
        ("versions", "< 1", "unknown metric"),
        ("ate_m", "0.04", "ate_m: expected one of <=, >=, ==, <, >"),
        ("ate_m", "=< 0.04", "ate_m: expected"),
        ("ate_m", "<= four", "ate_m: expected"),
        ("ate_m", "<= nan", "ate_m: expected"),
        ("ate_m", "<= 1 2", "ate_m: expected"),
        ("ate_m", 0.04, "ate_m: expected"),
    ],
)
def test_a_bound_that_means_nothing_is_refused(key: str, text: object, named: str) -> None:
    with pytest.raises(InputError, match="^f.toml: expect: ") as refused:
        parse_bound("f.toml", key, text)
    assert named in str(refused.value)


def test_bounds_hold_for_every_seed_and_means_for_all() -> None:
    runs = {0: metrics(ate_m=0.01), 1: metrics(ate_m=0.05)}
    each, mean = Bound("ate_m", "<=", 0.04), Bound("ate_m", "<=", 0.031, mean=True)
    checks = check_bounds([each, mean], runs)
    assert [(check.seed, check.held) for check in checks] == [(0, True), (1, False), (None, True)]
    assert str(checks[1]) == "ate_m of seed 1 is 0.05, expected <= 0.04: missed by 0.01"


def test_a_null_misses_its_bound_and_the_mean() -> None:
    runs = {0: metrics(ate_m=0.01), 1: metrics()}
    checks = check_bounds([Bound("ate_m", "<", 1.0), Bound("ate_m", "<", 1.0, mean=True)], runs)
    assert [check.held for check in checks] == [True, False, False]
    assert "is null" in str(checks[2])


# --- files ----------------------------------------------------------------------------------------


def written(folder: Path, text: str, name: str = "case.toml") -> str:
    path = folder / name
    path.write_text(text)
    return str(path)


def test_a_file_becomes_runs(tmp_path: Path) -> None:
    (tmp_path / "plan.json").write_text("{}")
    file = written(
        tmp_path,
        'scene = "plan.json"\nseeds = [3, 5]\nduration = 12\ndetector = "none"\n'
        'markers = ["slow"]\ndescription = "what for"\n'
        '[expect]\nate_m = "<= 0.04"\n"mean(ate_m)" = "< 0.03"\nrooms.precision = ">= 0.95"\n',
    )
    scenario = read_scenario(file)
    assert scenario.name == "case"
    assert scenario.config.scene == str(tmp_path / "plan.json")
    assert [bound.name for bound in scenario.bounds] == ["ate_m", "mean(ate_m)", "rooms.precision"]
    assert [(run.seed, run.out) for run in scenario.runs] == [
        (3, Path("runs/case/s3")),
        (5, Path("runs/case/s5")),
    ]
    assert {run.duration for run in scenario.runs} == {12}


def test_flags_override_the_file(tmp_path: Path) -> None:
    file = written(tmp_path, 'scene = "SE1"\nseeds = [3, 5]\ndetector = "none"\nspeed = 0.5\n')
    scenario = read_scenario(file, seed=9, detector="oracle", out=tmp_path / "out")
    (run,) = scenario.runs
    assert run == RunConfig("SE1", seed=9, detector="oracle", speed=0.5, out=tmp_path / "out")


@pytest.mark.parametrize(
    ("text", "named"),
    [
        ("", "scene: expected a name of the catalogue or a path"),
        ("scene = 3", "scene: expected"),
        ('scene = "SE1"\ndetektor = "gnn"', "unknown key 'detektor'"),
        ('scene = "SE1"\ndetektor = "gnn"', "did you mean 'detector'"),
        ('scene = "SE1"\nseed = 3\nseeds = [3]', "expected seed or seeds, found both"),
        ('scene = "SE1"\nseed = "x"', "seeds: expected"),
        ('scene = "SE1"\nout = "here"', "unknown key 'out'"),
        ('scene = "SE1"\nduration = "long"', "duration: expected a number"),
        ('scene = "SE1"\nduration = -1', "duration: expected seconds above 0"),
        ('scene = "SE1"\ndetector = "gmn"', "did you mean 'gnn'"),
        ('scene = "SE1"\nseeds = []', "seeds: expected different whole numbers"),
        ('scene = "SE1"\nseeds = [1, 1]', "seeds: expected different whole numbers"),
        ('scene = "SE1"\nseeds = [-1]', "seeds: expected"),
        ('scene = "SE1"\nseeds = [true]', "seeds: expected"),
        ('scene = "SE1"\nseeds = 3', "seeds: expected"),
        ('scene = "SE1"\nexpect = 3', "expect: expected a table"),
        ('scene = "SE1"\n[expect]\nate = "< 1"', "did you mean 'ate_m'"),
        ("scene = SE1", "expected TOML"),
    ],
)
def test_a_wrong_file_ends_with_2_and_one_line_that_names_it(
    tmp_path: Path, capsys: Capture, text: str, named: str
) -> None:
    file = written(tmp_path, text)
    assert main(["run", file]) == 2
    err = capsys.readouterr().err
    assert err.startswith(f"roomloop: {file}: ")
    assert named in err
    assert err.count("\n") == 1


def test_a_file_that_is_not_there_is_named_with_those_that_ship(capsys: Capture) -> None:
    assert main(["run", "smoke/SE11.toml"]) == 2
    assert "smoke/SE1" in capsys.readouterr().err


@pytest.mark.parametrize("path", sorted(SHIPPED.glob("*/*.toml")), ids=lambda path: path.stem)
def test_the_scenarios_that_ship_can_be_read(path: Path) -> None:
    scenario = read_scenario(path.relative_to(SHIPPED).as_posix())
    assert scenario.bounds
    assert scenario == read_scenario(str(path))


def test_seeds_on_the_command_line() -> None:
    assert parse_seeds("4") == (4,)
    assert parse_seeds("0-3, 7") == (0, 1, 2, 3, 7)
    for wrong in ("", "a", "1,", "3-1", "1,1", "0-2,1", "-1", "0-99999999"):
        with pytest.raises(InputError, match="seeds: expected"):
            parse_seeds(wrong)


# --- runs -----------------------------------------------------------------------------------------


@pytest.fixture
def stub(monkeypatch: pytest.MonkeyPatch) -> None:
    """Runs that only write their metrics: seed 13 fails; ate_m is a hundredth of the seed."""

    def run(
        config: RunConfig, progress: Callable[[float, float], None], watchers: object = ()
    ) -> object:
        if config.start == "ballroom":
            raise InputError("start: no room 'ballroom'")
        failed = config.seed == 13
        known = metrics_of(
            config, ate_m=None if failed else 0.01 * config.seed, rooms=Rooms(precision=1.0)
        )
        folder = claim_folder(config)
        write_metrics(known, folder / "metrics.json")
        if failed:
            raise RunError("the base hit\na wall")
        return SimpleNamespace(metrics=known, folder=folder)

    monkeypatch.setitem(sys.modules, "eval.run", SimpleNamespace(run=run))


@pytest.mark.usefixtures("stub")
@pytest.mark.parametrize(
    ("seeds", "status", "said"),
    [
        ([1, 2], 0, ""),
        ([1, 5], 1, "roomloop: missed: ate_m of seed 5 is 0.05, expected <= 0.04: missed by 0.01"),
        ([4], 1, "roomloop: missed: mean(ate_m) is 0.04, expected < 0.04: missed by 0"),
        ([13, 1], 3, "roomloop: seed 13 failed: the base hit a wall"),
    ],
)
def test_the_exit_status_says_whether_it_passed(
    tmp_path: Path, capsys: Capture, seeds: list[int], status: int, said: str
) -> None:
    file = written(
        tmp_path,
        f'scene = "SE1"\nseeds = {seeds}\n[expect]\nate_m = "<= 0.04"\n"mean(ate_m)" = "< 0.04"\n',
    )
    out = tmp_path / "out"
    assert main(["run", file, "--out", str(out)]) == status
    assert said in capsys.readouterr().err
    verdict = json.loads((out / "verdict.json").read_text())
    assert all(entry["held"] for entry in verdict["bounds"]) == (status == 0)
    assert list(verdict["failures"]) == (["13"] if status == 3 else [])


@pytest.mark.usefixtures("stub")
def test_several_seeds_give_a_folder_each_and_a_table(tmp_path: Path, capsys: Capture) -> None:
    out = tmp_path / "out"
    assert main(["run", "SE1", "--seeds", "1-3", "--detector", "none", "--out", str(out)]) == 0
    assert {path.name for path in out.iterdir()} == {"config.json", "table.csv", "s1", "s2", "s3"}
    with (out / "table.csv").open() as file:
        rows = list(csv.DictReader(file))
    assert [(row["seed"], float(row["ate_m"]), row["mma_m"]) for row in rows] == [
        ("1", 0.01, ""),
        ("2", 0.02, ""),
        ("3", 0.03, ""),
    ]
    assert "mean" in capsys.readouterr().out
    # What an earlier run left is replaced, by several runs or by one; what is not ours is not.
    assert main(["run", "SE1", "--seeds", "4,5", "--out", str(out)]) == 0
    assert main(["run", "SE1", "--seed", "4", "--out", str(out)]) == 0
    assert not (out / "table.csv").exists()
    (out / "config.json").unlink()
    assert main(["run", "SE1", "--seeds", "4,5", "--out", str(out)]) == 2


@pytest.mark.usefixtures("stub")
def test_what_is_refused_writes_nothing(tmp_path: Path, capsys: Capture) -> None:
    out = tmp_path / "out"
    assert main(["run", "SE1", "--seeds", "1,2", "--start", "ballroom", "--out", str(out)]) == 2
    assert not out.exists()
    assert main(["run", "SE1", "--seeds", "1,2", "--seed", "1"]) == 2
    assert "--seed or --seeds" in capsys.readouterr().err
