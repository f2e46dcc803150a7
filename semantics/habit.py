"""What was one room a moment ago needs less evidence to be one again; two rooms need more."""

from __future__ import annotations

import numpy as np

from semantics.clusters import Clusters
from semantics.edges import Edges
from semantics.names import earlier
from semantics.pieces import Pieces, joined
from slam.core import Array


class Habit:
    """Remembers which pieces were in one cluster, and leans to that by so many log-odds."""

    def __init__(self, strength: float):
        self._strength = strength
        self._pieces = joined([])
        self._label = np.full(1, -1, dtype=np.int64)

    def lean(self, pieces: Pieces, edges: Edges) -> Array:
        """(P,) probabilities of the room relation, with the memory of last time."""
        label = self._label[earlier(self._pieces, pieces)]
        first, second = label[edges.pairs[:, 0]], label[edges.pairs[:, 1]]
        known = (first >= 0) & (second >= 0)
        lean = np.where(known, np.where(first == second, 1.0, -1.0), 0.0) * self._strength
        odds = edges.room / np.maximum(1.0 - edges.room, 1e-12) * np.exp(lean)
        return np.asarray(odds / (1.0 + odds))

    def remember(self, pieces: Pieces, clusters: Clusters) -> None:
        """Pieces alone are in no cluster."""
        size = np.bincount(clusters.label[clusters.label >= 0], minlength=1)
        together = (clusters.label >= 0) & (size[clusters.label] > 2)
        self._pieces = pieces
        self._label = np.append(np.where(together, clusters.label, -1), -1)
