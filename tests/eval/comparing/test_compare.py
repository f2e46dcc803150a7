"""The gate: it stays open under noise, closes on a regression, and says what it cannot judge."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from fakes import metrics_of, run_stub

from eval.cli import main
from eval.comparing.compare import compare, read_results
from eval.config import RunConfig
from eval.folder import claim_folder
from eval.metrics import Metrics, Rooms
from eval.outputs import write_metrics
from eval.sweep.engine import SweepConfig, sweep
from eval.sweep.job import Row
from slam.core import InputError

Make = Callable[[int, int], float | None]


def rows(ate: Make, seeds: range = range(6), scenes: int = 2, **known: object) -> list[Row]:
    """Runs whose ATE is a function of scene and seed."""
    made = []
    for scene in range(scenes):
        for seed in seeds:
            config = RunConfig(f"plan{scene}.json", seed=seed, **known)  # type: ignore[arg-type]
            metrics = metrics_of(config, ate_m=ate(scene, seed), rooms=Rooms(recall=0.9))
            made.append(Row(config, "complete", None, 1.0, metrics))
    return made


def noisy(shift: float, noise: float, seed: int = 0) -> Make:
    """ATE that differs much between seeds, shifted, with a little noise of its own."""
    rng = np.random.default_rng(seed)

    def ate(scene: int, run: int) -> float:
        return 0.02 + 0.01 * scene + 0.003 * run + shift + noise * float(rng.normal())

    return ate


def verdicts(a: list[Row], b: list[Row]) -> dict[str, str]:
    return {c.metric: c.verdict for c in compare(a, b, ("ate_m", "rooms.recall")).changes}


def test_what_moves_beyond_noise_is_found() -> None:
    before = rows(noisy(0.0, 1e-4))
    assert verdicts(before, rows(noisy(0.002, 1e-4, 1))) == {
        "ate_m": "worse",
        "rooms.recall": "same",
    }
    assert verdicts(before, rows(noisy(-0.002, 1e-4, 1)))["ate_m"] == "better"
    assert verdicts(before, before) == {"ate_m": "same", "rooms.recall": "same"}


def test_noise_alone_seldom_closes_the_gate() -> None:
    worse = 0
    for seed in range(40):
        a, b = rows(noisy(0.0, 1e-3, 2 * seed + 1)), rows(noisy(0.0, 1e-3, 2 * seed + 2))
        worse += verdicts(a, b)["ate_m"] == "worse"
    assert worse <= 4


def test_what_is_sure_but_small_does_not_matter() -> None:
    assert verdicts(rows(noisy(0.0, 0.0)), rows(noisy(1e-5, 0.0)))["ate_m"] == "same"


def test_a_value_that_is_gone_is_a_regression() -> None:
    before = rows(noisy(0.0, 1e-4))
    gone = rows(lambda scene, seed: None if seed == 2 else 0.02)
    change = compare(before, gone, ("ate_m",)).changes[0]
    assert (change.verdict, change.lost) == ("worse", 2)
    failed = [replace(row, status="failed") if row.config.seed == 1 else row for row in before]
    assert compare(before, failed, ("ate_m",)).changes[0].verdict == "worse"
    assert compare(failed, before, ("ate_m",)).changes[0].verdict == "same"


def test_other_seeds_are_compared_without_pairs() -> None:
    before, after = rows(noisy(0.0, 1e-4)), rows(noisy(0.05, 1e-4), range(10, 16))
    change = compare(before, after, ("ate_m",)).changes[0]
    assert not change.is_paired
    assert change.verdict == "worse"


def test_variants_are_compared_each_with_itself() -> None:
    before = rows(noisy(0.0, 1e-4)) + rows(noisy(0.01, 1e-4), layers="planes")
    after = rows(noisy(0.0, 1e-4, 1)) + rows(noisy(0.02, 1e-4, 1), layers="planes")
    found = {c.group: c.verdict for c in compare(before, after, ("ate_m",)).changes}
    assert found == {"rooms+walls": "same", "planes": "worse"}
    # One variant a side: that is what the user wants to compare.
    other = rows(noisy(0.01, 1e-4), detector="oracle")
    assert compare(rows(noisy(0.0, 1e-4)), other, ("ate_m",)).changes[0].verdict == "worse"


@pytest.mark.parametrize(
    ("a", "b", "said"),
    [
        (rows(noisy(0, 1e-4)), rows(noisy(0, 1e-4), conditions="ideal"), "no variant in common"),
        (rows(noisy(0, 1e-4), range(1)), rows(noisy(1, 1e-4), range(1)), "at least two seeds"),
        (
            rows(noisy(0, 1e-4), scenes=1),
            [replace(r, config=replace(r.config, scene="x")) for r in rows(noisy(0, 1e-4))],
            "no scene in common",
        ),
    ],
)
def test_what_cannot_be_compared_is_said(a: list[Row], b: list[Row], said: str) -> None:
    with pytest.raises(InputError, match=said):
        compare(a, b, ("ate_m",))


# --- files ----------------------------------------------------------------------------------------


def write_run(folder: Path, seed: int, shift: float) -> Metrics:
    config = RunConfig("SE1", seed=seed, out=folder / f"s{seed}", duration=5.0)
    metrics = replace(run_stub(config), ate_m=0.02 + 0.001 * seed + shift)
    write_metrics(metrics, claim_folder(config) / "metrics.json")
    return metrics


def test_the_command_is_a_gate(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    for seed in range(4):
        write_run(tmp_path / "a", seed, 0.0)
        write_run(tmp_path / "b", seed, 0.01 + 1e-5 * seed)
    a, b, table = tmp_path / "a", tmp_path / "b", tmp_path / "table.md"
    assert main(["compare", str(a), str(b), "--markdown", str(table)]) == 1
    out, err = capsys.readouterr()
    assert err == "roomloop: worse: ate_m: 0.0215 became 0.031515\n"
    assert "worse" in out
    assert "| worse |" in table.read_text()
    assert main(["compare", str(b), str(a)]) == 0
    assert main(["compare", str(a), str(b), "--metrics", "rooms.recall"]) == 0


def test_a_sweep_is_read_as_it_was_asked(tmp_path: Path) -> None:
    settings = SweepConfig(tmp_path / "out", workers=1, runner="fakes:run_stub")
    sweep([RunConfig("SE1", seed=seed) for seed in range(3)], settings)
    rows = sweep([RunConfig("SE1", seed=seed) for seed in range(2)], settings)
    assert read_results(tmp_path / "out") == rows


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["absent", "."], "absent: expected a folder with results"),
        ([".", "."], "found no results"),
        ([".", ".", "--metrics", "ate"], "did you mean 'ate_m'"),
        ([".", ".", "--tolerance", "-1"], "tolerance: expected percent"),
    ],
)
def test_bad_input_is_one_line(
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
    arguments: list[str],
    said: str,
) -> None:
    monkeypatch.chdir(tmp_path)
    assert main(["compare", *arguments]) == 2
    err = capsys.readouterr().err
    assert said in err
    assert err.count("\n") == 1
