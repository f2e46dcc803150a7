"""Many runs at once: one table whatever dies meanwhile, and a clear line for what cannot be."""

from __future__ import annotations

import csv
import errno
import json
import os
import random
import signal
import subprocess
import sys
import time
from dataclasses import replace
from pathlib import Path

import pytest
from fakes import metrics_of, run_stub

from eval.config import RunConfig
from eval.files import read_json
from eval.sweep.engine import State, SweepConfig, simulated_seconds, sweep
from eval.sweep.forecast import Cost, Forecast
from eval.sweep.job import Job, Row, row_of, row_text
from eval.sweep.pool import THREAD_VARIABLES, LocalWorkers
from eval.sweep.store import open_store
from eval.sweep.work import work
from slam.core import InputError, RunError

STUB = "fakes:run_stub"


def configs(count: int, start: str | None = None, **known: object) -> list[RunConfig]:
    return [RunConfig("SE1", seed=seed, start=start, **known) for seed in range(count)]  # type: ignore[arg-type]


def settings(folder: Path, **known: object) -> SweepConfig:
    return SweepConfig(folder, **({"workers": 1, "runner": STUB} | known))  # type: ignore[arg-type]


def table(folder: Path) -> list[dict[str, str]]:
    with (folder / "table.csv").open(newline="") as file:
        return list(csv.DictReader(file))


# --- jobs and rows --------------------------------------------------------------------------------


def test_a_job_is_named_by_what_its_result_depends_on(tmp_path: Path) -> None:
    config = RunConfig("SE1", seed=3)
    key = Job(config).key
    same = [
        replace(config, out=tmp_path),
        replace(config, save=True),
        replace(config, cache=tmp_path),
    ]
    assert {Job(other).key for other in same} == {key}
    others = [replace(config, seed=4), replace(config, layers="planes"), replace(config, speed=1.0)]
    assert len({key, *(Job(other).key for other in others)}) == 4


def test_a_job_follows_its_plan(tmp_path: Path) -> None:
    plan = tmp_path / "plan.json"
    plan.write_text("{}")
    before = Job(RunConfig(str(plan))).key
    plan.write_text("{ }")
    assert Job(RunConfig(str(plan))).key != before


def test_a_row_comes_back_from_its_file(tmp_path: Path) -> None:
    config = RunConfig("SE1", seed=3, cache=tmp_path)
    for row in (
        Row(config, "complete", None, 1.5, metrics_of(config, ate_m=0.25)),
        Row(config, "failed", "the base hit a wall", 0.5, None),
    ):
        path = tmp_path / "row.json"
        path.write_text(row_text(row))
        assert row_of(read_json(path), path) == row


@pytest.mark.parametrize(
    "change",
    [
        {"schema": 3},
        {"config": 3},
        {"config": {"sene": "SE1"}},
        {"status": "odd"},
        {"error": 3},
        {"seconds": "x"},
        {"metrics": 3},
        {"metrics": {}},
    ],
    ids=str,
)
def test_a_row_that_is_damaged_is_named(change: dict[str, object]) -> None:
    tree = json.loads(row_text(Row(RunConfig("SE1"), "failed", "so", 1.0, None)))
    with pytest.raises(InputError, match=r"^row\.json: "):
        row_of(tree | change, Path("row.json"))


# --- a sweep --------------------------------------------------------------------------------------


def test_every_run_is_a_row_in_the_order_that_was_asked(tmp_path: Path) -> None:
    asked = [
        replace(config, layers=layers) for config in configs(3) for layers in ("rooms", "planes")
    ]
    states: list[State] = []
    rows = sweep(asked, settings(tmp_path / "out", workers=2), states.append)
    assert [row.config for row in rows] == asked
    assert [row.metrics for row in rows] == [run_stub(config) for config in asked]
    assert [(line["seed"], line["layers"]) for line in table(tmp_path / "out")] == [
        (str(config.seed), config.layers) for config in asked
    ]
    assert [float(line["ate_m"]) for line in table(tmp_path / "out")] == [
        row.metrics.ate_m for row in rows if row.metrics
    ]
    assert (states[0].done, states[-1].done, states[-1].total) == (0, 6, 6)
    assert states[-1].remaining_s == 0.0


def test_the_table_is_parquet_too(tmp_path: Path) -> None:
    parquet = pytest.importorskip("pyarrow.parquet")
    sweep(configs(2), settings(tmp_path / "out"))
    read = parquet.read_table(tmp_path / "out" / "table.parquet").to_pydict()
    assert read["seed"] == [0, 1]
    assert read["ate_m"] == [float(line["ate_m"]) for line in table(tmp_path / "out")]
    assert read["walls.recall"] == [None, None]


def test_what_is_done_is_not_done_again(tmp_path: Path) -> None:
    first = sweep(configs(3), settings(tmp_path / "out"))
    # A runner that is not there: whoever called it would fail.
    again = sweep(configs(3), settings(tmp_path / "out", runner="absent:run"))
    assert again == first
    more = sweep(configs(5), settings(tmp_path / "out"))
    assert more[:3] == first
    assert len(table(tmp_path / "out")) == 5


@pytest.mark.parametrize(
    ("start", "error"),
    [
        ("fail", "the base hit a wall"),
        ("bug", "ZeroDivisionError: by nothing (fakes.py, line"),
        ("crash", "its worker died 3 times"),
    ],
)
def test_a_run_that_fails_is_a_row_with_its_error(tmp_path: Path, start: str, error: str) -> None:
    asked = [*configs(1, start), *configs(3)]
    rows = sweep(asked, settings(tmp_path / "out"))
    assert [row.status for row in rows] == ["failed", "complete", "complete", "complete"]
    assert error in str(rows[0].error)
    assert [line["status"] for line in table(tmp_path / "out")] == [row.status for row in rows]


def test_a_run_whose_worker_dies_is_tried_again(tmp_path: Path) -> None:
    asked = configs(3, "crash once", cache=tmp_path / "memory" / "cache")
    (tmp_path / "memory").mkdir()
    rows = sweep(asked, settings(tmp_path / "out", workers=2))
    assert [row.status for row in rows] == ["complete"] * 3
    assert len(list((tmp_path / "memory").glob("crashed-*"))) == 3


def test_workers_that_cannot_start_end_the_sweep(tmp_path: Path) -> None:
    with pytest.raises(RunError, match="workers die as they start"):
        sweep(configs(3), settings(tmp_path / "out", runner="absent:run"))


def test_the_cores_threads_are_shared_out(tmp_path: Path) -> None:
    before = dict(os.environ)
    workers = LocalWorkers(2, "os:getenv", tmp_path / "scratch")
    try:
        assert dict(os.environ) == before
        assert workers.size == workers.idle == 2
    finally:
        workers.close()
    assert "OMP_NUM_THREADS" in THREAD_VARIABLES


# --- what is refused ------------------------------------------------------------------------------


def test_a_full_disk_stops_the_sweep_and_keeps_what_was_done(tmp_path: Path) -> None:
    out = tmp_path / "out"
    sweep(configs(2), settings(out))
    kept = sorted((out / "runs").iterdir())
    with pytest.raises(
        InputError, match="somewhere: No space left on device: 2 of 3 runs are kept"
    ):
        sweep([*configs(2), *configs(1, "full disk")], settings(out))
    assert sorted((out / "runs").iterdir()) == kept


def test_a_disk_that_is_full_for_the_results_is_said(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def full(descriptor: int) -> None:
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    out = tmp_path / "out"
    sweep(configs(2), settings(out))
    monkeypatch.setattr("eval.files.os.fsync", full)
    with pytest.raises(InputError, match=r"cannot be written: No space left on device"):
        sweep(configs(4), settings(out))
    monkeypatch.undo()
    assert len(list((out / "runs").iterdir())) == 2
    assert not list(out.rglob("*.part"))
    assert [row.status for row in sweep(configs(4), settings(out))] == ["complete"] * 4


def test_two_sweeps_do_not_share_a_folder(tmp_path: Path) -> None:
    with (
        open_store(tmp_path / "out"),
        pytest.raises(InputError, match=f"in use by another sweep .process {os.getpid()}"),
    ):
        sweep(configs(1), settings(tmp_path / "out"))
    assert not (tmp_path / "out").exists()


def test_somebody_elses_folder_is_left_alone(tmp_path: Path) -> None:
    (tmp_path / "notes.txt").write_text("mine")
    with pytest.raises(InputError, match=r"no sweep\.json"):
        sweep(configs(1), settings(tmp_path))
    with pytest.raises(InputError, match="is a file"):
        sweep(configs(1), settings(tmp_path / "notes.txt"))
    assert [path.name for path in tmp_path.iterdir()] == ["notes.txt"]


def test_nothing_to_do_and_nobody_to_do_it_are_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="no runs"):
        sweep([], settings(tmp_path / "out"))
    with pytest.raises(InputError, match="workers: expected 1 or more"):
        settings(tmp_path, workers=0)
    with pytest.raises(InputError, match="got both"):
        settings(tmp_path, cluster="tcp://127.0.0.1:1")
    with pytest.raises(InputError, match="SE0"):
        sweep([RunConfig("SE0")], settings(tmp_path / "out"))
    assert not (tmp_path / "out").exists()


# --- front ends -----------------------------------------------------------------------------------


def test_one_run_of_each_front_end_goes_first(tmp_path: Path) -> None:
    """Two runs at once: those that wait for a front end do not start before it is there."""
    from eval.artefact import artefact_path
    from eval.sweep.engine import _Queue

    cache = tmp_path / "cache"
    jobs = [Job(RunConfig("SE1", layers=layers, cache=cache)) for layers in ("planes", "rooms")]
    paths = {job.key: artefact_path(job.config) for job in jobs}
    assert len(set(paths.values())) == 1
    queue = _Queue(list(jobs), paths)
    assert queue.take() == jobs[0]
    assert queue.take() is None
    queue.ended(jobs[0])
    assert queue.take() == jobs[1]


# --- forecast -------------------------------------------------------------------------------------


def test_the_forecast_learns() -> None:
    live = Cost("a", "v", replay=False, simulated=100.0)
    replay = replace(live, replay=True)
    other = replace(live, scene="b", simulated=200.0)
    forecast = Forecast()
    assert forecast.one(replay) < forecast.one(live) < forecast.one(other)
    forecast.add(live, 2.0 * live.prior)
    assert forecast.one(live) == 2.0 * live.prior
    assert forecast.one(other) == pytest.approx(2.0 * other.prior)
    assert forecast.knows([live])
    assert not forecast.knows([live, replay])
    assert forecast.all([live] * 4, workers=2) == 4.0 * live.prior
    assert forecast.all([], workers=2) == 0.0


def test_a_run_is_expected_to_take_as_long_as_its_scene_is_large() -> None:
    whole = simulated_seconds(RunConfig("SE1"))
    assert 60.0 < whole < 300.0
    assert simulated_seconds(RunConfig("SE1", duration=5.0)) == 5.0
    assert simulated_seconds(RunConfig("SE1", speed=1.2)) == pytest.approx(whole / 2)


# --- killed at any moment -------------------------------------------------------------------------

SCRIPT = """
import sys
from pathlib import Path
from test_sweep import configs, settings, sweep

if __name__ == "__main__":
    sweep(configs(60, "sleep 0.25"), settings(Path(sys.argv[1]), workers=2))
"""


@pytest.mark.slow
def test_a_sweep_killed_at_random_moments_ends_with_the_same_table(tmp_path: Path) -> None:
    (tmp_path / "main.py").write_text(SCRIPT)
    paths = os.pathsep.join([str(Path(__file__).parent), *filter(None, sys.path)])
    command = [sys.executable, str(tmp_path / "main.py"), str(tmp_path / "killed")]
    environment = os.environ | {"PYTHONPATH": paths}
    rng = random.Random(7)
    runs, kept = tmp_path / "killed" / "runs", 0
    for _ in range(10):
        process = subprocess.Popen(command, env=environment)
        wanted = kept + rng.randint(1, 4)
        while len(list(runs.glob("*.json"))) < wanted:
            assert process.poll() is None
            time.sleep(0.02)
        time.sleep(rng.uniform(0.0, 0.3))
        process.send_signal(signal.SIGKILL)
        process.wait()
        assert len(list(runs.glob("*.json"))) >= wanted
        kept = len(list(runs.glob("*.json")))
    assert subprocess.run(command, env=environment, check=False).returncode == 0
    sweep(configs(60, "sleep 0.25"), settings(tmp_path / "calm", workers=2))
    assert table(tmp_path / "killed") == table(tmp_path / "calm")
    assert len(list((tmp_path / "killed" / "runs").iterdir())) == 60
    assert not list((tmp_path / "killed").rglob("*.part"))


def test_work_never_raises(tmp_path: Path) -> None:
    done = work(Job(RunConfig("SE1", start="bug")), STUB, tmp_path)
    assert done.row is not None
    assert done.row.status == "failed"
    assert not list(tmp_path.iterdir())
