"""The training set: the same from one seed, and labels that hold by construction."""

from __future__ import annotations

import numpy as np

from semantics.dataset import SAME_ROOM, SAME_WALL, DatasetConfig, Sample, labels_of, samples
from semantics.proximity import InvariantFeatures, closest_segments, proximity_graph

FEW = DatasetConfig(layouts=4, views=1)


def _made(seed: int) -> list[Sample]:
    return list(samples(FEW, np.random.SeedSequence(seed)))


def test_one_seed_one_set() -> None:
    first, second = _made(3), _made(3)
    assert len(first) == len(second) == 4
    for a, b in zip(first, second, strict=True):
        assert np.array_equal(a.pieces.segment, b.pieces.segment)
        assert np.array_equal(a.face, b.face)
    other = _made(4)
    assert any(len(a.pieces) != len(b.pieces) for a, b in zip(first, other, strict=False))


def test_labels_follow_rooms_and_faces() -> None:
    walls = 0
    for sample in _made(5):
        i, j, _ = closest_segments(sample.pieces, 15)
        label = labels_of(sample, np.column_stack([i, j]))
        room = sample.room
        assert np.array_equal(label == SAME_ROOM, (room[i] == room[j]) & (room[i] >= 0))
        assert not (label[(sample.face[i] < 0) | (sample.face[j] < 0)] == SAME_WALL).any()
        wall = label == SAME_WALL
        walls += int(wall.sum())
        normal = sample.pieces.normal
        away = sample.pieces.centre[j] - sample.pieces.centre[i]
        assert (np.einsum("pc,pc->p", normal[i], normal[j])[wall] < -0.9).all()
        assert (np.einsum("pc,pc->p", away, normal[i])[wall] < 0.2).all()
    assert walls > 0


def test_features_are_finite() -> None:
    for sample in _made(7):
        graph = proximity_graph(sample.pieces, InvariantFeatures())
        assert np.isfinite(graph.node).all()
        assert np.isfinite(graph.edge).all()


def test_a_window_may_end_where_a_slanted_corner_begins() -> None:
    # Drawn, once: the walls without their windows were sound as built, and with them crossed
    # each other.
    assert len(DatasetConfig().draw(np.random.SeedSequence(0, spawn_key=(1101,)))) == 3
