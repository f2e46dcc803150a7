"""Training: the data set, the networks, and what is shipped of them."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, field
from functools import partial
from multiprocessing import get_context
from pathlib import Path

import numpy as np
import torch
from torch import Tensor, nn

from semantics.dataset import DatasetConfig, Sample, TrainingSet, labels_of
from semantics.detector import WEIGHTS
from semantics.layouts import LayoutConfig
from semantics.network import Checkpoint, EdgeClassifier, NetworkConfig, save, tensors
from semantics.proximity import NEIGHBOURS, ProximityGraph, features_named, proximity_graph
from slam.core import Array, InputError, IntArray

RELATIONS = ("same_room", "same_wall")
"""Labels of pairs count from 1 in this order."""
Progress = Callable[[str, float], None]
"""Told what is being done, and the share of all work that is done."""


@dataclass(frozen=True)
class TrainConfig:
    """networks: name of each network's file, and the relations that it tells apart; features:
    name of the feature set; epochs: passes over the training set; rate: of Adam, lowered along a
    half cosine; batch: graphs per step; validation: share of the buildings that is held out;
    processes: that draw the training set; threads: of torch; folder: where the weights go.
    """

    dataset: TrainingSet = field(default_factory=DatasetConfig)
    networks: tuple[tuple[str, tuple[str, ...]], ...] = (("gnn", RELATIONS),)
    features: str = "invariant"
    seed: int = 0
    epochs: int = 25
    rate: float = 3e-3
    batch: int = 8
    validation: float = 0.1
    processes: int = 2
    threads: int = 1
    folder: Path = WEIGHTS


OURS = TrainConfig()
PAPER = TrainConfig(
    dataset=LayoutConfig(),
    networks=tuple((f"paper_{relation}", (relation,)) for relation in RELATIONS),
    features="paper",
    epochs=35,
)
PRESETS = {"ours": OURS, "paper": PAPER}


def preset_named(name: str) -> TrainConfig:
    """What to train. Raises InputError."""
    if name not in PRESETS:
        raise InputError(f"preset: {name!r} is unknown, expected one of {', '.join(PRESETS)}")
    return PRESETS[name]


@dataclass(frozen=True)
class Curve:
    """One network's training. Per epoch: the mean loss on both sets, and by relation the precision
    and recall on the validation set; best: the epoch whose weights are kept; calibration: by
    relation, how far the probabilities of the kept weights are off on average (``Score``)."""

    name: str
    relations: tuple[str, ...]
    loss: tuple[float, ...]
    validation_loss: tuple[float, ...]
    precision: tuple[tuple[float, ...], ...]
    recall: tuple[tuple[float, ...], ...]
    calibration: tuple[float, ...]
    best: int
    temperature: float


@dataclass(frozen=True)
class TrainResult:
    """Curves of the networks, and the files that were written."""

    curves: tuple[Curve, ...]
    files: tuple[Path, ...]


@dataclass(frozen=True)
class Example:
    """A sample's graph, and the label (P,) of each of its pairs."""

    graph: ProximityGraph
    label: IntArray


@dataclass(frozen=True)
class Score:
    """Of one relation, pairs taken for it where it is likelier than not: precision, recall, and
    the expected calibration error over 15 bins of probability (Guo et al., 2017)."""

    precision: float
    recall: float
    calibration: float


@dataclass(frozen=True)
class _Batch:
    """Several graphs as one without edges between them."""

    inputs: tuple[Tensor, Tensor, Tensor, Tensor]
    label: Tensor


def train(config: TrainConfig = OURS, progress: Progress | None = None) -> TrainResult:
    """Makes the training set, trains the networks and writes their weights; the same seed gives
    the same weights on the same machine."""
    report = progress or _silent
    drawn = draw(config.dataset, config.seed, config.processes, report)
    torch.set_num_threads(config.threads)
    result = train_on(config, drawn, report)
    report("done", 1.0)
    return result


def train_on(
    config: TrainConfig, drawn: Sequence[Sequence[Sample]], report: Progress
) -> TrainResult:
    """Trains on samples that were drawn before, by building."""
    held_out = max(1, int(len(drawn) * config.validation))
    validation = examples([s for b in drawn[:held_out] for s in b], config.features)
    training = examples([s for b in drawn[held_out:] for s in b], config.features)
    curves, files = [], []
    for number, (name, relations) in enumerate(config.networks):
        part = partial(_part, report, name, 0.3 + 0.7 * number / len(config.networks))
        trained = _train_one(config, name, relations, training, validation, part)
        curves.append(trained[0])
        files.append(trained[1])
    return TrainResult(tuple(curves), tuple(files))


def _silent(what: str, share: float) -> None:
    """Nobody listens."""


def _part(report: Progress, name: str, start: float, share: float) -> None:
    report(name, start + share)


def draw(
    training_set: TrainingSet, seed: int, processes: int = 1, report: Progress = _silent
) -> list[list[Sample]]:
    """All samples, by building; the same however many processes draw them."""
    children = np.random.SeedSequence(seed).spawn(training_set.layouts)
    drawn: list[list[Sample]] = []
    if processes == 1:
        for child in children:
            drawn.append(training_set.draw(child))
            report("training set", 0.3 * len(drawn) / len(children))
        return drawn
    with ProcessPoolExecutor(processes, mp_context=get_context("spawn")) as pool:
        for made in pool.map(training_set.draw, children, chunksize=8):
            drawn.append(made)
            report("training set", 0.3 * len(drawn) / len(children))
    return drawn


def examples(drawn: Sequence[Sample], features: str) -> list[Example]:
    """Graphs with labels, of the samples that have a pair of pieces."""
    feature_set = features_named(features)
    graphs = [proximity_graph(sample.pieces, feature_set) for sample in drawn]
    return [
        Example(graph, labels_of(sample, graph.pairs))
        for sample, graph in zip(drawn, graphs, strict=True)
        if len(graph.source)
    ]


def _train_one(
    config: TrainConfig,
    name: str,
    relations: tuple[str, ...],
    training: Sequence[Example],
    validation: Sequence[Example],
    report: Callable[[float], None],
) -> tuple[Curve, Path]:
    """Adam on the cross-entropy; the weights of the best epoch by validation loss stay."""
    torch.manual_seed(config.seed)
    rng = np.random.default_rng(np.random.SeedSequence(config.seed, spawn_key=(1,)))
    model = _new_model(config, relations, training)
    steps = config.epochs * -(-len(training) // config.batch)
    optimiser = torch.optim.Adam(model.parameters(), lr=config.rate)
    schedule = torch.optim.lr_scheduler.CosineAnnealingLR(optimiser, steps)
    held = _batched(validation, relations)
    losses, held_losses, scores = [], [], []
    best, kept = float("inf"), model.state_dict()
    for epoch in range(config.epochs):
        order = rng.permutation(len(training))
        total, pairs = 0.0, 0
        for place in range(0, len(order), config.batch):
            chosen = [training[i] for i in order[place : place + config.batch]]
            batch = _batched(chosen, relations)
            loss = nn.functional.cross_entropy(model(*batch.inputs), batch.label)
            optimiser.zero_grad()
            loss.backward()
            optimiser.step()
            schedule.step()
            total += float(loss.detach()) * len(batch.label)
            pairs += len(batch.label)
        losses.append(total / pairs)
        logits = _logits(model, held)
        held_losses.append(float(nn.functional.cross_entropy(logits, held.label)))
        scores.append(_scores(logits, held.label))
        if held_losses[-1] < best:
            best, kept = held_losses[-1], {k: v.clone() for k, v in model.state_dict().items()}
        report(0.7 / len(config.networks) * (epoch + 1) / config.epochs)
    model.load_state_dict(kept)
    logits = _logits(model, held)
    temperature = _temperature(logits, held.label)
    curve = Curve(
        name=name,
        relations=relations,
        loss=tuple(losses),
        validation_loss=tuple(held_losses),
        precision=tuple(tuple(score.precision for score in row) for row in scores),
        recall=tuple(tuple(score.recall for score in row) for row in scores),
        calibration=tuple(s.calibration for s in _scores(logits / temperature, held.label)),
        best=int(np.argmin(held_losses)),
        temperature=temperature,
    )
    return curve, _write(config, model, curve)


def _new_model(
    config: TrainConfig, relations: tuple[str, ...], training: Sequence[Example]
) -> EdgeClassifier:
    features = features_named(config.features)
    network = NetworkConfig(
        relations, config.features, features.node_size, features.edge_size, NEIGHBOURS
    )
    model = EdgeClassifier(network)
    model.node_scale.fit(torch.cat([tensors(example.graph)[0] for example in training]))
    model.edge_scale.fit(torch.cat([tensors(example.graph)[1] for example in training]))
    return model


def _write(config: TrainConfig, model: EdgeClassifier, curve: Curve) -> Path:
    """The weights with what they are and where they are from."""
    facts: dict[str, float | str] = {
        "seed": config.seed,
        "training_set": type(config.dataset).__name__,
        "layouts": config.dataset.layouts,
        "epoch": curve.best + 1,
        "validation_loss": curve.validation_loss[curve.best],
    }
    for place, relation in enumerate(curve.relations):
        facts[f"{relation}_precision"] = curve.precision[curve.best][place]
        facts[f"{relation}_recall"] = curve.recall[curve.best][place]
        facts[f"{relation}_calibration_error"] = curve.calibration[place]
    path = config.folder / f"{curve.name}.npz"
    config.folder.mkdir(parents=True, exist_ok=True)
    save(path, model.eval(), Checkpoint(model.config, curve.temperature, facts))
    return path


def _batched(chosen: Sequence[Example], relations: tuple[str, ...]) -> _Batch:
    """Graphs side by side; the undirected half of all edges first, as the network expects it."""
    nodes, forward, backward, ends, labels = [], [], [], [], []
    offset = 0
    target_of = torch.tensor(
        [0] + [relations.index(r) + 1 if r in relations else 0 for r in RELATIONS]
    )
    for example in chosen:
        node, edge, source, target = tensors(example.graph)
        half = len(source) // 2
        nodes.append(node)
        forward.append(edge[:half])
        backward.append(edge[half:])
        ends.append(torch.stack([source[:half], target[:half]]) + offset)
        labels.append(target_of[torch.from_numpy(example.label)])
        offset += len(node)
    pairs = torch.cat(ends, dim=1)
    source, target = torch.cat([pairs[0], pairs[1]]), torch.cat([pairs[1], pairs[0]])
    edges = torch.cat([*forward, *backward])
    return _Batch((torch.cat(nodes), edges, source, target), torch.cat(labels))


def _logits(model: EdgeClassifier, held: _Batch) -> Tensor:
    with torch.inference_mode():
        return model(*held.inputs)


def _scores(logits: Tensor, label: Tensor) -> list[Score]:
    probability = torch.softmax(logits, dim=1).double().numpy()
    truth = label.numpy()
    return [
        score_relation(probability[:, place], truth == place)
        for place in range(1, probability.shape[1])
    ]


def score_relation(probability: Array, true: np.ndarray) -> Score:
    """Precision, recall and calibration error of probabilities (P,) against truth (P,) bool."""
    found = probability > 0.5
    hits = float((found & true).sum())
    bins = np.minimum((probability * 15).astype(np.int64), 14)
    off = np.bincount(bins, weights=probability - true, minlength=15)
    return Score(
        precision=hits / max(float(found.sum()), 1.0),
        recall=hits / max(float(true.sum()), 1.0),
        calibration=float(np.abs(off).sum() / max(len(probability), 1)),
    )


def _temperature(logits: Tensor, label: Tensor) -> float:
    """The divisor of the logits that makes the validation set most likely (Guo et al., 2017)."""
    grid = np.geomspace(0.3, 5.0, 60).tolist()
    losses = [float(nn.functional.cross_entropy(logits / t, label)) for t in grid]
    return float(grid[int(np.argmin(losses))])
