"""A tiny training: the loss falls, the same seed gives the same weights, the files describe it."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import torch

from semantics.dataset import DatasetConfig
from semantics.layouts import LayoutConfig
from semantics.network import load
from semantics.train import OURS, PAPER, TrainConfig, draw, preset_named, score_relation, train
from slam.core import InputError


def _tiny(folder: Path, config: TrainConfig = OURS) -> TrainConfig:
    return replace(
        config,
        dataset=DatasetConfig(layouts=8, views=1, conditions=(("as-built", 1.0),)),
        epochs=4,
        batch=2,
        processes=1,
        threads=1,
        folder=folder,
    )


def test_the_loss_falls_and_progress_ends_at_one(tmp_path: Path) -> None:
    told: list[float] = []
    result = train(_tiny(tmp_path), lambda what, share: told.append(share))
    for curve in result.curves:
        assert curve.loss[-1] < 0.8 * curve.loss[0]
        assert curve.validation_loss[curve.best] == min(curve.validation_loss)
    assert told == sorted(told)
    assert told[-1] == 1.0


def test_one_seed_one_network(tmp_path: Path) -> None:
    first, second = train(_tiny(tmp_path / "a")), train(_tiny(tmp_path / "b"))
    for one, other in zip(first.files, second.files, strict=True):
        with np.load(one) as a, np.load(other) as b:
            assert a.files == b.files
            assert all(np.array_equal(a[name], b[name]) for name in a.files)


def test_the_papers_networks_are_two_and_say_what_they_are(tmp_path: Path) -> None:
    config = replace(_tiny(tmp_path, PAPER), dataset=LayoutConfig(layouts=12))
    result = train(config)
    assert [path.stem for path in result.files] == ["paper_same_room", "paper_same_wall"]
    for path in result.files:
        model, checkpoint = load(path)
        assert checkpoint.network.relations == (path.stem.removeprefix("paper_"),)
        assert checkpoint.network.features == "paper"
        assert checkpoint.temperature > 0.0
        assert checkpoint.facts["seed"] == 0
        assert sum(p.numel() for p in model.parameters() if p.dtype == torch.float32) < 70_000


@pytest.mark.slow
def test_as_many_processes_as_one_likes_draw_the_same() -> None:
    config = LayoutConfig(layouts=16)
    one, two = draw(config, 3, 1), draw(config, 3, 2)
    for a, b in zip(one, two, strict=True):
        assert np.array_equal(a[0].pieces.segment, b[0].pieces.segment)


def test_a_relation_is_scored_by_hand() -> None:
    score = score_relation(np.array([0.9, 0.9, 0.1, 0.1]), np.array([True, False, True, False]))
    assert (score.precision, score.recall) == (0.5, 0.5)
    assert score.calibration == pytest.approx(0.4)


def test_unknown_presets_are_refused() -> None:
    with pytest.raises(InputError, match="expected one of ours, paper"):
        preset_named("theirs")
