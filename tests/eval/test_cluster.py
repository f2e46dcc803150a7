"""A sweep on a Dask cluster of this machine: scheduler and two workers on the loopback address."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from types import SimpleNamespace

import pytest
from fakes import run_stub

from eval.config import RunConfig
from eval.sweep.cluster import DaskWorkers, _check_workers
from eval.sweep.engine import SweepConfig, sweep
from eval.sweep.job import Job
from slam.core import InputError

distributed = pytest.importorskip("distributed", reason="Dask is not installed")


@pytest.fixture(scope="module")
def address() -> Iterator[str]:
    with distributed.LocalCluster(
        n_workers=2, threads_per_worker=1, dashboard_address=None, host="127.0.0.1"
    ) as cluster:
        yield cluster.scheduler_address


def on(address: str, folder: Path) -> SweepConfig:
    return SweepConfig(folder, cluster=address, runner="fakes:run_stub")


def configs(count: int, start: str | None = None, cache: Path | None = None) -> list[RunConfig]:
    return [RunConfig("SE1", seed=seed, start=start, cache=cache) for seed in range(count)]


def test_a_cluster_gives_the_same_rows_as_local_workers(address: str, tmp_path: Path) -> None:
    rows = sweep([*configs(4), *configs(1, "fail")], on(address, tmp_path / "out"))
    assert [row.status for row in rows] == ["complete"] * 4 + ["failed"]
    assert [row.metrics for row in rows[:4]] == [run_stub(config) for config in configs(4)]
    local = SweepConfig(tmp_path / "local", workers=1, runner="fakes:run_stub")
    sweep([*configs(4), *configs(1, "fail")], local)
    tables = [(tmp_path / name / "table.csv").read_text() for name in ("out", "local")]
    assert tables[0] == tables[1]


def test_a_worker_that_dies_loses_only_its_run(address: str, tmp_path: Path) -> None:
    (tmp_path / "memory").mkdir()
    asked = [*configs(2, "crash once", tmp_path / "memory" / "cache"), *configs(2)]
    rows = sweep(asked, on(address, tmp_path / "out"))
    assert [row.status for row in rows] == ["complete"] * 4
    assert len(list((tmp_path / "memory").glob("crashed-*"))) == 2


def test_a_run_that_the_scheduler_gives_up_is_tried_again(address: str) -> None:
    workers = DaskWorkers(address, "fakes:run_stub")
    job = Job(RunConfig("SE1"))
    workers.give(job)
    for future in workers._jobs:
        future.cancel()
    assert [(done.job, done.row) for done in workers.wait()] == [(job, None)]
    workers.close()


@pytest.mark.parametrize("wrong", ["tcp://127.0.0.1:9", "nowhere"])
def test_a_cluster_that_cannot_be_reached_is_said(
    wrong: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("eval.sweep.cluster.TIMEOUT", 1.0)
    with pytest.raises(InputError, match=f"cluster: {wrong} cannot be reached"):
        sweep(configs(1), on(wrong, tmp_path / "out"))
    assert not (tmp_path / "out").exists()


def test_a_cluster_without_workers_is_said(tmp_path: Path) -> None:
    with (
        distributed.LocalCluster(n_workers=0, dashboard_address=None, host="127.0.0.1") as empty,
        pytest.raises(InputError, match="has no workers"),
    ):
        sweep(configs(1), on(empty.scheduler_address, tmp_path / "out"))


def test_workers_with_other_code_are_refused() -> None:
    client = SimpleNamespace(nthreads=lambda: {"tcp://w": 1}, run=lambda _: {"tcp://w": "other"})
    with pytest.raises(InputError, match="worker tcp://w has another version"):
        _check_workers(client, "tcp://s")
