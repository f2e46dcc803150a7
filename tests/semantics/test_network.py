import numpy as np
import pytest
import torch

from semantics.dataset import DatasetConfig, samples
from semantics.network import Checkpoint, EdgeClassifier, NetworkConfig, load, probabilities, save
from semantics.proximity import ProximityGraph
from semantics.train import TrainConfig, train
from slam.core import InputError

CONFIG = NetworkConfig("same_room", "invariant", 1, 14)


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
    assert p.shape == (30,)
    assert ((p > 0.0) & (p < 1.0)).all()


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
    bad = {
        "no such weights": tmp_path / "absent.npz",
        "cut off": write(tmp_path / "cut.npz", whole[: len(whole) // 2]),
        "not a weights file": write(tmp_path / "text.npz", b"hello"),
        "header": tmp_path / "foreign.npz",
        "not a weights file of ours": tmp_path / "pickled.npz",
    }
    for message, path in bad.items():
        with pytest.raises(InputError, match=message):
            load(path)


def test_weights_that_do_not_fit_or_are_no_numbers_are_refused(tmp_path):
    other = NetworkConfig("same_room", "paper", 3, 3)
    save(tmp_path / "a.npz", model(), Checkpoint(other))
    with pytest.raises(InputError, match="do not fit"):
        load(tmp_path / "a.npz")
    broken = model()
    with torch.no_grad():
        next(broken.parameters()).fill_(float("nan"))
    save(tmp_path / "b.npz", broken, Checkpoint(CONFIG))
    with pytest.raises(InputError, match="not numbers"):
        load(tmp_path / "b.npz")


def test_the_training_set_comes_from_its_seed():
    config = DatasetConfig(layouts=2, views=1)

    def drawn(seed):
        return list(samples(config, np.random.SeedSequence(seed), "invariant"))

    one, two, other = drawn(1), drawn(1), drawn(2)
    assert all(np.array_equal(a.graph.edge, b.graph.edge) for a, b in zip(one, two, strict=True))
    assert any(len(a.pieces) != len(b.pieces) for a, b in zip(one, other, strict=False))


def test_labels_agree_with_each_other():
    for sample in samples(DatasetConfig(layouts=4), np.random.SeedSequence(3), "invariant"):
        i, j = sample.graph.pairs.T
        assert not (sample.same_room & sample.same_wall).any()
        opposed = np.einsum("pc,pc->p", sample.pieces.normal[i], sample.pieces.normal[j]) < -0.9
        assert opposed[sample.same_wall].all()
        assert (sample.room[i] == sample.room[j])[sample.same_room].all()


def test_training_lowers_the_loss_and_is_reproducible(tmp_path):
    def trained(name):
        config = TrainConfig(DatasetConfig(layouts=20), epochs=6, threads=1, folder=tmp_path / name)
        return train(config)

    one, two = trained("a"), trained("b")
    for curve in one.curves:
        assert curve.loss[-1] < 0.6 * curve.loss[0]
        assert 0.3 <= curve.temperature <= 5.0
    for a, b in zip(one.files, two.files, strict=True):
        first, second = load(a)[0].state_dict(), load(b)[0].state_dict()
        assert all(torch.equal(first[k], second[k]) for k in first)
