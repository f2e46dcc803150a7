"""Valid files made bad: as bytes, as text, as JSON and as arrays; from a Generator."""

from __future__ import annotations

import io
import json
import re
import zipfile
from collections.abc import Iterator

import numpy as np
from numpy.random import Generator

NUMBERS = ("NaN", "inf", "-inf", "1e300", "-1e300", "1e999", "9" * 5000, "-1", "0", "1e-300", '"x"')
VALUES = (
    *(None, True, "", "\u00e9\u0000\U0001f3e0", "x" * 10_000, [], {}, [[]], [None], {"x": 1}),
    *(float("nan"), float("inf"), 1e300, -1e300, 10**400, -1, 0, 0.5, 10**9, 10**18),
)
DEEP = 100_000


def spoilt(whole: bytes, rng: Generator) -> bytes:
    """The file with one thing wrong, whatever it holds."""
    kinds = [cut_off, changed, repeated, swapped]
    if _is_text(whole):
        kinds += [renumbered, renumbered, relined]
    if whole[:1] == b"{":
        kinds += [revalued, revalued, revalued]
    if whole[:2] == b"PK":
        kinds = [cut_off, changed, rearrayed, rearrayed, rearrayed]
    return kinds[rng.integers(len(kinds))](whole, rng)


def always(text: bool) -> Iterator[bytes]:
    """What every reader has to bear: nothing, noise, brackets without end."""
    yield b""
    yield b"\0" * 5000
    yield np.random.default_rng(1).bytes(5000)
    yield b"\xff\xfe" + "{}".encode("utf-16")
    if text:
        yield b"[" * DEEP
        yield b'{"a":' * DEEP
        yield b"a = " + b"[" * DEEP
        yield b"- " * 2000
        yield b"null"
        yield b"9" * 5000
        yield b'{"schema": "roomloop-1"}'


def _is_text(whole: bytes) -> bool:
    return b"\0" not in whole[:2000] and all(byte < 128 for byte in whole[:2000])


# --- bytes ----------------------------------------------------------------------------------------


def cut_off(whole: bytes, rng: Generator) -> bytes:
    """Its beginning."""
    return whole[: rng.integers(len(whole))]


def changed(whole: bytes, rng: Generator) -> bytes:
    """Some bytes are others."""
    data = bytearray(whole)
    for place in rng.integers(len(data), size=rng.integers(1, 6)):
        data[place] = rng.choice([0, 255, rng.integers(256)])
    return bytes(data)


def repeated(whole: bytes, rng: Generator) -> bytes:
    """A part of it stands twice."""
    start, place = rng.integers(len(whole), size=2)
    return whole[:place] + whole[start : start + 200] + whole[place:]


def swapped(whole: bytes, rng: Generator) -> bytes:
    """Four bytes in a row, a count perhaps, are an absurd number."""
    place = int(rng.integers(max(len(whole) - 4, 1)))
    number = rng.choice([0xFFFFFFFF, 0x7FFFFFFF, 0x80000000, 0])
    return whole[:place] + int(number).to_bytes(4, "little") + whole[place + 4 :]


# --- text -----------------------------------------------------------------------------------------


def renumbered(whole: bytes, rng: Generator) -> bytes:
    """One number is an absurd one."""
    text = whole.decode("latin-1")
    found = list(re.finditer(r"-?\d+(\.\d+)?([eE][-+]?\d+)?", text))
    if not found:
        return changed(whole, rng)
    one = found[rng.integers(len(found))]
    number = NUMBERS[rng.integers(len(NUMBERS))]
    return (text[: one.start()] + number + text[one.end() :]).encode("latin-1")


def relined(whole: bytes, rng: Generator) -> bytes:
    """A line is missing, or stands twice."""
    lines = whole.splitlines(keepends=True)
    place = int(rng.integers(len(lines)))
    lines[place : place + 1] = [lines[place]] * int(rng.choice([0, 2]))
    return b"".join(lines)


# --- JSON -----------------------------------------------------------------------------------------


def revalued(whole: bytes, rng: Generator) -> bytes:
    """One value is another, is missing, or stands twice."""
    tree = json.loads(whole)
    places = list(_places(tree))
    above, key = places[rng.integers(len(places))]
    kind = rng.integers(6)
    if kind == 0:
        del above[key]
    elif kind == 1 and isinstance(above, list):
        above.insert(key, above[key])
    else:
        above[key] = VALUES[rng.integers(len(VALUES))]
    return json.dumps(tree).encode()


def _places(tree: object) -> Iterator[tuple]:
    """Every list or object in a tree with every key of it."""
    pairs = tree.items() if isinstance(tree, dict) else enumerate(tree)
    for key, value in pairs:
        yield tree, key
        if isinstance(value, dict | list):
            yield from _places(value)


# --- arrays (npz) ---------------------------------------------------------------------------------


def rearrayed(whole: bytes, rng: Generator) -> bytes:
    """One array has other numbers, another shape or type, or is missing."""
    with np.load(io.BytesIO(whole)) as archive:
        arrays = {name: archive[name] for name in archive.files}
    names = sorted(arrays)
    name = names[rng.integers(len(names))]
    array = arrays.pop(name)
    others = (
        array[: len(array) // 2] if array.ndim else np.zeros(3),
        array.astype(str),
        np.full(array.shape, np.nan),
        np.full(array.shape, 10**9),
        np.full(array.shape, -7),
        array.reshape(-1)[:1],
        np.zeros((0, *array.shape[1:]), array.dtype),
        None,
    )
    other = others[rng.integers(len(others))]
    if other is not None:
        arrays[name] = other
    out = io.BytesIO()
    np.savez(out, **arrays)
    return out.getvalue()


def bomb(whole: bytes, megabytes: int) -> bytes:
    """An npz with one more member, of which its index says that it unpacks to so much."""
    out = io.BytesIO(whole)
    with zipfile.ZipFile(out, "a", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("zeros.npy", bytes(1000))
        archive.filelist[-1].file_size = megabytes * 1_000_000
    return out.getvalue()
