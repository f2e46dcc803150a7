import numpy as np
import pytest
import torch

from semantics.network import (
    Checkpoint,
    EdgeClassifier,
    NetworkConfig,
    Triple,
    _max_by,
    load,
    probabilities,
    save,
)
from semantics.proximity import ProximityGraph
from slam.core import InputError

CONFIG = NetworkConfig(("same_room", "same_wall"), "invariant", 1, 14)


def random_graph(nodes, edges, seed=0):
    rng = np.random.default_rng(seed)
    i = rng.integers(0, nodes, edges)
    j = (i + rng.integers(1, nodes, edges)) % nodes
    return ProximityGraph(
        rng.normal(size=(nodes, 1)),
        np.concatenate([i, j]),
        np.concatenate([j, i]),
        rng.normal(size=(2 * edges, 14)),
    )


def model():
    torch.manual_seed(0)
    return EdgeClassifier(CONFIG).eval()


def test_one_probability_for_each_pair():
    graph = random_graph(10, 30)
    p = probabilities(model(), 1.0, graph)
    assert p.shape == (30, 2)
    assert ((p > 0.0) & (p < 1.0)).all()
    assert (p.sum(axis=1) < 1.0).all()


def test_both_directions_are_considered_in_one_answer():
    graph = random_graph(10, 30)
    swapped = ProximityGraph(
        graph.node, graph.target, graph.source, np.roll(graph.edge, 30, axis=0)
    )
    one, other = (probabilities(model(), 1.0, g) for g in (graph, swapped))
    assert np.allclose(one, other, atol=1e-6)


def test_the_numbering_of_the_planes_does_not_matter():
    graph = random_graph(10, 30)
    order = np.random.default_rng(1).permutation(10)
    place = np.argsort(order)
    renamed = ProximityGraph(
        graph.node[order], place[graph.source], place[graph.target], graph.edge
    )
    assert np.allclose(probabilities(model(), 1.0, graph), probabilities(model(), 1.0, renamed))


@pytest.mark.parametrize(("nodes", "edges"), [(2, 0), (2, 1)])
def test_tiny_graphs(nodes, edges):
    assert np.isfinite(probabilities(model(), 1.0, random_graph(nodes, edges))).all()


def test_weights_round_trip(tmp_path):
    saved = model()
    checkpoint = Checkpoint(CONFIG, 1.3, {"seed": 7})
    save(tmp_path / "w.npz", saved, checkpoint)
    loaded, found = load(tmp_path / "w.npz")
    assert found == checkpoint
    graph = random_graph(10, 30)
    assert np.array_equal(probabilities(saved, 1.3, graph), probabilities(loaded, 1.3, graph))


def write(path, data):
    path.write_bytes(data)
    return path


def test_files_that_are_no_weights_of_ours_are_refused(tmp_path):
    save(tmp_path / "w.npz", model(), Checkpoint(CONFIG))
    whole = (tmp_path / "w.npz").read_bytes()
    np.savez(tmp_path / "foreign.npz", a=np.zeros(3))
    np.savez(tmp_path / "pickled.npz", header=np.array([{"a": 1}], dtype=object))
    bad = [
        (tmp_path / "absent.npz", "no such weights"),
        (write(tmp_path / "cut.npz", whole[: len(whole) // 2]), "expected weights of ours"),
        (write(tmp_path / "text.npz", b"hello"), "expected weights of ours"),
        (tmp_path / "foreign.npz", "header"),
        (tmp_path / "pickled.npz", "weights of ours"),
    ]
    for path, message in bad:
        with pytest.raises(InputError, match=message):
            load(path)


def test_weights_that_do_not_fit_or_are_no_numbers_are_refused(tmp_path):
    other = NetworkConfig(("same_room",), "paper", 3, 3)
    save(tmp_path / "a.npz", model(), Checkpoint(other))
    with pytest.raises(InputError, match="do not fit"):
        load(tmp_path / "a.npz")
    broken = model()
    with torch.no_grad():
        next(broken.parameters()).fill_(float("nan"))
    save(tmp_path / "b.npz", broken, Checkpoint(CONFIG))
    with pytest.raises(InputError, match="not numbers"):
        load(tmp_path / "b.npz")


def test_channels_that_the_heads_cannot_share_are_refused(tmp_path):
    config = NetworkConfig(("same_room",), "paper", 3, 3, channels=32, heads=3)
    save(tmp_path / "w.npz", EdgeClassifier(config), Checkpoint(config))
    with pytest.raises(InputError, match="header"):
        load(tmp_path / "w.npz")


def test_what_is_made_of_a_node_once_is_what_a_linear_layer_makes_of_each_edge():
    torch.manual_seed(1)
    layer = Triple(3, 5, 7)
    v, e = torch.randn(4, 3), torch.randn(6, 5)
    source, target = torch.randint(0, 4, (6,)), torch.randint(0, 4, (6,))
    whole = torch.cat([v[source], e, v[target]], dim=1)
    expected = torch.nn.functional.linear(whole, layer.weight, layer.bias)
    assert torch.allclose(layer(v, e, source, target), expected, atol=1e-5)


def test_the_answer_is_a_maximum_over_the_neighbours():
    """Equation 1: of several equal neighbours the second changes nothing but the attention."""
    values, group = torch.tensor([[1.0], [5.0], [3.0]]), torch.tensor([0, 0, 1])
    assert _max_by(values, group, 3).tolist() == [[5.0], [3.0], [0.0]]
