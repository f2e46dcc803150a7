"""The file of a network: its weights, and enough to make it again and to say where it is from."""

from __future__ import annotations

import io
import json
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from slam.arrayfile import ArrayFile
from slam.core import Array, Floats, InputError

FORMAT = "roomloop-weights-2"
MOST_BYTES = 1_000_000_000
"""Of weights; ours have a hundred kilobytes."""
MOST_CHANNELS = 4096
"""Of a layer."""
SLOPE = 0.2
"""Of the leaky rectifier in the attention (as in the original GAT)."""


@dataclass(frozen=True)
class NetworkConfig:
    """relations: those that it tells apart, besides none; features: name of the feature set;
    neighbours: of each piece in the graph; sizes of the layers."""

    relations: tuple[str, ...]
    features: str
    node_size: int
    edge_size: int
    neighbours: int = 15
    channels: int = 32
    heads: int = 4
    hops: int = 2
    hidden: int = 32

    @property
    def hop_sizes(self) -> list[tuple[int, int]]:
        """Of a node and of an edge, as each hop gets them."""
        rest = [(self.channels, self.channels)] * (self.hops - 1)
        return [(self.node_size, self.edge_size), *rest]


@dataclass(frozen=True)
class Checkpoint:
    """What is stored beside the weights.

    temperature: logits are divided by it, so that probabilities mean what they say; facts: seed,
    epochs, scores.
    """

    network: NetworkConfig
    temperature: float = 1.0
    facts: dict[str, float | str] = field(default_factory=dict)


def write(path: Path, arrays: Mapping[str, Floats], checkpoint: Checkpoint) -> None:
    """Weights and their description as .npz: arrays and a JSON text, nothing that is executed."""
    header = np.array(json.dumps({"format": FORMAT, **asdict(checkpoint)}))
    whole: dict[str, Any] = {**arrays, "header": header}
    buffer = io.BytesIO()
    np.savez_compressed(buffer, **whole)
    part = path.with_name(path.name + ".part")
    part.write_bytes(buffer.getvalue())
    part.replace(path)


def read(path: Path) -> tuple[dict[str, Floats], Checkpoint]:
    """Weights by their names, and their description. Raises InputError for whatever ``write`` did
    not write."""
    if not path.is_file():
        raise InputError(f"{path}: no such weights; `roomloop train` makes them")
    arrays = ArrayFile(path, "weights of ours", MOST_BYTES).whole()
    checkpoint = _checkpoint(path, arrays.pop("header", None))
    found = {name: array.shape for name, array in arrays.items() if array.dtype.kind == "f"}
    if found != shapes(checkpoint.network):
        raise InputError(f"{path}: weights that do not fit their description")
    if not all(np.isfinite(array).all() for array in arrays.values()):
        raise InputError(f"{path}: weights that are not numbers")
    return arrays, checkpoint


def shapes(config: NetworkConfig) -> dict[str, tuple[int, ...]]:
    """Of all weights of a network."""
    c, hidden = config.channels, config.hidden
    linear = {"first": (hidden, 3 * c), "second": (hidden, hidden)}
    linear["third"] = (1 + len(config.relations), hidden)
    found: dict[str, tuple[int, ...]] = {}
    for place, (node, edge) in enumerate(config.hop_sizes):
        hop = f"hops.{place}"
        linear[f"{hop}.attend"] = linear[f"{hop}.edge"] = (c, 2 * node + edge)
        linear[f"{hop}.message"], linear[f"{hop}.node"] = (c, edge + node), (c, node + c)
        found[f"{hop}.score"] = (config.heads, c // config.heads)
    for name, (rows, columns) in linear.items():
        found[f"{name}.weight"], found[f"{name}.bias"] = (rows, columns), (rows,)
    for kind, size in (("node", config.node_size), ("edge", config.edge_size)):
        found[f"{kind}_scale.mean"] = found[f"{kind}_scale.std"] = (size,)
    return found


def _checkpoint(path: Path, header: Array | None) -> Checkpoint:
    try:
        tree = json.loads(str(header))
        if tree.pop("format") != FORMAT:
            raise KeyError("format")
        network = {**tree["network"], "relations": tuple(tree["network"]["relations"])}
        sizes = [network[key] for key in network.keys() - {"relations", "features"}]
        if not all(isinstance(size, int) and 0 < size <= MOST_CHANNELS for size in sizes):
            raise ValueError("sizes")
        config = NetworkConfig(**network)
        if config.channels % config.heads:
            raise ValueError("heads")
        return Checkpoint(config, float(tree["temperature"]), dict(tree["facts"]))
    except (ValueError, KeyError, TypeError, AttributeError, RecursionError) as error:
        raise InputError(f"{path}: header: expected the description of {FORMAT!r}") from error
