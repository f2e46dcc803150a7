"""graph.json: a scene graph as nodes and edges, and apart from them their truth.

What enters it, and that it is no image of the factor graph: ``eval.scenegraph``.
"""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike

from eval.files import check, finite, read_json, write_text
from slam.core import Array, InputError

SCHEMA = "roomloop-1"
Json = object  # what json.loads gives; narrowed by the checks below


@dataclass(frozen=True)
class KeyframeNode:
    """T_map_base: (4, 4)."""

    id: str
    T_map_base: Array


@dataclass(frozen=True)
class PlaneNode:
    """n.x + d = 0 in the map; segment: (2, 2) in plan view, of upright planes (of others it means
    nothing); z_range: lowest and highest [m]."""

    id: str
    normal: Array
    d: float
    segment: Array
    z_range: tuple[float, float]


@dataclass(frozen=True)
class WallNode:
    """planes: ids of the nodes of its two planes."""

    id: str
    planes: tuple[str, ...]


@dataclass(frozen=True)
class PieceEntry:
    """A piece of a room: which plane node, from where to where (2, 2) in plan view."""

    plane: str
    segment: Array


@dataclass(frozen=True)
class RoomNode:
    """polygon: (K, 2) or None; centre: (2,); map frame."""

    id: str
    pieces: tuple[PieceEntry, ...]
    polygon: Array | None
    centre: Array
    confidence: float


@dataclass(frozen=True)
class FloorNode:
    """planes: ids of the level planes that lie on it."""

    id: str
    planes: tuple[str, ...] = ()


Node = KeyframeNode | PlaneNode | WallNode | RoomNode | FloorNode


@dataclass(frozen=True)
class GraphEdge:
    """What joins two nodes: the way from one keyframe to the next (odometry), a keyframe that saw
    a plane (observes), or a wall, room or floor and what it is made of. No factor."""

    type: str
    source: str
    target: str


@dataclass(frozen=True)
class SceneGraph:
    """truth: node id -> label; the only part that the simulator's truth enters."""

    nodes: tuple[Node, ...]
    edges: tuple[GraphEdge, ...] = ()
    truth: Mapping[str, str] = field(default_factory=dict)


LAYERS: dict[type, str] = {
    KeyframeNode: "keyframe",
    PlaneNode: "plane",
    WallNode: "wall",
    RoomNode: "room",
    FloorNode: "floor",
}


def graph_json(graph: SceneGraph) -> str:
    """The file's text. Deterministic: one line per node and edge, in the order given."""
    _check_references(graph, "graph.json")
    nodes = [_node_json(node) for node in graph.nodes]
    edges = [{"type": e.type, "from": e.source, "to": e.target} for e in graph.edges]
    return (
        f'{{"schema": {json.dumps(SCHEMA)},\n"nodes": {_lines(nodes)},\n"edges": {_lines(edges)},\n'
        f'"truth": {json.dumps(dict(graph.truth), sort_keys=True, indent=0)}}}\n'
    )


def write_graph(graph: SceneGraph, path: Path) -> None:
    """Write graph.json, whole or not at all. Raises InputError where it cannot."""
    write_text(path, graph_json(graph))


def read_graph(path: Path) -> SceneGraph:
    """Read graph.json, with or without its truth. Raises InputError: file, field, expectation."""
    tree = read_json(path)
    check(tree.get("schema") == SCHEMA, path, "schema", f'"{SCHEMA}"')
    nodes = tuple(
        _node(_mapping(n, path, f"nodes[{i}]"), path, f"nodes[{i}]")
        for i, n in enumerate(_list(tree.get("nodes"), path, "nodes"))
    )
    edges = tuple(
        _edge(_mapping(e, path, f"edges[{i}]"), path, f"edges[{i}]")
        for i, e in enumerate(_list(tree.get("edges"), path, "edges"))
    )
    truth = _mapping(tree.get("truth", {}), path, "truth")
    check(all(isinstance(v, str) for v in truth.values()), path, "truth", "labels as strings")
    graph = SceneGraph(nodes, edges, {key: str(value) for key, value in truth.items()})
    _check_references(graph, str(path))
    return graph


def _check_references(graph: SceneGraph, name: str) -> None:
    ids = [node.id for node in graph.nodes]
    known = set(ids)
    if len(known) < len(ids):
        repeated = next(id for id in ids if ids.count(id) > 1)
        raise InputError(f"{name}: nodes: id {repeated!r} appears twice, unique ids were expected")
    used = [id for edge in graph.edges for id in (edge.source, edge.target)] + list(graph.truth)
    for node in graph.nodes:
        if isinstance(node, WallNode | FloorNode):
            used += node.planes
        elif isinstance(node, RoomNode):
            used += [piece.plane for piece in node.pieces]
    for id in used:
        if id not in known:
            raise InputError(f"{name}: {id!r} is named but no node has that id")


def _lines(items: Sequence[Mapping[str, object]]) -> str:
    return "[\n" + ",\n".join(json.dumps(item, allow_nan=False) for item in items) + "\n]"


def _numbers(array: ArrayLike) -> object:
    """Nanometres and nanoradians: what lies below differs from run to run."""
    return (np.round(np.asarray(array, dtype=np.float64), 9) + 0.0).tolist()


def _node_json(node: Node) -> dict[str, object]:
    head: dict[str, object] = {"id": node.id, "layer": LAYERS[type(node)]}
    match node:
        case KeyframeNode():
            return head | {"T_map_base": _numbers(node.T_map_base)}
        case PlaneNode():
            return head | {
                "normal": _numbers(node.normal),
                "d": _numbers(node.d),
                "segment": _numbers(node.segment),
                "z_range": _numbers(node.z_range),
            }
        case RoomNode():
            pieces = [{"plane": p.plane, "segment": _numbers(p.segment)} for p in node.pieces]
            return head | {
                "pieces": pieces,
                "polygon": None if node.polygon is None else _numbers(node.polygon),
                "centre": _numbers(node.centre),
                "confidence": _numbers(node.confidence),
            }
        case _:
            return head | {"planes": list(node.planes)}


def _node(item: Mapping[str, Json], path: Path, at: str) -> Node:
    id = _text(item, "id", path, at)
    layer = _text(item, "layer", path, at)
    if layer == "keyframe":
        return KeyframeNode(id, _array(item, "T_map_base", (4, 4), path, at))
    if layer == "plane":
        low, high = _array(item, "z_range", (2,), path, at)
        return PlaneNode(
            id,
            _array(item, "normal", (3,), path, at),
            float(_array(item, "d", (), path, at)),
            _array(item, "segment", (2, 2), path, at),
            (float(low), float(high)),
        )
    if layer == "room":
        polygon = item.get("polygon")
        return RoomNode(
            id,
            tuple(
                _piece(_mapping(p, path, f"{at}.pieces[{i}]"), path, f"{at}.pieces[{i}]")
                for i, p in enumerate(_list(item.get("pieces"), path, f"{at}.pieces"))
            ),
            None if polygon is None else _array(item, "polygon", (-1, 2), path, at),
            _array(item, "centre", (2,), path, at),
            float(_array(item, "confidence", (), path, at)),
        )
    check(layer in ("wall", "floor"), path, f"{at}.layer", "keyframe, plane, wall, room or floor")
    planes = _list(item.get("planes"), path, f"{at}.planes")
    check(all(isinstance(p, str) for p in planes), path, f"{at}.planes", "ids of plane nodes")
    ids = tuple(str(p) for p in planes)
    return WallNode(id, ids) if layer == "wall" else FloorNode(id, ids)


def _piece(item: Mapping[str, Json], path: Path, at: str) -> PieceEntry:
    return PieceEntry(_text(item, "plane", path, at), _array(item, "segment", (2, 2), path, at))


def _edge(item: Mapping[str, Json], path: Path, at: str) -> GraphEdge:
    type_, source, target = (_text(item, key, path, at) for key in ("type", "from", "to"))
    return GraphEdge(type_, source, target)


def _mapping(value: Json, path: Path, at: str) -> Mapping[str, Json]:
    if not isinstance(value, dict):
        raise InputError(f"{path}: {at}: an object was expected")
    return value


def _list(value: Json, path: Path, at: str) -> list[Json]:
    if not isinstance(value, list):
        raise InputError(f"{path}: {at}: a list was expected")
    return value


def _text(item: Mapping[str, Json], key: str, path: Path, at: str) -> str:
    value = item.get(key)
    if not isinstance(value, str):
        raise InputError(f"{path}: {at}.{key}: a string was expected")
    return value


def _array(
    item: Mapping[str, Json], key: str, shape: tuple[int, ...], path: Path, at: str
) -> Array:
    """Finite numbers of a shape; -1 stands for any length."""
    return finite(item.get(key), shape, path, f"{at}.{key}")
