"""A run against the truth while it goes on: a quick word for those who watch, not a score.

The scores are computed at the end from all that was stored; here a room counts as found when the
centre of a detection lies in it, a wall when both its pieces lie on its two faces.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import shapely

from eval.score.trajectory import align
from slam.core import Array, PlanePiece, Proposals, inverse, transform_points
from worlds.truth import Truth

ON_FACE = 0.15
"""A piece lies on a face if its middle is this close to it [m]."""

SAME_WAY = 0.995
"""And their normals agree by this cosine."""


@dataclass(frozen=True)
class Judgement:
    """rooms: detection -> true room, or None where it is false; missed: rooms entered and not
    found; walls_right: detections that are true; ate: of the path so far [m], None while it cannot
    be aligned."""

    rooms: dict[int, int | None]
    missed: frozenset[int]
    walls_right: int
    ate: float | None


class Judge:
    """Follows the robot through the truth."""

    def __init__(self, truth: Truth):
        self._rooms = truth.rooms
        self._tree = shapely.STRtree([room.polygon for room in truth.rooms])
        self._storeys = np.array([room.storey for room in truth.rooms], dtype=np.int64)
        self._floors = truth.floors
        faces = truth.faces
        self._normals = np.array([face.normal for face in faces]).reshape(-1, 3)
        self._starts = np.array([face.segment[0] for face in faces]).reshape(-1, 2)
        self._runs = np.array([face.segment[1] - face.segment[0] for face in faces]).reshape(-1, 2)
        self._face_ids = [face.id for face in faces]
        self._walls = {frozenset(wall.faces) for wall in truth.walls}
        self._true: list[Array] = []
        self._estimated: list[Array] = []
        self._entered: set[int] = set()
        self._T_world_map: Array | None = None

    def see(self, T_map_base: Array, T_world_base: Array) -> None:
        """One scan: where the robot is thought to be, and where it is."""
        if self._T_world_map is None:
            self._T_world_map = T_world_base @ inverse(T_map_base)
        self._estimated.append(T_map_base[:3, 3].copy())
        self._true.append(T_world_base[:3, 3].copy())

    def judge(self, proposals: Proposals, normals: dict[int, Array]) -> Judgement | None:
        """An answer of the detector, or None before anything was seen.

        normals: of the planes by id, (3,) in the map frame.
        """
        if self._T_world_map is None:
            return None
        here = self._rooms_at(self._true[-1][None, :2])
        self._entered |= {room for room in here if room is not None}
        centres = [room.centre for room in proposals.rooms]
        rooms: dict[int, int | None] = {}
        for room, owner in zip(proposals.rooms, self._rooms_at(self._world(centres)), strict=True):
            rooms[room.id] = None if owner in rooms.values() else owner
        missed = frozenset(self._entered - {owner for owner in rooms.values() if owner is not None})
        right = sum(self._is_wall(wall.pieces, normals) for wall in proposals.walls)
        return Judgement(rooms, missed, right, self._ate())

    def _world(self, points: list[Array]) -> Array:
        """Points (2,) of the map as (N, 2) of the world."""
        assert self._T_world_map is not None
        flat = np.array(points).reshape(-1, 2)
        level = np.column_stack([flat, np.zeros(len(flat))])
        return transform_points(self._T_world_map, level)[:, :2]

    def _rooms_at(self, points: Array) -> list[int | None]:
        """The true room at each of the points (N, 2), on the storey where the robot is."""
        z = self._true[-1][2]
        storey = min(self._floors, key=lambda floor: abs(floor.z_floor - z)).storey
        found: list[int | None] = [None] * len(points)
        for point, place in self._tree.query(shapely.points(points), predicate="covered_by").T:
            if self._storeys[place] == storey and found[point] is None:
                found[point] = self._rooms[place].id
        return found

    def _is_wall(self, pieces: tuple[PlanePiece, ...], normals: dict[int, Array]) -> bool:
        middles = self._world([piece.segment.mean(axis=0) for piece in pieces])
        known = [normals.get(piece.plane_id) for piece in pieces]
        found = [self._face_of(*pair) for pair in zip(middles, known, strict=True)]
        return frozenset(found) in self._walls

    def _face_of(self, middle: Array, normal: Array | None) -> int | None:
        """The true face nearest to a point (2,) of the world among those that face this way."""
        if normal is None or not self._face_ids:
            return None
        assert self._T_world_map is not None
        off = self._starts - middle
        length2 = np.maximum((self._runs**2).sum(axis=1), 1e-12)
        share = np.clip(-(off * self._runs).sum(axis=1) / length2, 0.0, 1.0)
        beside = np.hypot(*(off + share[:, None] * self._runs).T)
        beside[self._normals @ (self._T_world_map[:3, :3] @ normal) < SAME_WAY] = np.inf
        nearest = int(beside.argmin())
        return self._face_ids[nearest] if beside[nearest] < ON_FACE else None

    def _ate(self) -> float | None:
        estimated, true = np.array(self._estimated), np.array(self._true)
        T = align(estimated, true)
        if T is None:
            return None
        error = transform_points(T, estimated) - true
        return float(np.sqrt((error**2).sum(axis=1).mean()))
