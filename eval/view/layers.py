"""The estimated scene graph, drawn layer above layer; only what changed is drawn again.

Below ``world/map``: ``planes/ID``, ``walls/ID`` and ``rooms/ID`` where they are; below
``world/map/graph`` the nodes of walls, rooms and floor, lifted and joined to what they are made of.
"""

from __future__ import annotations

from collections.abc import Callable, Hashable
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
    """Heights of the layers' nodes above the map's floor [m], and how fine changes are told [m].

    scale: of heights and nodes; large buildings are looked at from farther away.
    """

    walls: float = 3.8
    rooms: float = 6.0
    floor: float = 9.0
    change: float = 0.02
    scale: float = 1.0


class Layers:
    """Draws answers of the detector over the map that they speak of."""

    def __init__(self, log: Log, config: LayerConfig = LayerConfig()):
        self._log = log
        self._config = config
        self._drawn: dict[str, Hashable] = {}
        self._revisions: dict[int, int] = {}

    def draw(self, view: MapView, proposals: Proposals) -> None:
        """The map as it is now; what is gone is cleared."""
        planes = {plane.id: plane for plane in view.planes}
        wanted: set[str] = set()
        for plane in view.planes:
            wanted.add(self._plane(plane))
        for wall in proposals.walls:
            if all(piece.plane_id in planes for piece in wall.pieces):
                wanted.add(self._wall(wall, planes))
        for room in proposals.rooms:
            wanted.add(self._room(room, planes))
        if proposals.rooms:
            wanted.add(self._floor(proposals))
        for gone in self._drawn.keys() - wanted:
            self._log(f"{MAP}/{gone}", rr.Clear(recursive=True))
            self._log(f"{GRAPH}/{gone}", rr.Clear(recursive=True))
        self._drawn = {entity: self._drawn[entity] for entity in wanted}
        self._revisions = {plane.id: plane.revision for plane in view.planes}

    def _is_new(self, entity: str, state: Hashable) -> bool:
        changed = self._drawn.get(entity) != state
        self._drawn[entity] = state
        return changed

    def _grid(self, *points: Array) -> bytes:
        """Points on a grid as coarse as the changes that are told."""
        flat = np.concatenate([np.ravel(part) for part in points])
        return np.rint(flat / self._config.change).astype(np.int32).tobytes()

    def _lifted(self, at: Array, height: float) -> Array:
        """A node (3,) above a point (2,)."""
        return np.append(at, height * self._config.scale)

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
            node = self._lifted(np.mean(middles, axis=0)[:2], self._config.walls)
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
            node = self._lifted(room.centre, self._config.rooms)
            label = f"room {room.id} ({room.confidence:.2f})"
            self._log(f"{GRAPH}/{entity}/node", self._node(node, 0.35, colour, label))
            # A detector without planes still has a place to point at.
            feet = [shapes.piece_middle(planes[p.plane_id], p) for p in pieces]
            feet = feet or [np.append(room.centre, 0.0)]
            self._log(
                f"{GRAPH}/{entity}/edges", shapes.lines([[node, m] for m in feet], colour, 0.012)
            )
            sides = [shapes.rectangle(p.segment, planes[p.plane_id].z_range) for p in pieces]
            self._log(f"{MAP}/{entity}/sides", shapes.lines(sides, colour, 0.03))
            self._log(f"{MAP}/{entity}/floor", shapes.floor_polygon(outline, 0.02, colour, 90))
        return entity

    def _floor(self, proposals: Proposals) -> str:
        entity = "floor"
        centres = np.array([room.centre for room in proposals.rooms])
        if self._is_new(entity, self._grid(centres)):
            node = self._lifted(centres.mean(axis=0), self._config.floor)
            rooms = [self._lifted(centre, self._config.rooms) for centre in centres]
            self._log(f"{GRAPH}/{entity}/node", self._node(node, 0.45, shapes.PINK, "floor"))
            self._log(
                f"{GRAPH}/{entity}/edges", shapes.lines([[node, r] for r in rooms], shapes.PINK)
            )
        return entity
