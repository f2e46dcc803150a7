"""The paper's training set: what is known of its figures, and labels that hold."""

from __future__ import annotations

import numpy as np

from semantics.dataset import Sample, labels_of, samples
from semantics.layouts import LayoutConfig
from semantics.proximity import PaperFeatures, proximity_graph


def _made(count: int, seed: int = 0, drop: float = 0.0) -> list[Sample]:
    return list(samples(LayoutConfig(layouts=count, drop=drop), np.random.SeedSequence(seed)))


def test_floors_are_as_many_and_as_full_as_the_papers() -> None:
    made = _made(60)
    assert 22.0 < np.mean([len(sample.pieces) for sample in made]) < 27.0
    graphs = [proximity_graph(sample.pieces, PaperFeatures()) for sample in made]
    labels = np.concatenate([labels_of(s, g.pairs) for s, g in zip(made, graphs, strict=True)])
    assert 0.15 < np.mean(labels == 1) < 0.25
    assert 0.03 < np.mean(labels == 2) < 0.07


def test_a_plane_is_as_long_as_its_own_side() -> None:
    for sample in _made(5):
        length = sample.pieces.length.reshape(-1, 4)
        across = np.linalg.norm(
            sample.pieces.centre.reshape(-1, 4, 2)[:, 0]
            - sample.pieces.centre.reshape(-1, 4, 2)[:, 2],
            axis=1,
        )
        assert np.allclose(length[:, 1], across, atol=0.05)


def test_all_normals_look_into_the_room_and_walls_are_thin() -> None:
    for sample in _made(5, seed=1):
        pieces = sample.pieces
        middle = pieces.centre.reshape(-1, 4, 2).mean(axis=1).repeat(4, axis=0)
        assert (np.einsum("mc,mc->m", middle - pieces.centre, pieces.normal) > 0.0).all()
        for a, b in sample.walls:
            depth = abs((pieces.centre[b] - pieces.centre[a]) @ pieces.normal[a])
            assert 0.0 < depth < 0.35


def test_planes_are_missing_as_often_as_asked() -> None:
    whole = sum(len(sample.pieces) for sample in _made(30))
    part = sum(len(sample.pieces) for sample in _made(30, drop=0.15))
    assert 0.80 < part / whole < 0.90
