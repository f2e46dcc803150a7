"""Where room edges go wrong: counted on samples whose probabilities are known."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import eval.studies.edgelimits
from eval.bench.semantics import room_map
from eval.studies.edgelimits import edge_limits
from semantics.dataset import Sample
from semantics.edges import Edges
from semantics.pieces import Pieces
from semantics.preprocess import Preprocessor

PAIRS = np.array([[0, 1], [2, 3], [0, 4], [4, 5], [1, 6]])
PROBABILITY = np.array([0.9, 0.2, 0.8, 0.6, 0.1])


class _Told:
    """Tells five pairs, whatever the pieces."""

    def __init__(self, weights: object):
        pass

    def __call__(self, pieces: Pieces) -> Edges:
        return Edges(PAIRS, PROBABILITY, np.zeros(len(PAIRS)))


def test_pairs_are_counted_by_what_was_seen_of_their_rooms(monkeypatch: pytest.MonkeyPatch) -> None:
    """Four sides of room 0; two of room 1; the rest is on furniture."""
    monkeypatch.setattr(eval.studies.edgelimits, "EdgeModel", _Told)
    pieces = Preprocessor()(room_map(8))
    room = np.array([0, 0, 0, 0, 1, 1, -1, -1])
    sample = Sample(pieces, pieces.plane_id, room, np.empty((0, 2), dtype=np.int64))
    every, seen, long, glimpsed = edge_limits((Path("none"),), [sample, sample])
    assert (every.true, every.wrong) == (6, 4)  # 2-3 is missed, 0-4 is wrong; twice
    assert (every.precision, every.recall) == pytest.approx((2 / 3, 2 / 3))
    assert every.expected == pytest.approx(2 * (0.1 + 0.2 + 0.2 + 0.4 + 0.1))
    assert (seen.true, seen.wrong, seen.precision, seen.recall) == (4, 2, 1.0, 0.5)
    assert long.true == seen.true
    assert (glimpsed.true, glimpsed.precision, glimpsed.recall) == (2, 0.5, 1.0)
