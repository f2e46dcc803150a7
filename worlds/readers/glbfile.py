"""What a GLB says of itself, looked at before memory is made for it."""

from __future__ import annotations

import struct
from pathlib import Path

from slam.core import InputError
from worlds.fields import MAX_VALUES, parsed_json, shown

MAX_ELEMENTS = 20_000_000
"""Most elements (points, indices) of all accessors: one without a buffer is as many zeros, which
take no byte of the file."""
MAX_NODES, MAX_DEPTH = 200_000, 100
"""Most nodes of a scene, and how deep one may lie below another."""
JSON_CHUNK = 0x4E4F534A


def check_glb(data: bytes, path: Path) -> None:
    """Raises InputError for a file that does not begin with a sound JSON chunk, and for one whose
    accessors count more than ``MAX_ELEMENTS`` or whose nodes lie within each other without end."""
    if len(data) < 20:
        raise InputError(f"{path}: expected GLB, found a file that is cut off")
    length, kind = struct.unpack("<II", data[12:20])
    if kind != JSON_CHUNK or len(data) < 20 + length:
        raise InputError(f"{path}: expected GLB: its first chunk is no JSON, or cut off")
    tree = parsed_json(path, data[20 : 20 + length].decode("utf-8", "replace"), MAX_VALUES)
    _check_counts(_objects(tree, "accessors"), path)
    _check_nodes(_objects(tree, "nodes"), path)


def _objects(tree: object, key: str) -> list[dict[str, object]]:
    """The list of objects of this name; what is none is left to the parser."""
    found = tree.get(key) if isinstance(tree, dict) else None
    listed = found if isinstance(found, list) else []
    return [one if isinstance(one, dict) else {} for one in listed]


def _check_counts(accessors: list[dict[str, object]], path: Path) -> None:
    total = 0
    for accessor in accessors:
        count = accessor.get("count", 0)
        if not isinstance(count, int) or count < 0:
            raise InputError(f"{path}: accessors: expected a count, found {shown(count)}")
        total += count
    if total > MAX_ELEMENTS:
        raise InputError(f"{path}: accessors: expected at most {MAX_ELEMENTS} elements in all")


def _check_nodes(nodes: list[dict[str, object]], path: Path) -> None:
    children = [_children(node, len(nodes)) for node in nodes]
    level, depth = set(range(len(nodes))), 0
    while level and depth <= MAX_DEPTH:
        level = {child for node in level for child in children[node]}
        depth += 1
    if level or len(nodes) > MAX_NODES:
        raise InputError(f"{path}: nodes: expected a scene, found one without end")


def _children(node: dict[str, object], count: int) -> list[int]:
    listed = node.get("children")
    places = listed if isinstance(listed, list) else []
    return [place for place in places if isinstance(place, int) and 0 <= place < count]
