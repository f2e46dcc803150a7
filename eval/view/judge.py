"""A run against the truth while it goes on: a quick word for those who watch, not a score.

The scores are computed at the end from all that was stored; here a room counts as found when the
centre of a detection lies in it, a wall when both its pieces lie on its two faces.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from shapely.geometry import Point

from eval.trajectory import align
from slam.core import Array, PlanePiece, Proposals, inverse, transform_points
from worlds.truth import Face, Truth

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
        self._truth = truth
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

    def judge(self, proposals: Proposals, planes: dict[int, Array]) -> Judgement:
        """An answer of the detector. planes: id -> normal (3,) in the map frame."""
        if self._T_world_map is None:
            return Judgement({}, frozenset(), 0, None)
        self._enter()
        rooms: dict[int, int | None] = {}
        for room in proposals.rooms:
            owner = self._room_at(self._world(room.centre))
            rooms[room.id] = None if owner in rooms.values() else owner
        missed = frozenset(self._entered - {owner for owner in rooms.values() if owner is not None})
        right = sum(self._is_wall(wall.pieces, planes) for wall in proposals.walls)
        return Judgement(rooms, missed, right, self._ate())

    def _enter(self) -> None:
        room = self._room_at(self._true[-1][:2])
        if room is not None:
            self._entered.add(room)

    def _world(self, point: Array) -> Array:
        assert self._T_world_map is not None
        return transform_points(self._T_world_map, np.append(point, 0.0)[None])[0, :2]

    def _room_at(self, point: Array) -> int | None:
        where = Point(point)
        return next((r.id for r in self._truth.rooms if r.polygon.covers(where)), None)

    def _is_wall(self, pieces: tuple[PlanePiece, ...], planes: dict[int, Array]) -> bool:
        found = [self._face_of(p.segment.mean(axis=0), planes.get(p.plane_id)) for p in pieces]
        faces = {face.id for face in found if face is not None}
        return any(set(wall.faces) == faces for wall in self._truth.walls)

    def _face_of(self, middle: Array, normal: Array | None) -> Face | None:
        if normal is None:
            return None
        assert self._T_world_map is not None
        facing, at = self._T_world_map[:3, :3] @ normal, self._world(middle)
        for face in self._truth.faces:
            if facing @ face.normal > SAME_WAY and _beside(face, at) < ON_FACE:
                return face
        return None

    def _ate(self) -> float | None:
        estimated, true = np.array(self._estimated), np.array(self._true)
        T = align(estimated, true)
        if T is None:
            return None
        error = transform_points(T, estimated) - true
        return float(np.sqrt((error**2).sum(axis=1).mean()))


def _beside(face: Face, point: Array) -> float:
    """Distance in plan view [m]."""
    start, end = face.segment
    run = end - start
    share = np.clip((point - start) @ run / max(float(run @ run), 1e-12), 0.0, 1.0)
    return float(np.linalg.norm(start + share * run - point))
