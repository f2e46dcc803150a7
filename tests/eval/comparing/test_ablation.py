"""Ablations: which runs a command means, what comes of their rows, and the report."""

from __future__ import annotations

import csv
import io
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from fakes import run_stub

from eval.cli import main
from eval.comparing.ablation import (
    PAPER_SCENES,
    PRESETS,
    Ablation,
    Variant,
    against_first,
    evaluate,
    variants_of,
)
from eval.comparing.forest import forest_png
from eval.comparing.tables import (
    CSV_COLUMNS,
    comparisons_csv,
    difference_sheet,
    latex,
    level_sheet,
    markdown,
    signed,
)
from eval.config import FACTORS, RunConfig
from eval.detectors import DETECTORS
from eval.sweep.job import Row
from slam.core import InputError

LAYERS = variants_of({"layers": ["planes", "rooms", "rooms+walls"]})
PAIRS = (*against_first(LAYERS), ("rooms+walls", "rooms"))


def ablation(**known: object) -> Ablation:
    usual: dict[str, object] = {
        "variants": LAYERS,
        "pairs": PAIRS,
        "scenes": ("SE1", "SE2"),
        "seeds": tuple(range(6)),
        "metrics": ("ate_m", "rooms.recall"),
    }
    return Ablation(**(usual | known))  # type: ignore[arg-type]


def rows_of(asked: Ablation) -> list[Row]:
    return [Row(c, "complete", None, 1.0, run_stub(c)) for c in asked.configs]


# --- what is run ----------------------------------------------------------------------------------


def test_variants_are_all_combinations_named_by_what_differs() -> None:
    assert [variant.name for variant in LAYERS] == ["planes", "rooms", "rooms+walls"]
    two = variants_of({"detector": ["none", "gnn"], "layers": ["planes", "rooms"], "loops": ["on"]})
    assert [v.name for v in two] == ["none, planes", "none, rooms", "gnn, planes", "gnn, rooms"]
    assert two[1].of(RunConfig("SE1")) == RunConfig("SE1", detector="none", layers="rooms")
    assert [v.name for v in variants_of({"loops": ["on"]})] == ["on"]


def test_runs_come_seed_by_seed() -> None:
    configs = ablation(seeds=(3, 5)).configs
    assert [(c.seed, c.scene, c.layers) for c in configs[:4]] == [
        (3, "SE1", "planes"),
        (3, "SE1", "rooms"),
        (3, "SE1", "rooms+walls"),
        (3, "SE2", "planes"),
    ]
    assert len(set(configs)) == len(configs) == 12


@pytest.mark.parametrize(
    ("known", "said"),
    [
        ({"scenes": ()}, "scenes: expected at least one"),
        ({"seeds": ()}, "seeds: expected at least one"),
        ({"metrics": ("ate",)}, "did you mean 'ate_m'"),
        ({"scenes": ("SE1", "SE1")}, "scenes: expected different"),
        ({"pairs": (("rooms", "walls"),)}, "pairs: unknown name 'walls'"),
        ({"variants": (Variant("a", ()), Variant("a", ()))}, "variants: expected different"),
    ],
)
def test_an_ablation_without_sense_is_refused(known: dict[str, object], said: str) -> None:
    with pytest.raises((InputError), match=said):
        ablation(**known)


def test_the_papers_preset_is_its_tables() -> None:
    variants, pairs, scenes, seeds = PRESETS["paper"]
    assert scenes == PAPER_SCENES
    assert len(seeds) == 10
    names = {variant.name for variant in variants}
    assert {name for pair in pairs for name in pair} == names
    said = [dict(variant.fields) for variant in variants]
    assert {"detector": "sgraphs", "layers": "rooms", "factors": "paper"} in said
    needed = {"detector": DETECTORS, "factors": FACTORS}
    for name, known in needed.items():
        if missing := {fields[name] for fields in said} - set(known):
            pytest.skip(f"{name} {', '.join(missing)}: not there yet")
    assert all(variant.of(RunConfig("SE1")) for variant in variants)


# --- what comes of it -----------------------------------------------------------------------------


def test_levels_and_differences_are_those_of_the_runs() -> None:
    asked = ablation()
    result = evaluate(asked, rows_of(asked))
    values = {
        layers: np.array([run_stub(c).ate_m for c in asked.configs if c.layers == layers])
        for layers in ("planes", "rooms", "rooms+walls")
    }
    assert result.level("rooms", "ate_m").overall == pytest.approx(values["rooms"].mean())
    found = {(c.variant, c.against): c for c in result.comparisons if c.metric == "ate_m"}
    pair = found["rooms", "planes"].difference
    assert pair is not None
    assert pair.mean == pytest.approx((values["rooms"] - values["planes"]).mean())
    assert pair.interval is not None
    assert pair.interval.clear_of_zero
    adjusted = found["rooms", "planes"].p_holm
    assert adjusted is not None
    assert pair.p_rank is not None
    assert adjusted >= pair.p_rank


def test_rows_may_come_from_any_order_of_work_but_not_of_configs() -> None:
    asked = ablation()
    rows = rows_of(asked)
    assert evaluate(asked, rows).comparisons == evaluate(asked, list(rows)).comparisons
    with pytest.raises(ValueError, match="zip"):
        evaluate(asked, rows[:-1])


def test_failed_runs_are_counted_and_their_pairs_left_out() -> None:
    asked = ablation()
    rows = [
        replace(row, status="failed", error="so") if row.config.layers == "rooms" and i < 6 else row
        for i, row in enumerate(rows_of(asked))
    ]
    result = evaluate(asked, rows)
    assert result.level("rooms", "ate_m").failed == 2
    lost = {(c.variant, c.against): c.lost for c in result.comparisons if c.metric == "ate_m"}
    assert lost == {
        ("rooms", "planes"): 2,
        ("rooms+walls", "planes"): 0,
        ("rooms+walls", "rooms"): 2,
    }
    table = difference_sheet(result)
    assert table.rows[0][-1] == "10 (2 lost)"


def test_a_metric_that_no_run_has_gives_no_pairs() -> None:
    asked = ablation(metrics=("plane_rmse_m",))
    result = evaluate(asked, rows_of(asked))
    assert all(c.difference is None and c.lost == 12 for c in result.comparisons)
    assert difference_sheet(result).rows[0][3] == "-"
    assert forest_png(result).startswith(b"\x89PNG")


# --- the report -----------------------------------------------------------------------------------


def test_the_tables_hold_one_thing_in_every_form() -> None:
    asked = ablation()
    result = evaluate(asked, rows_of(asked))
    sheets = [level_sheet(result, "ate_m"), difference_sheet(result)]
    text = markdown(sheets)
    rows = [line.split("|") for line in text.splitlines() if line.startswith("|")]
    assert {len(row) for row in rows} == {len(sheets[0].head) + 2, len(sheets[1].head) + 2}
    tex = latex(sheets)
    assert tex.count(r"\begin{tabular}") == tex.count(r"\end{tabular}") == 2
    assert "rooms.recall" in tex
    assert r"ate\_m" in tex
    assert "_m" not in tex.replace(r"\_m", "")
    read = list(csv.DictReader(io.StringIO(comparisons_csv(result))))
    assert tuple(read[0]) == CSV_COLUMNS
    assert len(read) == len(result.comparisons)
    first = result.comparisons[0].difference
    assert first is not None
    assert float(read[0]["difference"]) == first.mean
    assert sheets[1].rows[0][3] == signed(first.mean, 100.0)


def test_signs_are_always_shown() -> None:
    assert signed(0.5) == "+0.500"
    assert signed(-0.5) == "\N{MINUS SIGN}0.500"
    assert signed(-1e-9) == "0.000"
    assert signed(None) == "-"


# --- the command ----------------------------------------------------------------------------------


@pytest.fixture
def asked(monkeypatch: pytest.MonkeyPatch) -> list[RunConfig]:
    """Puts rows of the stub in the place of a sweep; the runs that were asked for."""
    seen: list[RunConfig] = []

    def sweep(configs: Sequence[RunConfig], settings: object, watch: object) -> tuple[Row, ...]:
        seen.extend(configs)
        return tuple(Row(c, "complete", None, 1.0, run_stub(c)) for c in configs)

    monkeypatch.setattr("eval.sweep.engine.sweep", sweep)
    return seen


def test_the_command_leaves_its_report(
    asked: list[RunConfig], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "out"
    out.mkdir()
    options = [
        "--layers",
        "planes,rooms",
        "--seeds",
        "0-3",
        "--metrics",
        "ate_m",
        "--duration",
        "9",
    ]
    assert main(["ablate", *options, "--out", str(out)]) == 0
    assert [(c.seed, c.layers, c.duration) for c in asked[:3]] == [
        (0, "planes", 9.0),
        (0, "rooms", 9.0),
        (1, "planes", 9.0),
    ]
    assert {c.cache for c in asked} == {out / "front-ends"}
    files = {path.name for path in out.iterdir()}
    assert files == {"ablation.md", "ablation.tex", "ablation.csv", "ablation.png"}
    assert "rooms" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("options", "said"),
    [
        (["--seeds", "a"], "seeds: expected"),
        (["--layers", "planes,planes"], "layers: expected different values"),
        (["--layers", "plane"], "did you mean 'planes'"),
        (["--detector", "absent.module:Class"], "importing absent.module failed"),
        (["--scenes", "SE0"], "SE1"),
        (["--sensor", "vlp61"], "vlp16"),
        (["--conditions", "idol"], "ideal"),
        (["--metrics", "ate"], "did you mean 'ate_m'"),
        (["--preset", "papr"], "did you mean 'paper'"),
        (["--preset", "paper", "--layers", "planes,rooms"], "expected one value beside --preset"),
        (["--workers", "0"], "workers: expected 1 or more"),
        (["--workers", "1", "--cluster", "tcp://x"], "got both"),
    ],
)
def test_bad_input_is_one_line_before_anything_runs(
    asked: list[RunConfig],
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
    options: list[str],
    said: str,
) -> None:
    monkeypatch.chdir(tmp_path)
    assert main(["ablate", *options]) == 2
    err = capsys.readouterr().err
    assert said in err
    assert err.count("\n") == 1
    assert not asked
    assert not list(tmp_path.iterdir())
