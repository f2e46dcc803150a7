"""Files that are whole or absent, and readers that say what is wrong in one line."""

from __future__ import annotations

import csv
import os
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path

import numpy as np

from slam.core import Array, InputError
from slam.plainfile import size_of
from worlds.fields import parsed_json, read_utf8

MOST_TEXT = 300_000_000
"""Largest text file that is read [bytes]: the graph of 1,000 rooms has about 30 MB."""
MOST_NUMBER = 1e20
"""Largest number in an array that is read: geometry multiplies several; nanoseconds have 1e18."""
MOST_VALUES = 10_000_000
"""Most values in a JSON file: such a graph has three million."""


@contextmanager
def whole_file(path: Path) -> Iterator[Path]:
    """A temporary path beside ``path`` that takes its place when the block ends well.

    If the block fails, nothing remains of it; if the process is killed, at most a hidden temporary
    file does. Raises InputError where the folder cannot be written.
    """
    part = path.with_name(f".{path.name}.{os.getpid()}.part")
    try:
        yield part
        os.replace(part, path)
    except OSError as error:
        raise _unwritable(path, error) from error
    finally:
        part.unlink(missing_ok=True)


def _unwritable(path: Path, error: OSError) -> InputError:
    return InputError(f"{path}: cannot be written: {error.strerror or error}")


def write_bytes(path: Path, data: bytes) -> None:
    """Write a file, whole or not at all."""
    with whole_file(path) as part, part.open("wb") as file:
        file.write(data)
        file.flush()
        os.fsync(file.fileno())


def write_text(path: Path, text: str) -> None:
    """Write a UTF-8 file, whole or not at all."""
    write_bytes(path, text.encode())


def read_bytes(path: Path, most: int | None = None) -> bytes:
    """A file's content. Raises InputError where it cannot be read, or is larger than ``most``."""
    size = size_of(path)
    if most is not None and size > most:
        raise InputError(f"{path}: {size / 1e6:.0f} MB, expected at most {most / 1e6:.0f} MB")
    try:
        return path.read_bytes()
    except OSError as error:
        raise InputError(f"{path}: cannot be read: {error.strerror or error}") from error


def read_text(path: Path) -> str:
    """A text file's content. Raises InputError where it cannot be read."""
    return read_utf8(path, MOST_TEXT)


def read_json(path: Path) -> Mapping[str, object]:
    """A JSON file that holds an object. Raises InputError."""
    tree = parsed_json(path, read_text(path), MOST_VALUES)
    if not isinstance(tree, dict):
        raise InputError(f"{path}: a JSON object was expected")
    return tree


def read_csv(path: Path) -> list[list[str]]:
    """The rows of a table. Raises InputError."""
    try:
        return list(csv.reader(read_text(path).splitlines(), strict=True))
    except csv.Error as error:
        raise InputError(f"{path}: a table (CSV) was expected: {error}") from error


def check(good: bool, path: Path, at: str, expected: str) -> None:
    """Raise InputError that names the file, the field and what was expected."""
    if not good:
        raise InputError(f"{path}: {at}: {expected} was expected")


def finite(value: object, shape: tuple[int, ...], path: Path, at: str) -> Array:
    """Numbers as a float64 array of ``shape`` (-1: any length), within +-``MOST_NUMBER``. Raises
    InputError."""
    wanted = " x ".join("n" if size < 0 else str(size) for size in shape)
    expected = f"{wanted} finite numbers" if shape else "a finite number"
    try:
        raw = np.array(value)
        array = raw.astype(np.float64)
    except (ValueError, TypeError, OverflowError) as error:
        raise InputError(f"{path}: {at}: {expected} expected") from error
    good = raw.dtype.kind in "if" and raw.ndim == len(shape)
    good = good and all(w in (-1, n) for w, n in zip(shape, raw.shape, strict=True))
    if not good or not (np.abs(array) < MOST_NUMBER).all():
        raise InputError(f"{path}: {at}: {expected} expected")
    return array


def make_folder(folder: Path) -> None:
    """Makes a folder and what it is to stand in, unless it is there. Raises InputError."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise _unwritable(folder, error) from error


def claim_new(folder: Path) -> None:
    """InputError unless a new folder can be made there; makes what it is to stand in."""
    if folder.exists():
        raise InputError(f"out: {folder} exists, a new folder was expected")
    make_folder(folder.parent)
