"""Point clouds as PLY and PCD files. A file that is cut off, or says it holds more than it does,
is refused: libraries read on past its end, or fill up with zeros."""

from __future__ import annotations

import re
from collections.abc import Mapping
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from eval.files import check, read_bytes
from slam.core import Array, InputError

MOST_BYTES, MOST_HEAD = 4_000_000_000, 100_000
"""Of a file, and of its head."""
MOST_PACKED = 100
"""Bytes that one byte of a packed PCD can stand for (264 bytes take three)."""
WIDEST = 20_000.0
"""From one end of a cloud to the other [m]; what is larger has another unit, or is damaged."""

Words = list[list[str]]

PLY_TYPES = {
    **{"char": "i1", "uchar": "u1", "short": "i2", "ushort": "u2", "int": "i4", "uint": "u4"},
    **{"int8": "i1", "uint8": "u1", "int16": "i2", "uint16": "u2", "int32": "i4", "uint32": "u4"},
    **{"float": "f4", "double": "f8", "float32": "f4", "float64": "f8"},
}
PCD_TYPES = {"F": "f", "I": "i", "U": "u"}
PLY_ORDERS = {"binary_little_endian": "<", "binary_big_endian": ">", "ascii": ""}


def read_cloud(path: Path) -> Array:
    """The finite points (N, 3) of a PLY or PCD file. Raises InputError."""
    kind = path.suffix.lower()
    check(kind in (".ply", ".pcd"), path, "name", "a .ply or .pcd file")
    points = _ply_points(path) if kind == ".ply" else _pcd_points(path)
    points = points[np.isfinite(points).all(axis=1)]
    check(len(points) > 0, path, "points", "points with finite coordinates")
    near = bool(np.ptp(points, axis=0).max() < WIDEST)
    check(near, path, "points", f"metres, and a cloud of at most {WIDEST:g} m")
    return points


def thinned(points: Array, voxel: float) -> Array:
    """The first point (M, 3) in each voxel of points (N, 3), as it was measured."""
    cells = np.floor((points - points.min(axis=0)) / voxel).astype(np.int64)
    size = cells.max(axis=0) + 1
    _, first = np.unique(np.ravel_multi_index(tuple(cells.T), tuple(size)), return_index=True)
    return points[np.sort(first)]


# --- PLY ------------------------------------------------------------------------------------------


def ply_vertices(path: Path) -> NDArray[np.void]:
    """The records of a PLY file's vertices, which have to come first in it. Raises InputError."""
    data = read_bytes(path, MOST_BYTES)
    found = re.search(rb"^end_header\r?\n", data[:MOST_HEAD], re.MULTILINE)
    check(data[:3] == b"ply" and found is not None, path, "header", "a PLY file")
    assert found is not None
    head, body = data[: found.start()], data[found.end() :]
    words = [line.split() for line in head.decode("ascii", "replace").splitlines()]
    forms = [w[1] for w in words if w[:1] == ["format"] and len(w) == 3]
    check(len(forms) == 1 and forms[0] in PLY_ORDERS, path, "format", ", ".join(PLY_ORDERS))
    count, record = _ply_record(words, PLY_ORDERS[forms[0]], path)
    table = _table_of_lines if forms[0] == "ascii" else _table_of_bytes
    return table(body, count, record, path)


def _ply_record(words: Words, order: str, path: Path) -> tuple[int, np.dtype]:
    """How many vertices there are, and what each holds."""
    elements = [place for place, w in enumerate(words) if w[:1] == ["element"]]
    first = words[elements[0]] if elements else []
    good = len(first) == 3 and first[1] == "vertex" and re.fullmatch(r"\d{1,12}", first[2])
    check(bool(good), path, "header", "element vertex COUNT, before other elements")
    end = elements[1] if len(elements) > 1 else len(words)
    fields = [w for w in words[elements[0] + 1 : end] if w[:1] == ["property"]]
    known = all(len(w) == 3 and w[1] in PLY_TYPES for w in fields)
    unique = len({w[-1] for w in fields}) == len(fields)
    check(known and unique, path, "header", "numbers as properties of a vertex, each named once")
    return int(first[2]), np.dtype([(w[2], order + PLY_TYPES[w[1]]) for w in fields])


def _ply_points(path: Path) -> Array:
    table = ply_vertices(path)
    check({"x", "y", "z"} <= set(table.dtype.names or ()), path, "header", "properties x, y and z")
    return np.column_stack([table[axis].astype(np.float64) for axis in "xyz"])


# --- PCD ------------------------------------------------------------------------------------------


def _pcd_points(path: Path) -> Array:
    data = read_bytes(path, MOST_BYTES)
    found = re.search(rb"^DATA[ \t]+(\w+)[ \t\r]*\n", data[:MOST_HEAD], re.MULTILINE)
    check(found is not None, path, "header", "that of a PCD file, to its line DATA")
    assert found is not None
    head, kind, body = data[: found.start()], found[1].decode(), data[found.end() :]
    words = {w[0]: w[1:] for line in head.decode("latin-1").splitlines() if (w := line.split())}
    count, record = _pcd_record(words, path)
    check({"x", "y", "z"} <= set(record.names or ()), path, "FIELDS", "x, y and z")
    if kind == "binary_compressed":
        return _pcd_unpacked(path, body, count * record.itemsize)
    if kind == "ascii":
        table = _table_of_lines(body, count, record, path)
    else:
        check(kind == "binary", path, "DATA", "ascii, binary or binary_compressed")
        table = _table_of_bytes(body, count, record, path)
    return np.column_stack([table[axis].astype(np.float64) for axis in "xyz"])


def _pcd_record(words: Mapping[str, list[str]], path: Path) -> tuple[int, np.dtype]:
    """How many points there are, and what each holds."""
    names = words.get("FIELDS", [])
    try:
        count = int(words["POINTS"][0])
        counts = [int(c) for c in words.get("COUNT", ["1"] * len(names))]
        record = np.dtype(
            [
                (f"_{place}" if name == "_" else name, f"<{PCD_TYPES[kind]}{int(size)}", (n,))
                for place, (name, kind, size, n) in enumerate(
                    zip(names, words["TYPE"], words["SIZE"], counts, strict=True)
                )
            ]
        )
    except (KeyError, IndexError, ValueError, TypeError) as error:
        raise InputError(f"{path}: header: FIELDS, SIZE, TYPE and POINTS were expected") from error
    good = 0 < count < MOST_BYTES and 0 < record.itemsize < MOST_HEAD
    check(good, path, "header", "points of some bytes each")
    return count, record


def _pcd_unpacked(path: Path, body: bytes, size: int) -> Array:
    """By Open3D, once the file holds as much as it says."""
    packed, unpacked = np.frombuffer(body[:8], "<u4") if len(body) >= 8 else (0, 0)
    good = unpacked == size and 0 < packed <= len(body) - 8 and size <= MOST_PACKED * int(packed)
    check(bool(good), path, "body", f"{size} bytes, packed")
    import open3d as o3d

    with o3d.utility.VerbosityContextManager(o3d.utility.VerbosityLevel.Error):
        return np.asarray(o3d.io.read_point_cloud(path).points)


# --- bodies ---------------------------------------------------------------------------------------


def _table_of_bytes(body: bytes, count: int, record: np.dtype, path: Path) -> NDArray[np.void]:
    size = count * record.itemsize
    check(len(body) >= size, path, "body", f"{size} bytes for {count} points")
    return np.frombuffer(body, dtype=record, count=count)


def _table_of_lines(body: bytes, count: int, record: np.dtype, path: Path) -> NDArray[np.void]:
    """A point a line, its numbers in the record's order."""
    check(len(body) >= 2 * count, path, "body", f"{count} lines for as many points")
    lines = [line for line in body.decode("ascii", "replace").splitlines() if line.strip()]
    check(len(lines) >= count, path, "body", f"{count} lines for as many points")
    width = sum(int(np.prod(record[name].shape)) for name in record.names or ())
    try:
        rows = np.loadtxt(lines[:count], comments=None, ndmin=2) if count else np.empty((0, width))
    except ValueError as error:
        raise InputError(f"{path}: body: numbers were expected: {error}") from error
    check(rows.shape == (count, width), path, "body", f"{width} numbers a line")
    table, column = np.empty(count, dtype=record), 0
    for name in record.names or ():
        shape = record[name].shape
        each = int(np.prod(shape))
        table[name] = rows[:, column : column + each].reshape(count, *shape)
        column += each
    return table
