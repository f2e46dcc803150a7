"""The command: its exit status, its one line for what is wrong, and what it hands to a run."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
from collections.abc import Callable
from dataclasses import fields
from pathlib import Path
from types import SimpleNamespace

import pytest
from fakes import metrics

from eval.cli import main
from eval.config import RunConfig
from eval.metrics import Rooms, Stages, StageTime
from eval.outputs import read_metrics, read_tum
from slam.core import InputError, RunError

Run = Callable[[RunConfig, Callable[[float, float], None]], object]
Capture = pytest.CaptureFixture[str]


@pytest.fixture
def stand_in(monkeypatch: pytest.MonkeyPatch) -> Callable[[Run], None]:
    """Puts a function in the place of eval.run.run: here the command is tested, not the loop."""

    def put(function: Run) -> None:
        monkeypatch.setitem(sys.modules, "eval.run", SimpleNamespace(run=function))

    return put


def refused(capsys: Capture, arguments: list[str]) -> str:
    """The one line on standard error of a command that must end with status 2."""
    assert main(arguments) == 2
    out, err = capsys.readouterr()
    assert out == ""
    assert err.startswith("roomloop: ")
    assert err.count("\n") == 1
    return err


# --- usage ----------------------------------------------------------------------------------------


@pytest.mark.parametrize("arguments", [["--help"], ["run", "--help"], ["scenes", "--help"]])
def test_help_is_given(capsys: Capture, arguments: list[str]) -> None:
    assert main(arguments) == 0
    assert "Usage: roomloop" in capsys.readouterr().out


def test_every_field_of_a_run_has_its_flag(capsys: Capture) -> None:
    main(["run", "--help"])
    text = capsys.readouterr().out
    flags = {f"--{item.name}" for item in fields(RunConfig) if item.name != "scene"}
    assert all(flag in text for flag in flags)


@pytest.mark.parametrize(
    ("arguments", "named"),
    [
        ([], "Missing command"),
        (["rum"], "rum"),
        (["run"], "scene"),
        (["run", "SE1", "SE2"], "SE2"),
        (["run", "SE1", "--sed", "3"], "--sed"),
        (["run", "SE1", "--seed", "three"], "--seed"),
        (["run", "SE1", "--duration"], "--duration"),
        (["run", "SE1", "--duration", "0"], "duration: expected seconds above 0"),
        (["run", "SE1", "--duration", "-5"], "duration: expected seconds above 0"),
        (["run", "SE1", "--speed", "0"], "speed: expected m/s above 0"),
        (["run", "SE1", "--detector", "gmn"], "did you mean 'gnn'"),
        (["run", "SE1", "--layers", "all"], "expected one of: planes, rooms, rooms+walls"),
        (["scenes", "--show", "SE"], "SE1"),
        (["scenes", "--show", "absent.json"], "absent.json"),
    ],
)
def test_wrong_usage_ends_with_2_and_one_line(
    capsys: Capture, arguments: list[str], named: str
) -> None:
    assert named in refused(capsys, arguments)


# --- run ------------------------------------------------------------------------------------------


def test_flags_reach_the_run(stand_in: Callable[[Run], None], tmp_path: Path) -> None:
    seen: list[RunConfig] = []

    def run(config: RunConfig, progress: object, watchers: object = ()) -> object:
        seen.append(config)
        return SimpleNamespace(metrics=metrics(), folder=tmp_path)

    stand_in(run)
    expected = RunConfig(
        scene="plan.json",
        seed=7,
        out=tmp_path / "out",
        duration=12.5,
        speed=0.8,
        storey=1,
        start="office",
        route="west",
        closed=True,
        sensor="ideal",
        conditions="ideal",
        detector="my.rooms:Finder",
        odometry="my.poses:Odometry",
        layers="planes",
        factors="paper",
        loops="off",
        truth="poses.tum",
        topic="/points",
        save=True,
        cache=tmp_path / "cache",
        unit="in",
        up="y",
    )
    flags = [
        part
        for item in fields(RunConfig)
        if item.name not in ("scene", "save", "closed")
        for part in (f"--{item.name}", str(getattr(expected, item.name)))
    ]
    assert main(["run", "plan.json", "--save", "--closed", *flags]) == 0
    assert main(["run", "SE1"]) == 0
    assert seen == [expected, RunConfig("SE1")]


def test_the_summary_says_what_was_scored_and_where_it_is(
    stand_in: Callable[[Run], None], capsys: Capture, tmp_path: Path
) -> None:
    result = metrics(
        scene="SE1",
        seed=4,
        detector="gnn",
        ate_m=0.0123,
        ate_odometry_m=0.0456,
        real_time_factor=3.21,
        rooms=Rooms(truth=9, entered=8, detected=7.5, precision=0.987, recall=0.654),
        stages=Stages(lidar=StageTime(5.1, 6.2, 77.7)),
    )
    stand_in(lambda config, progress, watchers=(): SimpleNamespace(metrics=result, folder=tmp_path))
    assert main(["run", "SE1"]) == 0
    text = capsys.readouterr().out
    for part in (
        "SE1, gnn, seed 4",
        "0.99",
        "0.65",
        "of 7.5 right",
        "1.2 cm",
        "4.6 cm",
        "3.2",
        "77.7",
    ):
        assert part in text
    assert str(tmp_path) in text


def test_progress_is_plain_lines_without_a_terminal(
    stand_in: Callable[[Run], None], capsys: Capture, tmp_path: Path
) -> None:
    def run(
        config: RunConfig, progress: Callable[[float, float], None], watchers: object = ()
    ) -> object:
        for step in range(1001):
            progress(0.1 * step, 100.0)
        return SimpleNamespace(metrics=metrics(), folder=tmp_path)

    stand_in(run)
    assert main(["run", "SE1"]) == 0
    lines = capsys.readouterr().err.splitlines()
    assert len(lines) == 10
    assert lines[-1].startswith("SE1: 100.0 of 100.0 s simulated, ")


@pytest.mark.parametrize(
    ("error", "status"),
    [(RunError("the base hit\na wall"), 3), (InputError("plan.json: walls: none"), 2)],
)
def test_our_errors_become_one_line_and_their_status(
    stand_in: Callable[[Run], None], capsys: Capture, error: Exception, status: int
) -> None:
    def run(config: RunConfig, progress: object, watchers: object = ()) -> object:
        raise error

    stand_in(run)
    assert main(["run", "SE1"]) == status
    assert capsys.readouterr().err == f"roomloop: {' '.join(str(error).split())}\n"


def test_ctrl_c_ends_with_130(stand_in: Callable[[Run], None], capsys: Capture) -> None:
    def run(config: RunConfig, progress: object, watchers: object = ()) -> object:
        raise KeyboardInterrupt

    stand_in(run)
    assert main(["run", "SE1"]) == 130
    assert capsys.readouterr().err.strip() == "roomloop: stopped"


def test_ctrl_c_while_a_library_is_loaded_ends_with_130_too(
    stand_in: Callable[[Run], None], capsys: Capture
) -> None:
    def run(config: RunConfig, progress: object, watchers: object = ()) -> object:
        raise ImportError("initialization failed") from KeyboardInterrupt()

    stand_in(run)
    assert main(["run", "SE1"]) == 130
    assert capsys.readouterr().err.strip() == "roomloop: stopped"


def test_a_fault_of_ours_keeps_its_trace(stand_in: Callable[[Run], None]) -> None:
    def run(config: RunConfig, progress: object, watchers: object = ()) -> object:
        raise ZeroDivisionError

    stand_in(run)
    with pytest.raises(ZeroDivisionError):
        main(["run", "SE1"])


def test_warnings_of_ours_are_shown_and_others_are_not(
    stand_in: Callable[[Run], None], capsys: Capture, tmp_path: Path
) -> None:
    import logging
    import warnings

    def run(config: RunConfig, progress: object, watchers: object = ()) -> object:
        logging.getLogger("sim.route").warning("rooms without a way to them: store")
        logging.getLogger("somebody.else").warning("chatter")
        warnings.warn("deprecated chatter", stacklevel=1)
        return SimpleNamespace(metrics=metrics(), folder=tmp_path)

    stand_in(run)
    with warnings.catch_warnings():
        assert main(["run", "SE1"]) == 0
    assert capsys.readouterr().err == "roomloop: warning: rooms without a way to them: store\n"


# --- the real thing -------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("arguments", "named"),
    [
        (["run", "SE0"], "SE1"),
        (["run", "broken.json"], "broken.json"),
        (["run", "SE1", "--sensor", "vlp32"], "vlp16"),
        (["run", "SE1", "--conditions", "idol"], "ideal"),
        (["run", "SE1", "--detector", "absent.module:Class"], "absent"),
        (["run", "SE1", "--out", "notes"], "notes"),
        (["run", "SE1", "--out", "/proc/run"], "/proc/run"),
    ],
)
def test_bad_input_writes_nothing(
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: Capture,
    arguments: list[str],
    named: str,
) -> None:
    (tmp_path / "broken.json").write_text('{"name": ')
    (tmp_path / "notes").mkdir()
    (tmp_path / "notes" / "mine.txt").write_text("")
    before = sorted(tmp_path.rglob("*"))
    monkeypatch.chdir(tmp_path)
    assert named in refused(capsys, arguments)
    assert sorted(tmp_path.rglob("*")) == before


def test_the_catalogue_is_listed(capsys: Capture) -> None:
    assert main(["scenes"]) == 0
    text = capsys.readouterr().out
    assert "SE1" in text
    assert "6 squared" in text


def test_a_scene_is_drawn_where_it_says(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: Capture
) -> None:
    monkeypatch.chdir(tmp_path)
    assert main(["scenes", "--show", "SE1"]) == 0
    picture = tmp_path / capsys.readouterr().out.strip()
    assert picture.read_bytes().startswith(b"\x89PNG")
    assert list(tmp_path.iterdir()) == [picture]


def test_scenes_draws_any_conditions_with_the_route(tmp_path: Path, capsys: Capture) -> None:
    path = tmp_path / "site.png"
    command = ["scenes", "--show", "SE1", "--conditions", "real-site", "--route"]
    assert main([*command, "--out", str(path)]) == 0
    assert path.read_bytes().startswith(b"\x89PNG")
    assert capsys.readouterr().out.strip() == str(path)


def test_scenes_draws_all_on_one_sheet(tmp_path: Path) -> None:
    assert main(["scenes", "--sheet", str(tmp_path / "new" / "sheet.png")]) == 0
    assert (tmp_path / "new" / "sheet.png").read_bytes().startswith(b"\x89PNG")


def test_scenes_writes_the_truth_that_a_run_is_scored_against(tmp_path: Path) -> None:
    from eval.source import make_world
    from worlds.truthfile import read_truth

    path = tmp_path / "truth.json"
    command = ["scenes", "--truth", "SE1", "--seed", "3", "--conditions", "unfinished"]
    assert main([*command, "--out", str(path)]) == 0
    world = make_world(RunConfig("SE1", seed=3, conditions="unfinished"))
    assert [f.d for f in read_truth(path).truth.faces] == [f.d for f in world.truth.faces]


def test_scenes_does_one_thing_at_a_time(capsys: Capture) -> None:
    assert main(["scenes", "--show", "SE1", "--truth", "SE1"]) == 2
    assert "--show and --truth" in capsys.readouterr().err


# --- in a process of its own ----------------------------------------------------------------------

ROOT = Path(__file__).parents[2]


def started(*arguments: str, folder: Path) -> subprocess.Popen[str]:
    """Stopped by SIGINT as at a terminal, also where the tests run in the background, whose
    processes ignore it."""
    return subprocess.Popen(
        [sys.executable, "-m", "eval.cli", *arguments],
        cwd=folder,
        env=os.environ | {"PYTHONPATH": str(ROOT)},
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.SIG_DFL),
    )


def test_the_module_is_the_command(tmp_path: Path) -> None:
    process = started("run", "SE0", folder=tmp_path)
    out, err = process.communicate()
    assert (process.returncode, out) == (2, "")
    assert err.startswith("roomloop: ")
    assert err.count("\n") == 1


def test_a_run_that_is_stopped_leaves_its_metrics(tmp_path: Path) -> None:
    process = started("run", "SE1", "--duration", "60", "--out", "run", folder=tmp_path)
    assert process.stderr is not None
    first = process.stderr.readline()
    assert "of 60.0 s simulated" in first, first + process.stderr.read()
    process.send_signal(signal.SIGINT)
    _, err = process.communicate()
    assert process.returncode == 130
    assert err.splitlines()[-1] == "roomloop: stopped"
    assert "Traceback" not in err
    metrics = read_metrics(tmp_path / "run" / "metrics.json")
    assert metrics.status == "cut_off"
    assert metrics.simulated_s is not None
    assert metrics.simulated_s < 60.0
    assert len(read_tum(tmp_path / "run" / "trajectory.tum")) == round(10 * metrics.simulated_s)
