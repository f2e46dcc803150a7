"""The scene graph of a run as it is written to graph.json.

It is made of the final map's keyframes and planes and of the detector's last word on that map, its
rooms and walls: not of the variables of the factor graph (``slam.graph``), which that word has not
entered any more.
"""

from __future__ import annotations

from collections.abc import Mapping
from itertools import pairwise

from eval.graphfile import (
    FloorNode,
    GraphEdge,
    KeyframeNode,
    Node,
    PieceEntry,
    PlaneNode,
    RoomNode,
    SceneGraph,
    WallNode,
)
from slam.core import HORIZONTAL, MapView, Proposals

LETTERS = {"keyframe": "x", "plane": "p", "wall": "w", "room": "r", "floor": "f"}
"""First letter of a node's id, by layer."""


def node_id(layer: str, number: int) -> str:
    """Id of a node in graph.json: p12."""
    return f"{LETTERS[layer]}{number}"


def scene_graph(
    view: MapView, proposals: Proposals, truth: Mapping[tuple[str, int], str]
) -> SceneGraph:
    """Nodes and edges of all layers. view: the final map; proposals: the detector's last word on
    it; truth: (layer, id) -> label."""
    nodes: list[Node] = [
        KeyframeNode(node_id("keyframe", k.id), k.T_map_base) for k in view.keyframes
    ]
    for plane in view.planes:
        name = node_id("plane", plane.id)
        nodes.append(PlaneNode(name, plane.normal, plane.d, plane.segment, plane.z_range))
    for wall in proposals.walls:
        planes = tuple(node_id("plane", piece.plane_id) for piece in wall.pieces)
        nodes.append(WallNode(node_id("wall", wall.id), planes))
    for room in proposals.rooms:
        pieces = tuple(PieceEntry(node_id("plane", p.plane_id), p.segment) for p in room.pieces)
        nodes.append(
            RoomNode(node_id("room", room.id), pieces, room.polygon, room.centre, room.confidence)
        )
    floors: dict[int, list[str]] = {storey: [] for storey in sorted(_storeys(view, proposals))}
    for plane in view.planes:
        if plane.normal[2] > HORIZONTAL:
            floors[plane.storey].append(node_id("plane", plane.id))
    nodes += [FloorNode(node_id("floor", s), tuple(planes)) for s, planes in floors.items()]
    labels = {node_id(layer, number): label for (layer, number), label in truth.items()}
    return SceneGraph(tuple(nodes), tuple(_edges(view, proposals)), labels)


def _edges(view: MapView, proposals: Proposals) -> list[GraphEdge]:
    keyframes = [node_id("keyframe", k.id) for k in view.keyframes]
    edges = [GraphEdge("odometry", a, b) for a, b in pairwise(keyframes)]
    edges += [
        GraphEdge("observes", node_id("keyframe", int(k)), node_id("plane", plane.id))
        for plane in view.planes
        for k in plane.keyframes
    ]
    for wall in proposals.walls:
        edges += [
            GraphEdge("wall", node_id("wall", wall.id), node_id("plane", piece.plane_id))
            for piece in wall.pieces
        ]
    for room in proposals.rooms:
        planes = dict.fromkeys(piece.plane_id for piece in room.pieces)
        edges += [GraphEdge("room", node_id("room", room.id), node_id("plane", p)) for p in planes]
        floor = node_id("floor", room.storey)
        edges.append(GraphEdge("floor", floor, node_id("room", room.id)))
    return edges


def _storeys(view: MapView, proposals: Proposals) -> set[int]:
    """Those that have planes or rooms; the first one always."""
    return {0, *(p.storey for p in view.planes), *(room.storey for room in proposals.rooms)}
