"""The estimated scene graph, drawn layer above layer; only what changed is drawn again.

Below ``world/map``: ``planes/ID``, ``walls/ID`` and ``rooms/ID`` where they are; below
``world/map/graph`` the nodes of walls, rooms and floors, lifted and joined to what they are made
of.
"""

from __future__ import annotations

from collections.abc import Callable, Hashable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import rerun as rr

from eval.view import shapes
from slam.core import Array, MapPlane, MapView, Proposals, RoomProposal, WallProposal

Log = Callable[[str, Any], None]

MAP, GRAPH = "world/map", "world/map/graph"


@dataclass(frozen=True)
class LayerConfig:
    """Heights of the layers' nodes above the highest storey's floor [m], by how much more those of
    each storey above the first, how fine changes are told, and change of a storey's height that
    moves them [m].

    scale: of heights and nodes; large buildings are looked at from farther away.
    """

    walls: float = 3.8
    rooms: float = 6.0
    floor: float = 9.0
    storey: float = 1.2
    change: float = 0.02
    settled: float = 0.3
    scale: float = 1.0


class Layers:
    """Draws answers of the detector over the map that they speak of."""

    def __init__(self, log: Log, config: LayerConfig = LayerConfig()):
        self._log = log
        self._config = config
        self._drawn: dict[str, Hashable] = {}
        self._revisions: dict[int, int] = {}
        self._ground = {0: 0.0}

    def draw(self, view: MapView, proposals: Proposals) -> None:
        """The map as it is now; what is gone is cleared."""
        planes = {plane.id: plane for plane in view.planes}
        self._stand(_grounds(view))
        wanted: set[str] = set()
        for plane in view.planes:
            wanted.add(self._plane(plane))
        for wall in proposals.walls:
            if all(piece.plane_id in planes for piece in wall.pieces):
                wanted.add(self._wall(wall, planes))
        for room in proposals.rooms:
            wanted.add(self._room(room, planes))
        for storey in {room.storey for room in proposals.rooms}:
            wanted.add(self._floor([room for room in proposals.rooms if room.storey == storey]))
        for gone in self._drawn.keys() - wanted:
            self._log(f"{MAP}/{gone}", rr.Clear(recursive=True))
            self._log(f"{GRAPH}/{gone}", rr.Clear(recursive=True))
        self._drawn = {entity: self._drawn[entity] for entity in wanted}
        self._revisions = {plane.id: plane.revision for plane in view.planes}

    def _stand(self, ground: dict[int, float]) -> None:
        """Heights of the storeys' floors; where they change, all nodes do."""
        same = ground.keys() == self._ground.keys() and all(
            abs(z - self._ground[storey]) < self._config.settled for storey, z in ground.items()
        )
        if not same:
            self._ground = ground
            self._drawn = dict.fromkeys(self._drawn)

    def _is_new(self, entity: str, state: Hashable) -> bool:
        changed = self._drawn.get(entity) != state
        self._drawn[entity] = state
        return changed

    def _grid(self, *points: Array) -> bytes:
        """Points on a grid as coarse as the changes that are told."""
        flat = np.concatenate([np.ravel(part) for part in points])
        return np.rint(flat / self._config.change).astype(np.int32).tobytes()

    def _lifted(self, at: Array, height: float, storey: int) -> Array:
        """A node (3,) above a point (2,), and above the building."""
        lift = (height + storey * self._config.storey) * self._config.scale
        return np.append(at, max(self._ground.values()) + lift)

    def _node(
        self, at: Array, radius: float, colour: shapes.Colour, label: str | None = None
    ) -> Any:
        size = [radius * self._config.scale]
        labels = None if label is None else [label]
        return rr.Points3D([at], radii=size, colors=[colour], labels=labels, show_labels=True)

    def _plane(self, plane: MapPlane) -> str:
        entity = f"planes/{plane.id}"
        if entity in self._drawn and self._revisions.get(plane.id) == plane.revision:
            return entity
        strips = shapes.plane_strips(plane)
        if self._is_new(entity, self._grid(*strips)):
            colour = shapes.FAINT if plane.horizontal else shapes.colour_of(plane.id)
            self._log(f"{MAP}/{entity}", shapes.lines(strips, colour))
        return entity

    def _wall(self, wall: WallProposal, planes: dict[int, MapPlane]) -> str:
        entity = f"walls/{wall.id}"
        first, second = wall.pieces
        middles = [shapes.piece_middle(planes[p.plane_id], p) for p in wall.pieces]
        if self._is_new(entity, self._grid(first.segment, second.segment, *middles)):
            spans = np.array([planes[piece.plane_id].z_range for piece in wall.pieces])
            span = float(spans[:, 0].min()), float(spans[:, 1].max())
            storey = planes[first.plane_id].storey
            node = self._lifted(np.mean(middles, axis=0)[:2], self._config.walls, storey)
            grey = shapes.GREY
            self._log(
                f"{MAP}/{entity}/slab", shapes.slab(first.segment, second.segment, span, grey)
            )
            self._log(f"{GRAPH}/{entity}/node", self._node(node, 0.16, grey))
            self._log(
                f"{GRAPH}/{entity}/edges", shapes.lines([[node, m] for m in middles], grey, 0.01)
            )
        return entity

    def _room(self, room: RoomProposal, planes: dict[int, MapPlane]) -> str:
        entity = f"rooms/{room.id}"
        pieces = [piece for piece in room.pieces if piece.plane_id in planes]
        ends = np.array([piece.segment for piece in pieces]).reshape(-1, 2)
        outline = np.zeros((0, 2)) if room.polygon is None else room.polygon
        corners = self._grid(outline, ends, room.centre)
        if self._is_new(entity, (corners, round(room.confidence, 2))):
            colour = shapes.colour_of(room.id)
            node = self._lifted(room.centre, self._config.rooms, room.storey)
            ground = self._ground.get(room.storey, 0.0)
            label = f"room {room.id} ({room.confidence:.2f})"
            self._log(f"{GRAPH}/{entity}/node", self._node(node, 0.35, colour, label))
            # A detector without planes still has a place to point at.
            feet = [shapes.piece_middle(planes[p.plane_id], p) for p in pieces]
            feet = feet or [np.append(room.centre, ground)]
            self._log(
                f"{GRAPH}/{entity}/edges", shapes.lines([[node, m] for m in feet], colour, 0.012)
            )
            sides = [shapes.rectangle(p.segment, planes[p.plane_id].z_range) for p in pieces]
            self._log(f"{MAP}/{entity}/sides", shapes.lines(sides, colour, 0.03))
            self._log(
                f"{MAP}/{entity}/floor", shapes.floor_polygon(outline, ground + 0.02, colour, 90)
            )
        return entity

    def _floor(self, on_it: Sequence[RoomProposal]) -> str:
        """The node of a storey, by its rooms."""
        storey = on_it[0].storey
        entity = f"floors/{storey}"
        centres = np.array([room.centre for room in on_it])
        if self._is_new(entity, self._grid(centres)):
            node = self._lifted(centres.mean(axis=0), self._config.floor, storey)
            rooms = [self._lifted(centre, self._config.rooms, storey) for centre in centres]
            name = "floor" if len(self._ground) == 1 else f"floor {storey}"
            self._log(f"{GRAPH}/{entity}/node", self._node(node, 0.45, shapes.PINK, name))
            self._log(
                f"{GRAPH}/{entity}/edges", shapes.lines([[node, r] for r in rooms], shapes.PINK)
            )
        return entity


def _grounds(view: MapView) -> dict[int, float]:
    """Height of each storey's floor [m], where most of its walls begin; the first one's is 0."""
    feet: dict[int, list[float]] = {}
    for plane in view.planes:
        if plane.storey > 0 and not plane.horizontal:
            feet.setdefault(plane.storey, []).append(plane.z_range[0])
    return {0: 0.0, **{storey: float(np.median(heights)) for storey, heights in feet.items()}}
