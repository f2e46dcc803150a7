"""One run of many: what names it, and the row that comes of it."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache, cached_property
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path

from eval.artefact import code_hash
from eval.config import RunConfig
from eval.files import check
from eval.folder import config_of, config_values
from eval.metrics import SCHEMA, Metrics
from eval.outputs import metrics_of, metrics_values
from worlds.catalogue import scene_sha256

PACKAGES = ("numpy", "scipy", "shapely", "mujoco", "open3d", "kiss-icp", "gtsam", "torch")
NOT_OF_THE_RESULT = ("out", "save", "cache")
"""Fields of a configuration that change nothing in the metrics."""
AROUND_THE_RUN = ("cli", "foreign", "picture", "screen", "sinks", "score/foreign")
"""Modules of eval that change nothing in them either; of its folders only score does."""


@cache
def fingerprint() -> str:
    """Of all that computes a run: our sources, the trained weights, and the libraries' versions."""
    root = Path(__file__).parents[2]
    ours = sorted([*(root / "eval").glob("*.py"), *(root / "eval" / "score").glob("*.py")])
    around = {root / "eval" / f"{name}.py" for name in AROUND_THE_RUN}
    files = [path for path in ours if path not in around]
    files += sorted((root / "semantics").rglob("*.npz"))
    parts = [code_hash(package) for package in ("worlds", "sim", "slam", "semantics")]
    parts += [hashlib.sha256(path.read_bytes()).hexdigest() for path in files]
    return hashlib.sha256("\n".join([*parts, *map(_version, PACKAGES)]).encode()).hexdigest()


def _version(package: str) -> str:
    try:
        return f"{package} {version(package)}"
    except PackageNotFoundError:
        return package


@dataclass(frozen=True)
class Job:
    """A run to be done. Two jobs with one key are the same run."""

    config: RunConfig

    @cached_property
    def key(self) -> str:
        """32 hexadecimal digits of all that the result depends on. Raises InputError."""
        values = config_values(self.config)
        for name in (*NOT_OF_THE_RESULT, "scene"):
            del values[name]
        parts = [fingerprint(), scene_sha256(self.config.scene)]
        plugins = (self.config.detector, self.config.odometry)
        parts += [code_hash(name.partition(":")[0]) for name in plugins if ":" in name]
        text = "\n".join([*parts, json.dumps(values, sort_keys=True)])
        return hashlib.sha256(text.encode()).hexdigest()[:32]


@dataclass(frozen=True)
class Row:
    """What came of a run. status: complete | failed; error: one line where it failed; seconds: of
    wall time; metrics: None if it failed before there was anything to score."""

    config: RunConfig
    status: str
    error: str | None
    seconds: float
    metrics: Metrics | None


def row_text(row: Row) -> str:
    """A row as JSON."""
    tree = {
        "schema": SCHEMA,
        "config": config_values(row.config),
        "status": row.status,
        "error": row.error,
        "seconds": row.seconds,
        "metrics": None if row.metrics is None else metrics_values(row.metrics),
    }
    return json.dumps(tree, indent=1, allow_nan=False) + "\n"


def row_of(tree: Mapping[str, object], path: Path) -> Row:
    """A row from its JSON. Raises InputError that names the file."""
    check(tree.get("schema") == SCHEMA, path, "schema", f'"{SCHEMA}"')
    config, metrics = tree.get("config"), tree.get("metrics")
    status, error, seconds = tree.get("status"), tree.get("error"), tree.get("seconds")
    check(isinstance(config, Mapping), path, "config", "an object")
    check(status in ("complete", "failed"), path, "status", "complete or failed")
    check(error is None or isinstance(error, str), path, "error", "a text or null")
    check(isinstance(seconds, int | float), path, "seconds", "a number")
    check(metrics is None or isinstance(metrics, Mapping), path, "metrics", "an object or null")
    return Row(
        config=config_of(config, path),  # type: ignore[arg-type]
        status=str(status),
        error=error,  # type: ignore[arg-type]
        seconds=float(seconds),  # type: ignore[arg-type]
        metrics=None if metrics is None else metrics_of(metrics, path),  # type: ignore[arg-type]
    )
