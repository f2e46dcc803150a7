"""A tiny training: the loss falls, the same seed gives the same weights, the files describe it."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from semantics.dataset import DatasetConfig
from semantics.network import load
from semantics.train import TrainConfig, train


def _tiny(folder: Path) -> TrainConfig:
    return TrainConfig(
        dataset=DatasetConfig(layouts=10, views=1), epochs=4, batch=2, threads=1, folder=folder
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


def test_weights_say_what_they_are(tmp_path: Path) -> None:
    for path in train(_tiny(tmp_path)).files:
        _, checkpoint = load(path)
        assert checkpoint.network.relation == path.stem
        assert checkpoint.temperature > 0.0
        assert checkpoint.facts["seed"] == 0
