"""The folder of a run: who may write to it, and config.json, which marks it as ours."""

from __future__ import annotations

import json
import os
from collections.abc import Mapping
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
    "rooms.csv",
    "plan.png",
    "report.html",
    "recording.rrd",
    "table.csv",
    "verdict.json",
)


def config_text(config: RunConfig) -> str:
    """The contents of config.json: the schema and the fields of ``RunConfig``."""
    return json.dumps({"schema": SCHEMA} | config_values(config), indent=2) + "\n"


def config_values(config: RunConfig) -> dict[str, object]:
    """The fields of a configuration as JSON has them."""
    return {k: str(v) if isinstance(v, Path) else v for k, v in asdict(config).items()}


def read_config(path: Path) -> RunConfig:
    """The RunConfig in a config.json, or in a run's folder: to run it again. Raises InputError."""
    path = path / CONFIG_FILE if path.is_dir() else path
    return _config(dict(read_json(path)), path)


def config_in(text: str, path: Path) -> RunConfig:
    """The RunConfig in a text of ``config_text`` that stands in ``path``. Raises InputError."""
    try:
        values = json.loads(text)
    except ValueError as error:
        raise InputError(f"{path}: config: expected JSON: {error}") from error
    check(isinstance(values, dict), path, "config", "an object")
    return _config(values, path)


def _config(values: dict[str, object], path: Path) -> RunConfig:
    check(values.pop("schema", None) == SCHEMA, path, "schema", repr(SCHEMA))
    return config_of(values, path)


def config_of(values: Mapping[str, object], path: Path) -> RunConfig:
    """The RunConfig with these fields. Raises InputError that names the file."""
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
    clear_folder(folder)
    write_text(folder / CONFIG_FILE, config_text(config))
    return folder


def clear_folder(folder: Path) -> None:
    """Makes a folder, and deletes what an earlier run wrote there. Raises InputError."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
        for path in (*(folder / name for name in RUN_FILES), *folder.glob(".*.part")):
            path.unlink(missing_ok=True)
    except OSError as error:
        raise InputError(f"out: {folder} cannot be written: {error.strerror or error}") from error
