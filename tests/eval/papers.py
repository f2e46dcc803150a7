"""Runs of the paper's sweep that only pretend, and what a sheet says of them."""

from __future__ import annotations

from dataclasses import fields
from pathlib import Path

import numpy as np
from fakes import metrics_of

from eval.comparing.tables import Sheet
from eval.config import RunConfig
from eval.metrics import Metrics, Rooms, Walls
from eval.paper import study
from eval.paper.study import Measured
from eval.score.failures import Failures
from eval.sweep.job import Row

BASE = RunConfig("SE1", cache=Path("front-ends"))


def stub(config: RunConfig) -> Metrics:
    """Numbers of the configuration alone; Hydra has no pieces, and finds nothing in RC2F2."""
    rng = np.random.default_rng([config.seed, len(config.scene), ord(config.detector[0])])
    nothing = config.detector == "hydra" and config.scene == "RC2F2"
    share = None if nothing else 0.5 + 0.5 * float(rng.random())
    by_pieces = 0.0 if nothing else None if config.detector == "hydra" else share
    rooms = Rooms(
        *(10, 8, by_pieces and 8.0, by_pieces and 6.0, by_pieces, by_pieces),
        *(share, 0.0 if nothing else share),
    )
    ate = {"sgraphs": 0.03, "gnn": 0.02}.get(config.detector, 0.04)
    return metrics_of(
        config,
        rooms=rooms,
        walls=Walls(12, 12, 12, 1.0, 0.8),
        failures=failures_of(config),
        ate_m=ate,
        mma_m=0.02,
        mma_floor_m=0.015,
        first_room_s=1.0 + config.seed,
        T_world_map=tuple(map(tuple, np.eye(4).tolist())),
    )


def failures_of(config: RunConfig) -> Failures:
    """As many of each cause that there is for the detector."""
    missing = {"hydra": ("planes", "edges"), "sgraphs": ("edges",)}
    without = missing.get(config.detector.partition("-")[0], ())
    counts = {
        item.name: 0 if item.name.endswith(without) else config.seed for item in fields(Failures)
    }
    return Failures(**counts)


def measured_of(group: study.Group) -> Measured:
    configs = group.ablation.configs
    return Measured(group, {c: Row(c, "complete", None, 1.0, stub(c)) for c in configs})


def paper_runs() -> Measured:
    """The catalogue, with three seeds."""
    return measured_of(study.catalogue((0, 1, 2), BASE, quick=False))


def cell(sheet: Sheet, row: str, column: str, **others: str) -> str:
    places = {name: sheet.head.index(name) for name in others}
    found = [
        line
        for line in sheet.rows
        if line[0] == row and all(line[places[name]] == text for name, text in others.items())
    ]
    assert len(found) == 1
    return found[0][sheet.head.index(column)]
