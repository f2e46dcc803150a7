"""Where the room relation is told wrong: by how much was seen of the rooms."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from semantics.clusters import ClusterConfig, is_room
from semantics.dataset import SAME_ROOM, Sample, labels_of
from semantics.edges import EdgeModel
from slam.core import Array, IntArray

LONG = 0.8
"""A piece longer than this is not short [m]."""


@dataclass(frozen=True)
class EdgeLimit:
    """Room edges among some pairs of pieces: how many are true, their precision and recall (where
    likelier than not), how many are told wrong, and how many the probabilities expect to be."""

    of: str
    true: int
    precision: float
    recall: float
    wrong: int
    expected: float


def edge_limits(weights: Sequence[Path], drawn: Sequence[Sample]) -> list[EdgeLimit]:
    """Of all pairs, and of some kinds of them, over all samples."""
    model = EdgeModel(weights)
    told, true, known, length = [], [], [], []
    for sample in drawn:
        edges = model(sample.pieces)
        told.append(edges.room)
        true.append(labels_of(sample, edges.pairs) == SAME_ROOM)
        known.append(_known(sample)[edges.pairs].min(axis=1))
        length.append(sample.pieces.length[edges.pairs].min(axis=1))
    probability, label = np.concatenate(told), np.concatenate(true)
    seen, least = np.concatenate(known), np.concatenate(length)
    kinds = {
        "all": np.ones(len(label), dtype=bool),
        "both of rooms seen well enough": seen == ENOUGH,
        f"and both longer than {LONG} m": (seen == ENOUGH) & (least >= LONG),
        "one of a room only glimpsed": seen == GLIMPSED,
    }
    return [_limit(name, probability[some], label[some]) for name, some in kinds.items()]


NOWHERE, GLIMPSED, ENOUGH = 0, 1, 2
"""How much was seen of a piece's room: it is in none; its pieces would make no room; they would."""


def _known(sample: Sample) -> IntArray:
    """(M,) of each piece."""
    known = np.full(len(sample.pieces), NOWHERE, dtype=np.int64)
    for room in np.unique(sample.room[sample.room >= 0]).tolist():
        mine = sample.room == room
        whole = is_room(sample.pieces.take(mine), ClusterConfig())
        known[mine] = ENOUGH if whole else GLIMPSED
    return known


def _limit(of: str, probability: Array, true: NDArray[np.bool_]) -> EdgeLimit:
    found = probability > 0.5
    right = int((found & true).sum())
    return EdgeLimit(
        of,
        true=int(true.sum()),
        precision=right / max(int(found.sum()), 1),
        recall=right / max(int(true.sum()), 1),
        wrong=int((found != true).sum()),
        expected=float(np.minimum(probability, 1.0 - probability).sum()),
    )
