"""Training: the data set, the two networks, and what is shipped of them."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import torch
from torch import Tensor, nn

from semantics.dataset import DatasetConfig, Sample, samples
from semantics.detector import WEIGHTS
from semantics.network import Checkpoint, EdgeClassifier, NetworkConfig, save, tensors
from semantics.proximity import features_named

RELATIONS = ("same_room", "same_wall")
Progress = Callable[[str, float], None]
"""Told what is being done, and the share of all work that is done."""


@dataclass(frozen=True)
class TrainConfig:
    """epochs: passes over the training set (the paper's 35 overfit here); rate: of Adam, lowered
    along a half cosine; batch: graphs per step; validation: share of the samples that is held out;
    threads: of torch; folder: where the weights go.
    """

    dataset: DatasetConfig = field(default_factory=DatasetConfig)
    features: str = "invariant"
    seed: int = 0
    epochs: int = 18
    rate: float = 3e-3
    batch: int = 16
    validation: float = 0.1
    threads: int = 2
    folder: Path = WEIGHTS


@dataclass(frozen=True)
class Curve:
    """One network's training: per epoch the mean loss on both sets and, on the validation set, the
    precision and recall at a probability of 0.5; best: the epoch whose weights are kept."""

    relation: str
    loss: tuple[float, ...]
    validation_loss: tuple[float, ...]
    precision: tuple[float, ...]
    recall: tuple[float, ...]
    best: int
    temperature: float


@dataclass(frozen=True)
class TrainResult:
    """Curves of both networks, and the files that were written."""

    curves: tuple[Curve, ...]
    files: tuple[Path, ...]


@dataclass(frozen=True)
class _Batch:
    """Several graphs as one without edges between them."""

    inputs: tuple[Tensor, Tensor, Tensor, Tensor]
    label: Tensor


def train(config: TrainConfig = TrainConfig(), progress: Progress | None = None) -> TrainResult:
    """Makes the training set, trains both networks and writes their weights; the same seed gives
    the same weights on the same machine."""
    torch.set_num_threads(config.threads)
    report = progress or _silent
    everything = _make_samples(config, report)
    held_out = max(1, int(len(everything) * config.validation))
    training, validation = everything[held_out:], everything[:held_out]
    curves, files = [], []
    for number, relation in enumerate(RELATIONS):
        start = 0.4 + 0.3 * number
        curve, path = _train_one(config, relation, training, validation, report, start)
        curves.append(curve)
        files.append(path)
    report("done", 1.0)
    return TrainResult(tuple(curves), tuple(files))


def _silent(what: str, share: float) -> None:
    """Nobody listens."""


def _make_samples(config: TrainConfig, report: Progress) -> list[Sample]:
    made = []
    expected = config.dataset.layouts * config.dataset.views
    for sample in samples(config.dataset, np.random.SeedSequence(config.seed), config.features):
        made.append(sample)
        report("training set", 0.4 * len(made) / expected)
    return made


def _train_one(
    config: TrainConfig,
    relation: str,
    training: Sequence[Sample],
    validation: Sequence[Sample],
    report: Progress,
    start: float,
) -> tuple[Curve, Path]:
    """Adam on the binary cross-entropy; the weights of the best epoch by validation loss stay."""
    torch.manual_seed(config.seed)
    rng = np.random.default_rng(np.random.SeedSequence(config.seed, spawn_key=(1,)))
    features = features_named(config.features)
    network = NetworkConfig(relation, config.features, features.node_size, features.edge_size)
    model = EdgeClassifier(network)
    model.node_scale.fit(torch.cat([tensors(s.graph)[0] for s in training]))
    model.edge_scale.fit(torch.cat([tensors(s.graph)[1] for s in training]))
    steps = config.epochs * -(-len(training) // config.batch)
    optimiser = torch.optim.Adam(model.parameters(), lr=config.rate)
    schedule = torch.optim.lr_scheduler.CosineAnnealingLR(optimiser, steps)
    held = _batched(validation, relation)
    losses, scores = [], []
    best, kept = float("inf"), model.state_dict()
    for epoch in range(config.epochs):
        order = rng.permutation(len(training))
        total = 0.0
        for place in range(0, len(order), config.batch):
            batch = _batched([training[i] for i in order[place : place + config.batch]], relation)
            loss = _loss(model(*batch.inputs), batch.label)
            optimiser.zero_grad()
            loss.backward()
            optimiser.step()
            schedule.step()
            total += float(loss.detach()) * len(batch.label)
        losses.append(total / sum(len(s.same_room) for s in training))
        score = _validate(model, held)
        scores.append(score)
        if score[0] < best:
            best, kept = score[0], {k: v.clone() for k, v in model.state_dict().items()}
        report(relation, start + 0.3 * (epoch + 1) / config.epochs)
    model.load_state_dict(kept)
    return _finish(config, relation, model, held, losses, scores)


def _finish(
    config: TrainConfig,
    relation: str,
    model: EdgeClassifier,
    held: _Batch,
    losses: list[float],
    scores: list[tuple[float, float, float]],
) -> tuple[Curve, Path]:
    """Calibrates, describes and writes a trained network."""
    best = int(np.argmin([score[0] for score in scores]))
    temperature = _temperature(model, held)
    facts: dict[str, float | str] = {
        "seed": config.seed,
        "layouts": config.dataset.layouts,
        "views": config.dataset.views,
        "epoch": best + 1,
        "validation_loss": scores[best][0],
        "validation_precision": scores[best][1],
        "validation_recall": scores[best][2],
    }
    path = config.folder / f"{relation}.npz"
    config.folder.mkdir(parents=True, exist_ok=True)
    save(path, model.eval(), Checkpoint(model.config, temperature, facts))
    validation_loss, precision, recall = (tuple(column) for column in zip(*scores, strict=True))
    return (
        Curve(relation, tuple(losses), validation_loss, precision, recall, best, temperature),
        path,
    )


def _batched(chosen: Sequence[Sample], relation: str) -> _Batch:
    """Graphs side by side; the undirected half of all edges first, as the network expects it."""
    nodes, forward, backward, ends, labels = [], [], [], [], []
    offset = 0
    for sample in chosen:
        node, edge, source, target = tensors(sample.graph)
        half = len(source) // 2
        nodes.append(node)
        forward.append(edge[:half])
        backward.append(edge[half:])
        ends.append(torch.stack([source[:half], target[:half]]) + offset)
        labels.append(torch.from_numpy(np.asarray(getattr(sample, relation), dtype=np.float32)))
        offset += len(node)
    pairs = torch.cat(ends, dim=1)
    source, target = torch.cat([pairs[0], pairs[1]]), torch.cat([pairs[1], pairs[0]])
    edges = torch.cat([*forward, *backward])
    return _Batch((torch.cat(nodes), edges, source, target), torch.cat(labels))


def _loss(logits: Tensor, label: Tensor) -> Tensor:
    return nn.functional.binary_cross_entropy_with_logits(logits, label)


def _validate(model: EdgeClassifier, held: _Batch) -> tuple[float, float, float]:
    """Loss, precision and recall at a probability of 0.5."""
    with torch.inference_mode():
        logits = model(*held.inputs)
        found, true = logits > 0.0, held.label > 0.5
        hits = float((found & true).sum())
        precision = hits / max(float(found.sum()), 1.0)
        return float(_loss(logits, held.label)), precision, hits / max(float(true.sum()), 1.0)


def _temperature(model: EdgeClassifier, held: _Batch) -> float:
    """The divisor of the logits that makes the validation set most likely (Guo et al., 2017)."""
    with torch.inference_mode():
        logits = model(*held.inputs)
        grid = np.geomspace(0.3, 5.0, 60)
        losses = [float(_loss(logits / t, held.label)) for t in grid.tolist()]
    return float(grid[int(np.argmin(losses))])
