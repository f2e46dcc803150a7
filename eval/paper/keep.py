"""What stays of every run of the paper's sweep beside its metrics: its scene graph."""

from __future__ import annotations

from pathlib import Path

from eval.config import RunConfig
from eval.files import read_bytes, write_bytes
from eval.metrics import Metrics
from eval.names import refuse
from eval.sweep.job import Job
from eval.sweep.work import run_one, work

RUN_AND_KEEP = "eval.paper.keep:run_and_keep"


def graph_path(config: RunConfig) -> Path:
    """Where the graph of a run of the sweep is kept: beside the folder of front ends."""
    if config.cache is None:
        refuse("cache: expected a folder, beside which graphs are kept")
    return config.cache.parent / "graphs" / f"{Job(config).key}.json"


def run_and_keep(config: RunConfig) -> Metrics:
    """The metrics of a run, whose graph.json is kept. Raises FailedRun."""
    metrics = run_one(config)
    path = graph_path(config)
    path.parent.mkdir(parents=True, exist_ok=True)
    write_bytes(path, read_bytes(config.folder / "graph.json"))
    return metrics


def kept_graph(config: RunConfig) -> Path | None:
    """The graph of a run; it is run again if somebody has deleted it. None if the run fails."""
    path = graph_path(config)
    if not path.exists():
        work(Job(config), RUN_AND_KEEP)
    return path if path.exists() else None
