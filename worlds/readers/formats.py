"""Which kind of file a building comes in: from its suffix, and from how it begins."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from slam.core import InputError
from slam.plainfile import size_of

HEAD = 4096
"""Bytes that tell what a file is."""


@dataclass(frozen=True)
class Format:
    """A kind of file. suffixes: by which it is known; size: the largest that is read [bytes]."""

    name: str
    suffixes: tuple[str, ...]
    size: int


FORMATS = (
    Format("JSON", (".json",), 50_000_000),
    Format("IFC", (".ifc",), 400_000_000),
    Format("COLLADA", (".dae",), 150_000_000),
    Format("OBJ", (".obj",), 250_000_000),
    Format("STL", (".stl",), 250_000_000),
    Format("PLY", (".ply",), 250_000_000),
    Format("GLB", (".glb",), 250_000_000),
    Format("ROS map", (".yaml", ".yml"), 100_000),
)
NAMED = {kind.name: kind for kind in FORMATS}
NO_MAGIC = ("OBJ", "STL", "ROS map")
"""Formats that any text, or any bytes, might be: their readers find out."""
STARTS = {
    b"ISO-10303-21": "IFC",
    b"glTF": "GLB",
    b"ply": "PLY",
    b"\x89PNG": "PNG",
    b"P5": "PGM",
    b"PK\x03\x04": "ZIP",
    b"\xff\xd8\xff": "JPEG",
    b"%PDF": "PDF",
    b"AC10": "DWG",
    b"\x1f\x8b": "GZIP",
}


def format_of(path: Path) -> Format:
    """The format of a building's file. Raises InputError for what is none, or is too large."""
    head, size = _head(path)
    by_suffix = {suffix: kind for kind in FORMATS for suffix in kind.suffixes}
    kind = by_suffix.get(path.suffix.lower())
    found = _looks_like(head)
    if kind is None:
        kind = NAMED.get(found or "")
    if kind is None:
        raise InputError(f"{path}: expected one of {', '.join(sorted(by_suffix))}{_but(found)}")
    if size == 0:
        raise InputError(f"{path}: expected {kind.name}, found an empty file")
    if size > kind.size:
        raise InputError(
            f"{path}: {size / 1e6:.0f} MB, expected {kind.name} of at most {kind.size / 1e6:.0f} MB"
        )
    if found != kind.name and (found is not None or kind.name not in NO_MAGIC):
        raise InputError(f"{path}: expected {kind.name} by its suffix{_but(found)}")
    return kind


def _but(found: str | None) -> str:
    return f", found what looks like {found}" if found else ", found something else"


def _head(path: Path) -> tuple[bytes, int]:
    """The first bytes of a file, and its size."""
    size = size_of(path)
    try:
        with path.open("rb") as file:
            return file.read(HEAD), size
    except OSError as error:
        raise InputError(f"{path}: cannot be read: {error.strerror or error}") from error


def _looks_like(head: bytes) -> str | None:
    """The name of what a file begins like; None for what may be anything."""
    start = head.removeprefix(b"\xef\xbb\xbf").lstrip()
    for magic, name in STARTS.items():
        if start.startswith(magic):
            return name
    if start.startswith((b"\xff\xfe", b"\xfe\xff")):
        return "text in UTF-16 (expected UTF-8)"
    if start[:1] in (b"{", b"["):
        return "JSON"
    if start[:1] == b"<":
        return "COLLADA" if b"<COLLADA" in head or b"<?xml" in head[:64] else "XML or HTML"
    if start.startswith(b"image:") or b"\nimage:" in head:
        return "ROS map"
    return None
