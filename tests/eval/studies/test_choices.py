"""What the study counts, on a map that is known to the last piece."""

from __future__ import annotations

import csv
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from rich.console import Console

import eval.studies.choices
from eval.bench.semantics import room_map
from eval.studies.choices import (
    VIEWS,
    Operating,
    Result,
    Row,
    StudyConfig,
    _rooms,
    _walls,
    on_plans,
    study,
    write_study,
)
from eval.studies.tables import STUDIED, TRAINED, concepts_table, edges_table, thresholds_table
from semantics.dataset import DatasetConfig, Sample
from semantics.detector import CONSERVATIVE
from semantics.preprocess import Preprocessor
from worlds.generator import GeneratorConfig, random_plan

GROUPS = [np.arange(k, k + 4) for k in range(0, 16, 4)]


def _sample() -> Sample:
    """Four rooms of four faces; the wall between the first two, and between the first and third."""
    pieces = Preprocessor()(room_map(16))
    face = pieces.plane_id
    return Sample(pieces, face, face // 4, np.array([[2, 4], [1, 11]]))


def test_all_rooms_found_and_none_too_many() -> None:
    assert _rooms(_sample(), GROUPS, CONSERVATIVE) == (4, 4, 4)


def test_a_room_that_is_missed_a_room_that_is_two_and_two_that_are_one() -> None:
    assert _rooms(_sample(), GROUPS[1:], CONSERVATIVE) == (3, 3, 4)
    both = np.concatenate(GROUPS[:2])
    assert _rooms(_sample(), [both, *GROUPS[2:]], CONSERVATIVE) == (2, 3, 4)
    mixed = np.array([0, 1, 2, 7])
    assert _rooms(_sample(), [mixed, *GROUPS[1:]], CONSERVATIVE) == (4, 4, 4)


def test_walls_count_once_and_by_their_faces() -> None:
    assert _walls(_sample(), np.array([[2, 4], [11, 1], [5, 9]])) == (2, 3, 2)
    assert _walls(_sample(), np.zeros((0, 2), dtype=np.int64)) == (0, 0, 2)


def test_the_table_is_a_csv_with_a_line_for_each_row(tmp_path: Path) -> None:
    rows = [Row("paper", "two", "ours", "cycles", "sheared", Result(*np.linspace(0.0, 0.9, 10)))]
    with write_study(rows, tmp_path / "study.csv").open(encoding="utf-8") as stream:
        (line,) = csv.DictReader(stream)
    assert (line["features"], line["family"]) == ("paper", "sheared")
    assert float(line["room_edge_recall"]) == pytest.approx(0.1)


def test_each_row_of_a_table_is_one_line_of_eighty_columns() -> None:
    results = [Result(*np.linspace(0.0, 0.9, 10)), Result(*np.linspace(0.05, 0.95, 10))]
    rows = [
        Row("invariant", "two", "paper", clustering, family, result)
        for family, result in zip(("right-angled", "sheared"), results, strict=True)
        for clustering in ("cycles", "linkage")
    ]
    for table, lines in (
        (edges_table(rows, TRAINED), 2),  # clustering makes no edges
        (concepts_table(rows, STUDIED), 4),
        (thresholds_table([Operating(0.5, 0.9, 0.8, 0.7, 0.6)]), 1),
    ):
        with (console := Console(width=80)).capture() as printed:
            console.print(table)
        head, *body = printed.get().splitlines()[1:]
        assert len(body) == lines
        assert "P     R" in head
        assert "\N{HORIZONTAL ELLIPSIS}" not in printed.get()


def test_a_plan_is_seen_on_several_walks_the_same_each_time() -> None:
    plan = random_plan(np.random.default_rng(4), GeneratorConfig(kinds=("cluster",)))
    once, again = (on_plans({"hut": plan})["hut"] for _ in range(2))
    assert len(once) == VIEWS
    for one, other in zip(once, again, strict=True):
        np.testing.assert_array_equal(one.pieces.segment, other.pieces.segment)
    assert len({len(sample.pieces) for sample in once}) > 1
    rooms = set(range(len(plan.storeys[0].rooms)))
    assert rooms == {room for s in once for room in s.room.tolist() if room >= 0}


@pytest.mark.slow
def test_every_combination_is_tried(monkeypatch: pytest.MonkeyPatch) -> None:
    few = {
        name: replace(family, layouts=2, views=1)
        for name, family in eval.studies.choices.FAMILIES.items()
        if isinstance(family, DatasetConfig)
    }
    monkeypatch.setattr(eval.studies.choices, "FAMILIES", few)
    told: list[float] = []
    config = StudyConfig(layouts=10, epochs=1, processes=1)
    rows = study(config, lambda _, share: told.append(share))
    assert (
        len(rows)
        == len({(r.features, r.networks, r.training_set, r.clustering, r.family) for r in rows})
        == 64
    )
    assert told == sorted(told)
