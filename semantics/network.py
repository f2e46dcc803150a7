"""The networks that tell which plane pieces share a room and which are the two faces of a wall.

Encoder and decoder as the paper has them (III-B, equations 1 to 3), in plain torch: graphs of a few
hundred nodes need no more. The paper has one network for each relation; one network may also tell
several apart. A run asks ``semantics.forward``, which works out the same in numpy. N nodes, E
directed edges (both directions of every pair, see ``semantics.proximity``), C channels, H heads, R
relations.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import torch
from torch import Tensor, nn

from semantics.checkpoint import SLOPE, Checkpoint, NetworkConfig, read, write
from semantics.proximity import ProximityGraph
from slam.core import Array


class Triple(nn.Linear):
    """A linear layer of [v_i, e_ij, v_j]; what it makes of a node is worked out once per node."""

    def __init__(self, node_size: int, edge_size: int, channels: int):
        super().__init__(2 * node_size + edge_size, channels)
        self.sizes = [node_size, edge_size, node_size]

    def forward(  # type: ignore[override]
        self, v: Tensor, e: Tensor, source: Tensor, target: Tensor
    ) -> Tensor:
        """v: (N, node_size), e: (E, edge_size) -> (E, channels)."""
        of_source, of_edge, of_target = self.weight.split(self.sizes, dim=1)
        there = nn.functional.linear(v, of_target).index_select(0, target)  # (E, channels)
        here = nn.functional.linear(v, of_source).index_select(0, source)  # (E, channels)
        return nn.functional.linear(e, of_edge, self.bias) + here + there


class Hop(nn.Module):
    """One step of message passing: equations 1 and 2."""

    def __init__(self, node_size: int, edge_size: int, channels: int, heads: int):
        super().__init__()
        self.heads = heads
        self.attend = Triple(node_size, edge_size, channels)
        self.score = nn.Parameter(torch.empty(heads, channels // heads))
        self.message = nn.Linear(edge_size + node_size, channels)
        self.node = nn.Linear(node_size + channels, channels)
        self.edge = Triple(node_size, edge_size, channels)
        nn.init.xavier_uniform_(self.score)

    def forward(
        self, v: Tensor, e: Tensor, source: Tensor, target: Tensor
    ) -> tuple[Tensor, Tensor]:
        """v: (N, node_size), e: (E, edge_size) -> (N, C), (E, C)."""
        count, edges = len(v), len(e)
        seen = nn.functional.leaky_relu(self.attend(v, e, source, target), SLOPE)  # (E, C)
        seen = seen.view(edges, self.heads, -1)  # (E, H, C / H)
        weight = _softmax((seen * self.score).sum(dim=2), source, count)  # (E, H)
        of_edge, of_node = self.message.weight.split([e.shape[1], v.shape[1]], dim=1)
        message = nn.functional.linear(e, of_edge, self.message.bias)  # (E, C)
        message = message + nn.functional.linear(v, of_node).index_select(0, target)  # (E, C)
        message = (message.view(edges, self.heads, -1) * weight[:, :, None]).flatten(1)  # (E, C)
        most = _max_by(message, source, count)  # (N, C), the paper's max over the neighbours
        v_next = torch.relu(self.node(torch.cat([v, most], dim=1)))  # (N, C)
        e_next = torch.relu(self.edge(v, e, source, target))  # (E, C)
        return v_next, e_next


class Standardise(nn.Module):
    """Features less their mean over the training set, in units of their deviation there."""

    mean: Tensor
    std: Tensor

    def __init__(self, size: int):
        super().__init__()
        self.register_buffer("mean", torch.zeros(size))
        self.register_buffer("std", torch.ones(size))

    def fit(self, features: Tensor) -> None:
        """features: (S, size) of the training set."""
        self.mean.copy_(features.mean(dim=0))
        self.std.copy_(features.std(dim=0).clamp_min(1e-3))

    def forward(self, features: Tensor) -> Tensor:
        """(S, size) -> (S, size)"""
        return (features - self.mean) / self.std


class EdgeClassifier(nn.Module):
    """Logits of none and of each relation for every undirected pair: the mean of what is said of
    it in both directions."""

    def __init__(self, config: NetworkConfig):
        super().__init__()
        self.config = config
        c = config.channels
        self.hops = nn.ModuleList(Hop(v, e, c, config.heads) for v, e in config.hop_sizes)
        self.first = Triple(c, c, config.hidden)
        self.second = nn.Linear(config.hidden, config.hidden)
        self.third = nn.Linear(config.hidden, 1 + len(config.relations))
        self.node_scale = Standardise(config.node_size)
        self.edge_scale = Standardise(config.edge_size)
        self.apply(_xavier)

    def forward(self, node: Tensor, edge: Tensor, source: Tensor, target: Tensor) -> Tensor:
        """node: (N, node_size), edge: (E, edge_size) -> (E / 2, 1 + R) logits, of ``pairs``."""
        v, e = self.node_scale(node), self.edge_scale(edge)
        for hop in self.hops:
            v, e = hop(v, e, source, target)  # (N, C), (E, C)
        hidden = torch.relu(self.first(v, e, source, target))  # (E, hidden)
        half = len(source) // 2
        hidden = 0.5 * (hidden[:half] + hidden[half:])  # (E / 2, hidden)
        hidden = torch.relu(self.second(hidden))  # (E / 2, hidden)
        return self.third(hidden)  # (E / 2, 1 + R)


def _xavier(module: nn.Module) -> None:
    if isinstance(module, nn.Linear):
        nn.init.xavier_uniform_(module.weight)
        nn.init.zeros_(module.bias)


def _softmax(score: Tensor, group: Tensor, count: int) -> Tensor:
    """Softmax of (E, H) over the edges of each group."""
    top = _max_by(score.detach(), group, count)
    exp = torch.exp(score - top.index_select(0, group))
    total = torch.zeros(count, score.shape[1]).index_add(0, group, exp)
    return exp / total.index_select(0, group)


def _max_by(values: Tensor, group: Tensor, count: int) -> Tensor:
    """(N, C) largest value over the edges of each group; 0 for a group without edges."""
    index = group[:, None].expand_as(values)
    start = torch.zeros(count, values.shape[1])
    return start.scatter_reduce(0, index, values, "amax", include_self=False)


# --- on graphs -----------------------------------------------------------------------------------


def tensors(graph: ProximityGraph) -> tuple[Tensor, Tensor, Tensor, Tensor]:
    """node, edge, source, target as the network takes them."""
    return (
        torch.from_numpy(graph.node).float(),
        torch.from_numpy(graph.edge).float(),
        torch.from_numpy(graph.source),
        torch.from_numpy(graph.target),
    )


def probabilities(model: EdgeClassifier, temperature: float, graph: ProximityGraph) -> Array:
    """(E / 2, R) calibrated probability of each relation for each of ``graph.pairs``."""
    if len(graph.source) == 0:
        return np.zeros((0, len(model.config.relations)))
    with torch.inference_mode():
        logits = model(*tensors(graph)) / temperature
        return torch.softmax(logits, dim=1)[:, 1:].double().numpy()


# --- files ---------------------------------------------------------------------------------------


def save(path: Path, model: EdgeClassifier, checkpoint: Checkpoint) -> None:
    """The network's weights with their description."""
    write(path, {name: value.numpy() for name, value in model.state_dict().items()}, checkpoint)


def load(path: Path) -> tuple[EdgeClassifier, Checkpoint]:
    """A network and its description. Raises InputError for whatever ``save`` did not write."""
    arrays, checkpoint = read(path)
    model = EdgeClassifier(checkpoint.network)
    model.load_state_dict({name: torch.from_numpy(value) for name, value in arrays.items()})
    return model.eval(), checkpoint
