"""The folder of a run: who may write to it, and config.json, which marks it as ours."""

from __future__ import annotations

import json
import os
from dataclasses import asdict, fields
from pathlib import Path

from eval.config import RunConfig
from eval.files import check, read_json, write_text
from eval.metrics import SCHEMA
from slam.core import InputError

CONFIG_FILE = "config.json"
RUN_FILES = (
    "metrics.json",
    "trajectory.tum",
    "odometry.tum",
    "truth.tum",
    "map.ply",
    "graph.json",
    "plan.png",
    "report.html",
    "recording.rrd",
)


def config_text(config: RunConfig) -> str:
    """The contents of config.json: the schema and the fields of ``RunConfig``."""
    values = {"schema": SCHEMA} | asdict(config)
    for name in ("out", "cache"):
        path = values[name]
        values[name] = None if path is None else str(path)
    return json.dumps(values, indent=2) + "\n"


def read_config(path: Path) -> RunConfig:
    """The RunConfig in a config.json, or in a run's folder: to run it again. Raises InputError."""
    path = path / CONFIG_FILE if path.is_dir() else path
    values = dict(read_json(path))
    check(values.pop("schema", None) == SCHEMA, path, "schema", repr(SCHEMA))
    names = {item.name for item in fields(RunConfig)}
    for name in values.keys() - names:
        check(False, path, name, f"one of {', '.join(sorted(names))}")
    check("scene" in values, path, "scene", "a scene")
    try:
        return RunConfig(**values)  # type: ignore[arg-type]  # RunConfig checks the types
    except InputError as error:
        raise InputError(f"{path}: {error}") from error


def check_folder(folder: Path) -> None:
    """InputError unless a run may write to ``folder``: absent, empty, or left by an earlier run.

    Changes nothing, so ask before anything expensive starts.
    """
    if folder.exists() and not folder.is_dir():
        raise InputError(f"out: {folder} is a file, a folder was expected")
    place = next(place for place in (folder, *folder.absolute().parents) if place.exists())
    if not place.is_dir() or not os.access(place, os.R_OK | os.W_OK | os.X_OK):
        raise InputError(f"out: {folder} cannot be written: no permission in {place}")
    if folder.is_dir() and any(folder.iterdir()) and not _is_ours(folder):
        raise InputError(
            f"out: {folder} holds files but no {CONFIG_FILE} of a run; "
            "a new or empty folder or one of an earlier run was expected"
        )


def _is_ours(folder: Path) -> bool:
    try:
        return read_json(folder / CONFIG_FILE).get("schema") == SCHEMA
    except InputError:
        return False


def claim_folder(config: RunConfig) -> Path:
    """The run's folder: made, cleared of an earlier run's files, and marked with config.json.

    Files that no run writes stay. Call it when nothing can be refused any more.
    """
    folder = config.folder
    check_folder(folder)
    try:
        folder.mkdir(parents=True, exist_ok=True)
        for path in (*(folder / name for name in RUN_FILES), *folder.glob(".*.part")):
            path.unlink(missing_ok=True)
    except OSError as error:
        raise InputError(f"out: {folder} cannot be written: {error.strerror or error}") from error
    write_text(folder / CONFIG_FILE, config_text(config))
    return folder
