"""What ``semantics.network`` says of a graph, in numpy: all that a run needs of it.

Calls into torch cost more than the sums of graphs of a few hundred nodes, and its import a second.
Edges are taken in the order of their sources, so that what belongs to one node stands together.
Shapes as there: N nodes, E directed edges, C channels, H heads, R relations; all in float32.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from semantics.checkpoint import SLOPE, NetworkConfig, read
from semantics.proximity import ProximityGraph
from slam.core import Array, IntArray

HUB = 4
"""Edges of nodes are gone through slot by slot, an empty slot repeating one of them; but one by
one, which is slower, where one node has so many that the slots are this many times the edges."""
BLOCK = 128
"""Rows of a product, and"""
ALONE = 1 << 18
"""multiplications in it, up to which no library starts threads: those wait for each other, on a
busy machine, a thousand times as long as they work."""
F32 = NDArray[np.float32]
Weights = Mapping[str, NDArray]


class Forward:
    """A network that has been trained, which gives calibrated probabilities."""

    def __init__(self, weights: Weights, config: NetworkConfig, temperature: float = 1.0):
        self.config = config
        self._node, self._edge = _Scale(weights, "node_scale"), _Scale(weights, "edge_scale")
        self._hops = [
            _Hop(weights, f"hops.{place}", *sizes, config.heads)
            for place, sizes in enumerate(config.hop_sizes)
        ]
        self._first = _Triple.whole(weights, "first", config.channels, config.channels)
        self._second, self._third = _Linear(weights, "second"), _Linear(weights, "third")
        self._temperature = np.float32(temperature)

    @classmethod
    def load(cls, path: Path) -> Forward:
        """Raises InputError for a file that is no weights of ours."""
        arrays, checkpoint = read(path)
        weights = {name: array.astype(np.float32) for name, array in arrays.items()}
        return cls(weights, checkpoint.network, checkpoint.temperature)

    def __call__(self, graph: ProximityGraph) -> Array:
        """(E / 2, R) probability of each relation for each of ``graph.pairs``."""
        if len(graph.source) == 0:
            return np.zeros((0, len(self.config.relations)))
        ways = _Ways(graph.source, graph.target, len(graph.node))
        v = self._node(graph.node.astype(np.float32))
        e = self._edge(graph.edge.astype(np.float32).take(ways.order, axis=0))
        for hop in self._hops:
            v, e = hop(v, e, ways)
        hidden = _relu(self._first(v, e, ways))  # (E, hidden)
        hidden = np.float32(0.5) * (
            hidden.take(ways.there, axis=0) + hidden.take(ways.back, axis=0)
        )
        return self._calibrated(self._third(_relu(self._second(hidden))))

    def _calibrated(self, logits: F32) -> Array:
        rows = np.ascontiguousarray(logits.T) / self._temperature  # many long sums, no short ones
        share = np.exp(rows - rows.max(axis=0))
        return (share / share.sum(axis=0))[1:].T.astype(np.float64)


class _Ways:
    """Directed edges by their source. order: (E,) places in the graph; target: (E,); there, back:
    (E / 2,) where the two directions of each pair are."""

    def __init__(self, source: IntArray, target: IntArray, count: int):
        self.order = np.argsort(source.astype(np.min_scalar_type(count)), kind="stable")
        self.target = target.take(self.order)
        self._degree = np.bincount(source, minlength=count)
        self._joined = np.flatnonzero(self._degree)
        degree = self._degree[self._joined]
        self._first = np.cumsum(degree) - degree
        most = int(degree.max())
        self._slots = self._first + np.minimum(np.arange(most)[:, None], degree - 1)
        place = np.empty_like(self.order)
        place[self.order] = np.arange(len(self.order))
        self.there, self.back = place.reshape(2, -1)

    def of_source(self, values: F32) -> F32:
        """(N, .) -> (E, .)"""
        return np.repeat(values, self._degree, axis=0)

    def of_target(self, values: F32) -> F32:
        """(N, .) -> (E, .)"""
        return values.take(self.target, axis=0)

    def most(self, values: F32) -> F32:
        """(E, .) -> (N, .), the largest of all edges of a node; 0 for a node without edges."""
        if self._slots.size > HUB * len(values):
            return self._whole(np.maximum.reduceat(values, self._first, axis=0))
        return self._whole(values.take(self._slots, axis=0).max(axis=0))

    def total(self, values: F32) -> F32:
        """(E, .) -> (N, .), the sum over all edges of a node."""
        return self._whole(np.add.reduceat(values, self._first, axis=0))

    def _whole(self, found: F32) -> F32:
        if len(self._joined) == len(self._degree):
            return found
        whole = np.zeros((len(self._degree), found.shape[1]), dtype=np.float32)
        whole[self._joined] = found
        return whole


class _Scale:
    """``network.Standardise``"""

    def __init__(self, weights: Weights, name: str):
        self._mean, self._std = weights[f"{name}.mean"], weights[f"{name}.std"]

    def __call__(self, features: F32) -> F32:
        return (features - self._mean) / self._std


class _Linear:
    def __init__(self, weights: Weights, name: str):
        self._weight, self._bias = weights[f"{name}.weight"].T.copy(), weights[f"{name}.bias"]

    def __call__(self, x: F32) -> F32:
        return _product(x, self._weight) + self._bias


class _Triple:
    """``network.Triple``, of a part of [v_i, e_ij, v_j]."""

    def __init__(self, source: F32 | None, edge: F32, target: F32, bias: F32):
        self._source, self._edge, self._target, self._bias = source, edge, target, bias

    @classmethod
    def whole(cls, weights: Weights, name: str, node: int, edge: int) -> _Triple:
        """One of all three."""
        columns = weights[f"{name}.weight"].T
        source, middle, target = (part.copy() for part in np.split(columns, [node, node + edge]))
        return cls(source, middle, target, weights[f"{name}.bias"])

    @classmethod
    def ahead(cls, weights: Weights, name: str, edge: int) -> _Triple:
        """One of [e_ij, v_j]."""
        columns = weights[f"{name}.weight"].T
        return cls(None, columns[:edge].copy(), columns[edge:].copy(), weights[f"{name}.bias"])

    def __call__(self, v: F32, e: F32, ways: _Ways) -> F32:
        made = _product(e, self._edge)
        made += ways.of_target(_product(v, self._target) + self._bias)
        if self._source is not None:
            made += ways.of_source(_product(v, self._source))
        return made


class _Hop:
    """``network.Hop``; as the sum of a softmax is the same for all edges of a node, the largest
    message is divided by it instead of each."""

    def __init__(self, weights: Weights, hop: str, node: int, edge: int, heads: int):
        self._attend = _Triple.whole(weights, f"{hop}.attend", node, edge)
        self._message = _Triple.ahead(weights, f"{hop}.message", edge)
        self._edge = _Triple.whole(weights, f"{hop}.edge", node, edge)
        self._node = _Linear(weights, f"{hop}.node")
        score = weights[f"{hop}.score"]
        self._spread = np.repeat(np.eye(heads, dtype=np.float32), score.shape[1], axis=1)  # (H, C)
        self._score = (self._spread * score.ravel()).T.copy()  # (C, H)

    def __call__(self, v: F32, e: F32, ways: _Ways) -> tuple[F32, F32]:
        seen = self._attend(v, e, ways)  # (E, C)
        score = _product(np.maximum(seen, np.float32(SLOPE) * seen), self._score)  # (E, H)
        weight = np.exp(score - ways.of_source(ways.most(score)))  # (E, H)
        message = self._message(v, e, ways)
        message *= _product(weight, self._spread)  # (E, C)
        most = ways.most(message)  # (N, C)
        total = ways.total(weight)  # (N, H), at least 1 where there are edges
        most /= _product(np.maximum(total, np.float32(1.0)), self._spread)
        v_next = _relu(self._node(np.concatenate([v, most], axis=1)))
        return v_next, _relu(self._edge(v, e, ways))


def _product(x: F32, weight: F32) -> F32:
    """x @ weight, (., I) and (I, O)."""
    if x.size * weight.shape[1] <= ALONE:
        return x @ weight
    made = np.empty((len(x), weight.shape[1]), dtype=np.float32)
    whole = len(x) // BLOCK * BLOCK
    blocks = made[:whole].reshape(-1, BLOCK, weight.shape[1])
    np.matmul(x[:whole].reshape(-1, BLOCK, len(weight)), weight, out=blocks)
    np.matmul(x[whole:], weight, out=made[whole:])
    return made


def _relu(x: F32) -> F32:
    return np.maximum(x, np.zeros_like(x))  # twice as fast as with a number
