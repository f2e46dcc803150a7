import subprocess
import sys

import numpy as np
import pytest
import torch

from semantics.forward import Forward
from semantics.network import Checkpoint, EdgeClassifier, NetworkConfig, probabilities, save
from semantics.proximity import ProximityGraph


def graph_of(nodes, pairs, seed=0, scale=1.0):
    """Random features; ``pairs`` of nodes drawn, some nodes may have none."""
    rng = np.random.default_rng(seed)
    i = rng.integers(0, nodes, pairs)
    j = (i + rng.integers(1, nodes, pairs)) % nodes
    features = scale * rng.normal(size=(2 * pairs, 16))
    source, target = np.concatenate([i, j]), np.concatenate([j, i])
    return ProximityGraph(scale * rng.normal(size=(nodes, 2)), source, target, features)


def saved(path, config, temperature=1.3):
    torch.manual_seed(3)
    model = EdgeClassifier(config)
    model.node_scale.fit(torch.randn(50, config.node_size) * 3.0 + 1.0)
    model.edge_scale.fit(torch.randn(50, config.edge_size) * 0.2 - 1.0)
    save(path, model, Checkpoint(config, temperature))
    return model.eval()


@pytest.mark.parametrize("sizes", [{}, {"channels": 12, "heads": 3, "hops": 3, "hidden": 20}])
@pytest.mark.parametrize(("nodes", "pairs"), [(2, 1), (9, 30), (60, 20), (100, 900)])
def test_numpy_says_what_torch_says(tmp_path, sizes, nodes, pairs):
    config = NetworkConfig(("same_room", "same_wall"), "invariant", 2, 16, **sizes)
    model = saved(tmp_path / "w.npz", config)
    forward = Forward.load(tmp_path / "w.npz")
    for scale in (1.0, 30.0):
        graph = graph_of(nodes, pairs, scale=scale)
        expected = probabilities(model, 1.3, graph)
        assert np.abs(forward(graph) - expected).max() < 1e-6 * scale
    assert forward.config == config


def test_a_graph_without_edges_has_no_answers(tmp_path):
    saved(tmp_path / "w.npz", NetworkConfig(("same_room",), "invariant", 2, 16))
    graph = graph_of(3, 0)
    assert Forward.load(tmp_path / "w.npz")(graph).shape == (0, 1)


def test_a_node_with_very_many_edges_is_no_exception(tmp_path):
    model = saved(tmp_path / "w.npz", NetworkConfig(("same_room",), "invariant", 2, 16))
    rng, others = np.random.default_rng(0), np.arange(1, 300)
    hub = np.zeros_like(others)
    source, target = np.concatenate([hub, others]), np.concatenate([others, hub])
    graph = ProximityGraph(rng.normal(size=(300, 2)), source, target, rng.normal(size=(598, 16)))
    found = Forward.load(tmp_path / "w.npz")(graph)
    assert np.abs(found - probabilities(model, 1.3, graph)).max() < 1e-6


def test_a_run_does_not_wait_for_torch():
    code = (
        "import sys; from semantics.detector import make_detector; make_detector('gnn');"
        " assert not {'torch', 'scipy'} & set(sys.modules)"
    )
    subprocess.run([sys.executable, "-c", code], check=True)
