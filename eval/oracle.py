"""The oracle: a detector that reads the truth. It bounds what any detector could give the graph."""

from __future__ import annotations

import numpy as np

from eval.labels import TruthKeeper
from slam.core import (
    MapPlane,
    MapView,
    PlanePiece,
    Proposals,
    RoomProposal,
    WallProposal,
    inverse,
    transform_points,
)

MIN_POINTS = 20
"""Returns of a face on a mapped plane before the oracle calls that stretch a piece of the face."""

MIN_FACES = 3
"""Faces of a room that must be mapped before the oracle names the room (all, if it has fewer)."""


class OracleDetector:
    """Rooms and walls by the true labels of the points that the mapped planes were built from.

    It knows nothing that is not mapped yet: a face without points is not in any room.
    """

    def __init__(self, keeper: TruthKeeper):
        self._keeper = keeper
        self._pieces: dict[tuple[int, int], dict[int, PlanePiece]] = {}

    def update(self, view: MapView) -> Proposals:
        """Every room with enough mapped faces, every wall with both; none without room truth."""
        if not self._keeper.truth.rooms_known:
            return Proposals()
        by_face: dict[int, list[PlanePiece]] = {}
        for plane in view.planes:
            for face, piece in self._pieces_of(plane).items():
                by_face.setdefault(face, []).append(piece)
        return Proposals(self._rooms(by_face), self._walls(by_face))

    def _pieces_of(self, plane: MapPlane) -> dict[int, PlanePiece]:
        """The plane's pieces by face."""
        if plane.horizontal:
            return {}
        key = plane.id, plane.revision
        if key not in self._pieces:
            labels = self._keeper.faces_of(plane.point_ids)
            faces, counts = np.unique(labels[labels >= 0], return_counts=True)
            self._pieces[key] = {
                int(face): _piece(plane, labels == face) for face in faces[counts >= MIN_POINTS]
            }
        return self._pieces[key]

    def _rooms(self, by_face: dict[int, list[PlanePiece]]) -> tuple[RoomProposal, ...]:
        T_map_world = inverse(self._keeper.trajectory.poses[0])
        rooms = []
        for room in self._keeper.truth.rooms:
            mapped = [face for face in room.faces if face in by_face]
            if not mapped or len(mapped) < min(MIN_FACES, len(room.faces)):
                continue
            corners = np.array(room.polygon.exterior.coords[:-1])
            inside = np.array(room.polygon.representative_point().coords[0])
            plan = np.column_stack([np.vstack([corners, inside]), np.zeros(len(corners) + 1)])
            polygon = transform_points(T_map_world, plan)[:, :2]
            pieces = tuple(piece for face in mapped for piece in by_face[face])
            rooms.append(RoomProposal(room.id, pieces, polygon[:-1], polygon[-1], 1.0))
        return tuple(rooms)

    def _walls(self, by_face: dict[int, list[PlanePiece]]) -> tuple[WallProposal, ...]:
        walls = []
        for wall in self._keeper.truth.walls:
            if all(face in by_face for face in wall.faces):
                first, second = (
                    max(by_face[face], key=lambda piece: piece.length) for face in wall.faces
                )
                walls.append(WallProposal(wall.id, (first, second), 1.0))
        return tuple(walls)


def _piece(plane: MapPlane, mine: np.ndarray) -> PlanePiece:
    """The stretch of a plane on which the chosen points lie, without stray ones."""
    low, high = np.percentile(plane.points[mine, :2] @ plane.axis, [1.0, 99.0])
    foot = plane.segment[0] - (plane.segment[0] @ plane.axis) * plane.axis
    return PlanePiece(plane.id, foot + np.outer([low, high], plane.axis))
