"""The files of a run folder: trajectories, map and metrics, each whole or absent.

Readers raise InputError that names the file, the place and what was expected.
"""

from __future__ import annotations

import dataclasses
import json
import math
import types
import typing
from collections.abc import Mapping
from pathlib import Path

import numpy as np

from eval.files import check, finite, read_json, read_text, write_bytes, write_text
from eval.metrics import SCHEMA, Metrics
from eval.score.trajectory import Trajectory
from slam.core import (
    Array,
    InputError,
    IntArray,
    pose,
    quaternion_xyzw,
    rotation_from_quaternion_xyzw,
)
from worlds.fields import shown

# --- trajectories: "stamp x y z qx qy qz qw", one line per pose -----------------------------------


LARGEST = 1e100
"""Number of metrics.json: means and squares of several are numbers still."""
MOST = 1e12
"""Largest stamp or coordinate: squares of it can still be added."""


def write_tum(trajectory: Trajectory, path: Path) -> None:
    """Write a .tum file, six decimals."""
    rows = (
        (stamp, *T[:3, 3], *quaternion_xyzw(T[:3, :3]))
        for stamp, T in zip(trajectory.stamps, trajectory.poses, strict=True)
    )
    lines = (" ".join(f"{round(value, 6) + 0.0:.6f}" for value in row) for row in rows)
    write_text(path, "".join(line + "\n" for line in lines))


def read_tum(path: Path) -> Trajectory:
    """Read a .tum file; lines that start with # are comments. Stamps must ascend."""
    lines = enumerate(read_text(path).splitlines(), start=1)
    rows = [
        _tum_row(text, path, number)
        for number, text in lines
        if text.strip() and not text.lstrip().startswith("#")
    ]
    table = np.array(rows).reshape(-1, 8)
    check(bool((np.diff(table[:, 0]) > 0).all()), path, "stamps", "an ascending order")
    poses = [pose(rotation_from_quaternion_xyzw(row[4:]), row[1:4]) for row in table]
    return Trajectory(table[:, 0], np.array(poses).reshape(-1, 4, 4))


def _tum_row(text: str, path: Path, number: int) -> Array:
    try:
        row = np.array([float(word) for word in text.replace("_", "?").split(maxsplit=8)])
    except ValueError as error:
        raise InputError(f"{path}: line {number}: 8 numbers were expected") from error
    row = finite(row, (8,), path, f"line {number}")
    check(bool(np.abs(row).max() < MOST), path, f"line {number}", f"numbers below {MOST:g}")
    good = abs(float(np.linalg.norm(row[4:])) - 1.0) < 1e-2
    check(good, path, f"line {number}", "a unit quaternion x y z w")
    return row


# --- the map: binary PLY, x y z plane_id ----------------------------------------------------------

_VERTEX = np.dtype([("x", "<f4"), ("y", "<f4"), ("z", "<f4"), ("plane_id", "<i4")])
_HEADER = (
    "ply\nformat binary_little_endian 1.0\ncomment roomloop map, map frame, metres\n"
    "element vertex {count}\nproperty float x\nproperty float y\nproperty float z\n"
    "property int plane_id\nend_header\n"
)


def write_ply(points: Array, plane_id: IntArray, path: Path) -> None:
    """Write points (M, 3) and the planes (M,) they belong to; ``eval.pointfile`` reads them."""
    table = np.empty(len(points), dtype=_VERTEX)
    for axis, name in enumerate("xyz"):
        table[name] = points[:, axis]
    table["plane_id"] = plane_id
    write_bytes(path, _HEADER.format(count=len(points)).encode() + table.tobytes())


# --- metrics.json ---------------------------------------------------------------------------------


def metrics_json(metrics: Metrics) -> str:
    """The file's text; what is not finite is null."""
    return json.dumps(metrics_values(metrics), indent=2, allow_nan=False) + "\n"


def metrics_values(metrics: Metrics) -> object:
    """What the file holds, as JSON has it."""
    return _plain(dataclasses.asdict(metrics))


ADDED = {"consistency.chi2.plumb", "rooms.over_segmented", "rooms.under_segmented"}
"""Keys that results of earlier versions lack: there they do not apply."""


def write_metrics(metrics: Metrics, path: Path) -> None:
    """Write metrics.json, whole or not at all."""
    write_text(path, metrics_json(metrics))


def read_metrics(path: Path) -> Metrics:
    """Read metrics.json. A key that lacks, is unknown, or has the wrong type: InputError."""
    return metrics_of(read_json(path), path)


def metrics_of(tree: Mapping[str, object], path: Path) -> Metrics:
    """The metrics in a JSON object, see ``read_metrics``. path: for errors."""
    check(tree.get("schema") == SCHEMA, path, "schema", f'"{SCHEMA}"')
    metrics = _build(Metrics, tree, path, "")
    assert isinstance(metrics, Metrics)
    return metrics


def _plain(value: object) -> object:
    if isinstance(value, Mapping):
        return {str(key): _plain(item) for key, item in value.items()}
    if isinstance(value, tuple | list):
        return [_plain(item) for item in value]
    if isinstance(value, np.generic):
        return _plain(value.item())
    if isinstance(value, float) and not math.isfinite(value):
        return None
    return value


def _build(kind: type, tree: object, path: Path, at: str) -> object:
    """A dataclass from a JSON object, by its fields' types."""
    check(isinstance(tree, dict), path, at or "file", "an object")
    assert isinstance(tree, dict)
    hints = typing.get_type_hints(kind)
    tree = {key: None for key in hints if at + key in ADDED} | tree
    for key in hints.keys() ^ tree.keys():
        state = "is missing" if key in hints else "is not known"
        raise InputError(f"{path}: {at}{key}: this key {state} in {SCHEMA}")
    values = {key: _value(hint, tree[key], path, at + key) for key, hint in hints.items()}
    return kind(**values)


def _value(hint: object, value: object, path: Path, at: str) -> object:
    if dataclasses.is_dataclass(hint) and isinstance(hint, type):
        return _build(hint, value, path, at + ".")
    options = typing.get_args(hint) if isinstance(hint, types.UnionType) else (hint,)
    if value is None:
        check(type(None) in options, path, at, "a value")
        return None
    if isinstance(value, bool):
        raise InputError(f"{path}: {at}: true or false makes no sense here")
    if float in options and isinstance(value, int | float) and abs(value) < LARGEST:
        return value
    if int in options and isinstance(value, int) and abs(value) < LARGEST:
        return value
    if str in options and isinstance(value, str):
        return value
    if at == "T_world_map":
        return tuple(map(tuple, finite(value, (4, 4), path, at).tolist()))
    if at == "versions" and isinstance(value, dict):
        return value
    raise InputError(f"{path}: {at}: {shown(value)} does not fit, expected {_words(options)}")


def _words(options: tuple[object, ...]) -> str:
    names = {float: "a number", int: "a whole number", str: "a text", type(None): "null"}
    return " or ".join(names.get(kind, "another") for kind in options)  # type: ignore[call-overload]
