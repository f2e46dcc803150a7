"""What a detector's rooms and walls become in the graph."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from itertools import combinations
from typing import Generic, TypeVar

import numpy as np

from slam.concepts import RoomNode, WallNode
from slam.core import Array, RoomProposal, WallProposal
from slam.planemap import PlaneMap

Proposal = TypeVar("Proposal", RoomProposal, WallProposal)
Node = TypeVar("Node", RoomNode, WallNode)


class Nodes(Generic[Proposal, Node]):
    """Nodes by their proposals' ids. One that comes as the very object that it came as last time
    has the node that it had, while its planes are in the map."""

    def __init__(self, planes: PlaneMap, made: Callable[[Proposal], Node | None]):
        """made: the node of a proposal; None without the planes that it takes."""
        self._planes = planes
        self._made: Callable[[Proposal], Node | None] = made
        self._known: dict[int, tuple[Proposal, Node]] = {}
        self._lost = 0

    def of(self, proposals: Iterable[Proposal]) -> dict[int, Node]:
        """All that have one."""
        before, known = self._known, {}
        whole, self._lost = self._planes.lost == self._lost, self._planes.lost
        for proposal in proposals:
            name = proposal.id
            entry = before.get(name)
            if entry is None or entry[0] is not proposal or not (whole or self._stands(entry[1])):
                node = self._made(proposal)
                if node is None:
                    continue
                entry = proposal, node
            known[name] = entry
        self._known = known
        return {name: node for name, (_, node) in known.items()}

    def _stands(self, node: Node) -> bool:
        return all(plane in self._planes for plane in node.planes)


def one_in_a_room(
    rooms: Iterable[RoomNode], planes: PlaneMap, apart: float
) -> list[tuple[int, int]]:
    """Pairs (kept, gone) of planes, each in one pair, that are one since they bound one room.

    apart: how far they may lie from each other [m].
    """
    pairs: list[tuple[int, int]] = []
    for node in rooms:
        for a, b in combinations(sorted(node.planes), 2):
            used = {plane for pair in pairs for plane in pair}
            if not {a, b} & used and planes.is_one_in_a_room(a, b, apart):
                pairs.append((a, b))
    return pairs


def room_node(room: RoomProposal, planes: PlaneMap, normals: Array) -> RoomNode | None:
    """None if no plane of it is in the map. normals: (P, 3) of all planes, by id."""
    ids = tuple(dict.fromkeys(piece.plane_id for piece in room.pieces if piece.plane_id in planes))
    if not ids:
        return None
    pairs = opposed_pairs([normals[plane] for plane in ids])
    height = float(np.mean([np.mean(planes.view(plane).z_range) for plane in ids]))
    return RoomNode(ids, pairs, np.append(room.centre, height), room.storey)


def wall_node(wall: WallProposal, planes: PlaneMap) -> WallNode | None:
    """None if it has lost a plane, or is one plane by now."""
    first, second = (piece.plane_id for piece in wall.pieces)
    if first == second or first not in planes or second not in planes:
        return None
    middle = np.mean([piece.segment.mean(axis=0) for piece in wall.pieces], axis=0)
    height = float(np.mean(planes.view(first).z_range))
    return WallNode((first, second), np.append(middle, height))


def opposed_pairs(
    normals: Sequence[Array], tolerance: float = np.radians(20.0)
) -> tuple[tuple[int, int], ...]:
    """Up to two pairs of opposed planes, the second pair across the first.

    normals: (3,) each. What the paper's factors for rooms of four and of two planes need: the most
    nearly opposed pair, and the most nearly opposed one at right angles to it. No pair: empty.
    """
    candidates = sorted(
        (float(normals[i] @ normals[j]), i, j)
        for i in range(len(normals))
        for j in range(i + 1, len(normals))
    )
    chosen: list[tuple[int, int]] = []
    for dot, i, j in candidates:
        across = not chosen or abs(normals[i] @ normals[chosen[0][0]]) < np.sin(tolerance)
        if dot < -np.cos(tolerance) and across and len(chosen) < 2:
            chosen.append((i, j))
    return tuple(chosen)
