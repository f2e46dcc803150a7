"""Truths that take in what was seen, in one call."""

from __future__ import annotations

import numpy as np

from eval.labels import TruthKeeper
from eval.seen import SeenFaces
from sim.truth import ScanTruth
from slam.core import Array, IntArray, Scan
from worlds.truth import Truth


def keep(
    keeper: TruthKeeper,
    scan: Scan,
    truth: ScanTruth,
    keyframe: bool,
    point_index: IntArray | None = None,
) -> None:
    """The keeper takes in a scan's truth."""
    keeper.add(keeper.digest(scan, truth, keyframe, point_index))


def see(seen: SeenFaces, truth: Truth, face: int, along: Array, stamp: float = 0.0) -> None:
    """Returns from a metre away, at places (N,) along a face [m]."""
    start, end = truth.faces[face].segment
    ground = start + along[:, None] * (end - start) / np.linalg.norm(end - start)
    points = np.column_stack([ground, np.ones(len(along))])
    labels, ranges = np.full(len(along), face, np.int32), np.ones(len(along))
    seen.apply(seen.digest(labels, points, ranges), stamp)
