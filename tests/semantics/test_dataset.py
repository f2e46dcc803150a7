"""The training set: the same from one seed, and labels that hold by construction."""

from __future__ import annotations

import numpy as np

from semantics.dataset import DatasetConfig, Sample, samples

FEW = DatasetConfig(layouts=6, views=2)


def _made(seed: int) -> list[Sample]:
    return list(samples(FEW, np.random.SeedSequence(seed), "invariant"))


def test_one_seed_one_set() -> None:
    first, second = _made(3), _made(3)
    assert len(first) == len(second) > 0
    for a, b in zip(first, second, strict=True):
        assert np.array_equal(a.graph.edge, b.graph.edge)
        assert np.array_equal(a.same_room, b.same_room)
        assert np.array_equal(a.same_wall, b.same_wall)
    other = _made(4)
    assert any(len(a.pieces) != len(b.pieces) for a, b in zip(first, other, strict=False))


def test_labels_follow_rooms_and_faces() -> None:
    for sample in _made(5):
        i, j = sample.graph.pairs.T
        room = sample.room
        assert np.array_equal(sample.same_room, (room[i] == room[j]) & (room[i] >= 0))
        assert not sample.same_wall[(sample.face[i] < 0) | (sample.face[j] < 0)].any()


def test_the_two_faces_of_a_wall_look_away_from_each_other() -> None:
    walls = 0
    for sample in _made(6):
        pieces = sample.pieces
        for i, j in sample.graph.pairs[sample.same_wall]:
            walls += 1
            assert pieces.normal[i] @ pieces.normal[j] < -0.95
            away = (pieces.centre[j] - pieces.centre[i]) @ pieces.normal[i]
            assert away < 0.1
    assert walls > 0


def test_features_are_finite() -> None:
    for sample in _made(7):
        assert np.isfinite(sample.graph.node).all()
        assert np.isfinite(sample.graph.edge).all()
