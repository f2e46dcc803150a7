"""Files of other systems: rooms as JSON, and Spark-DSG scene graphs as JSON.

Readers raise InputError that names the file, the place and what was expected.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import shapely
from shapely.geometry import Point, Polygon

from eval.files import check, finite, read_bytes, read_json
from eval.score.trajectory import Trajectory
from slam.core import Array, pose, rotation_from_quaternion_xyzw

ROOMS_LAYER = 4
"""Of a Spark-DSG file that does not name its layers."""

MOST_ROOMS = 20_000
"""Most rooms that are scored."""

Json = Mapping[str, object]


@dataclass(frozen=True)
class ForeignRoom:
    """A room of another system: its centre (2,), and its outline (K, 2) where it has one."""

    centre: Array
    polygon: Array | None


@dataclass(frozen=True)
class ForeignGraph:
    """What a Spark-DSG file says of rooms, and the poses of its robot (None: no agent layer)."""

    rooms: tuple[ForeignRoom, ...]
    trajectory: Trajectory | None


# --- rooms ----------------------------------------------------------------------------------------


def read_rooms(path: Path) -> tuple[ForeignRoom, ...]:
    """``{"rooms": [{"polygon": [[x, y], ...]}, {"centre": [x, y]}, ...]}``, in metres."""
    entries = read_json(path).get("rooms")
    check(isinstance(entries, list), path, "rooms", "a list")
    assert isinstance(entries, list)
    check(len(entries) <= MOST_ROOMS, path, "rooms", f"at most {MOST_ROOMS}")
    return tuple(_room(entry, path, f"rooms[{place}]") for place, entry in enumerate(entries))


def _room(entry: object, path: Path, at: str) -> ForeignRoom:
    check(isinstance(entry, dict), path, at, "an object with a polygon or a centre")
    assert isinstance(entry, dict)
    unknown = sorted(entry.keys() - {"polygon", "centre", "center", "id", "name"})
    check(not unknown, path, f"{at}.{''.join(unknown[:1])}", "polygon, centre, id or name")
    centre = entry.get("centre", entry.get("center"))
    check("polygon" in entry or centre is not None, path, at, "a polygon or a centre")
    polygon = _outline(entry["polygon"], path, f"{at}.polygon") if "polygon" in entry else None
    if centre is not None:
        return ForeignRoom(finite(centre, (2,), path, f"{at}.centre"), polygon)
    assert polygon is not None
    return ForeignRoom(np.array(Polygon(polygon).centroid.coords[0]), polygon)


def _outline(value: object, path: Path, at: str) -> Array:
    polygon = finite(value, (-1, 2), path, at)
    check(len(polygon) >= 3 and Polygon(polygon).area > 0.0, path, at, "three corners or more")
    return polygon


# --- Spark-DSG ------------------------------------------------------------------------------------


def read_dsg(path: Path) -> ForeignGraph:
    """The rooms and the robot's poses of a scene graph that Hydra (Spark-DSG 1.x) saved as JSON.

    A room's outline is the ``polygon`` of its metadata or, without one, the union of the free
    spheres of its places, seen from above. With several robots it is the first one's poses.
    """
    text = read_bytes(path)[:64]
    check(b"SPARK_DSG" not in text or text.lstrip()[:1] == b"{", path, "format", "JSON, not binary")
    tree = read_json(path)
    check(isinstance(tree.get("nodes"), list), path, "nodes", "a Spark-DSG file's list of nodes")
    check(isinstance(tree.get("edges"), list), path, "edges", "a Spark-DSG file's list of edges")
    nodes = {_id(node, path, place): node for place, node in enumerate(_objects(tree["nodes"]))}
    children = _children(tree, nodes, path)
    layer = _rooms_layer(tree)
    rooms = [
        _dsg_room(node, [nodes[child] for child in children.get(name, ())], path)
        for name, node in nodes.items()
        if node.get("layer") == layer and node.get("partition", 0) == 0
    ]
    return ForeignGraph(tuple(rooms), _agent(nodes, path))


def _objects(value: object) -> list[Json]:
    assert isinstance(value, list)
    return [item if isinstance(item, dict) else {} for item in value]


def _id(node: Json, path: Path, place: int) -> int:
    name = node.get("id")
    good = type(name) is int and isinstance(node.get("attributes"), dict)
    check(good, path, f"nodes[{place}]", "an object with id, layer and attributes")
    assert isinstance(name, int)
    return name


def _rooms_layer(tree: Json) -> int:
    names = tree.get("layer_names")
    rooms = names.get("ROOMS") if isinstance(names, dict) else None
    layer = rooms.get("layer") if isinstance(rooms, dict) else rooms
    return layer if isinstance(layer, int) else ROOMS_LAYER


def _children(tree: Json, nodes: Mapping[int, Json], path: Path) -> dict[int, list[int]]:
    """Places by the rooms that hold them."""
    children: dict[int, list[int]] = {}
    for place, edge in enumerate(_objects(tree["edges"])):
        ends = (edge.get("source"), edge.get("target"))
        good = all(type(end) is int and end in nodes for end in ends)
        check(good, path, f"edges[{place}]", "ids of two nodes")
        for parent, child in (ends, ends[::-1]):
            if _kind(nodes[child]) == "PlaceNodeAttributes":  # type: ignore[index]
                children.setdefault(parent, []).append(child)  # type: ignore[arg-type]
    return children


def _kind(node: Json) -> object:
    attributes = node["attributes"]
    return attributes.get("type") if isinstance(attributes, dict) else None


def _attributes(node: Json) -> Json:
    attributes = node["attributes"]
    assert isinstance(attributes, dict)
    return attributes


def _dsg_room(node: Json, places: Sequence[Json], path: Path) -> ForeignRoom:
    attributes, at = _attributes(node), f"node {node['id']}"
    centre = finite(attributes.get("position"), (3,), path, f"{at}: position")[:2]
    metadata = attributes.get("metadata")
    if isinstance(metadata, dict) and "polygon" in metadata:
        return ForeignRoom(centre, _outline(metadata["polygon"], path, f"{at}: polygon"))
    discs = [_disc(place, path) for place in places]
    union = shapely.union_all([disc for disc in discs if disc.area > 0.0])
    parts = list(getattr(union, "geoms", [union]))
    largest = max(parts, key=lambda part: part.area, default=None)
    if largest is None or largest.area == 0.0:
        return ForeignRoom(centre, None)
    return ForeignRoom(centre, np.array(largest.exterior.coords)[:-1])


def _disc(place: Json, path: Path) -> Polygon:
    """A place's free sphere, seen from above."""
    attributes, at = _attributes(place), f"node {place['id']}"
    position = finite(attributes.get("position"), (3,), path, f"{at}: position")
    radius = float(finite(attributes.get("distance", 0.0), (), path, f"{at}: distance"))
    return Point(*position[:2]).buffer(max(radius, 0.0))


def _agent(nodes: Mapping[int, Json], path: Path) -> Trajectory | None:
    agents = [node for node in nodes.values() if _kind(node) == "AgentNodeAttributes"]
    if not agents:
        return None
    # The letter of an id says which robot it is.
    first = min(int(str(node["id"])) >> 56 for node in agents)
    own = [_agent_pose(n, path) for n in agents if int(str(n["id"])) >> 56 == first]
    own.sort(key=lambda stamped: stamped[0])
    stamps = np.array([stamp for stamp, _ in own])
    check(bool((np.diff(stamps) > 0.0).all()), path, "agents", "different timestamps")
    return Trajectory(stamps, np.array([T for _, T in own]))


def _agent_pose(node: Json, path: Path) -> tuple[float, Array]:
    attributes, at = _attributes(node), f"node {node['id']}"
    stamp = float(finite(attributes.get("timestamp"), (), path, f"{at}: timestamp")) * 1e-9
    position = finite(attributes.get("position"), (3,), path, f"{at}: position")
    turn = attributes.get("world_R_body")
    check(isinstance(turn, dict), path, f"{at}: world_R_body", "a quaternion w, x, y, z")
    assert isinstance(turn, dict)
    q_xyzw = finite([turn.get(key) for key in "xyzw"], (4,), path, f"{at}: world_R_body")
    unit = abs(float(np.linalg.norm(q_xyzw)) - 1.0) < 1e-2
    check(unit, path, f"{at}: world_R_body", "a unit quaternion")
    return stamp, pose(rotation_from_quaternion_xyzw(q_xyzw), position)
