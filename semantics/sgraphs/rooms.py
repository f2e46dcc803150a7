"""The rooms found so far: recognised again, promoted from corridors, never taken back."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass

import numpy as np

from semantics.sgraphs.config import SgraphsConfig
from semantics.sgraphs.matching import Match, Pair, Side, centre_of, side_of
from slam.core import Array, MapPlane


@dataclass(frozen=True)
class Known:
    """A room or corridor with the number that it keeps."""

    id: int
    match: Match

    @property
    def planes(self) -> set[int]:
        """Ids of its planes."""
        return {side.plane.id for side in self.match.sides}


class KnownRooms:
    """Takes matches of clusters; the first of a room stays, later ones only confirm it."""

    def __init__(self, config: SgraphsConfig):
        self._config = config
        self._rooms: list[Known] = []
        self._next = 0

    def __iter__(self) -> Iterator[Known]:
        return iter(self._rooms)

    def refresh(self, planes: Mapping[int, MapPlane], axes: Array) -> None:
        """Sides and centres as the map has them now. A room with a plane that the map has no more
        (it was merged) goes: it is found again from what remains."""
        rooms = [room for room in self._rooms if room.planes <= planes.keys()]
        self._rooms = [
            Known(room.id, _refreshed(room.match, planes, axes, self._config)) for room in rooms
        ]

    def take(self, match: Match) -> None:
        """One match: recognised, promoted, or new."""
        if match.kind == "room":
            self._take_room(match)
        else:
            self._take_corridor(match)

    def _take_room(self, match: Match) -> None:
        if any(self._is_same(known.match, match) for known in self._rooms):
            return
        promoted = [known for known in self._rooms if self._becomes(known, match)]
        self._rooms = [known for known in self._rooms if known not in promoted]
        self._add(match, promoted[0].id if promoted else None)

    def _becomes(self, known: Known, match: Match) -> bool:
        """Is a corridor the room that is now known with four planes?"""
        if known.match.kind == "room":
            return False
        pair = known.planes
        near = np.linalg.norm(known.match.centre - match.centre) <= self._config.same_room
        return pair <= {side.plane.id for side in match.sides} or bool(near)

    def _take_corridor(self, match: Match) -> None:
        pair = {side.plane.id for side in match.sides}
        for known in self._rooms:
            near = np.linalg.norm(known.match.centre - match.centre) < self._config.same_room
            if known.match.kind == "room" and (pair <= known.planes or near):
                return
            if self._is_same(known.match, match):
                return
        self._add(match, None)

    def _is_same(self, known: Match, match: Match) -> bool:
        """Is it one room, by its centre and by each of its planes?"""
        if known.kind != match.kind:
            return False
        if self._config.faults and match.kind == "y":
            return False
        away = np.abs(known.centre - match.centre)
        far = {"room": float(np.hypot(*away)), "x": away[0], "y": away[1]}[match.kind]
        if far > self._config.same_room:
            return False
        pairs = zip(known.sides, match.sides, strict=True)
        return all(self._is_same_plane(a, b, match.kind) for a, b in pairs)

    def _is_same_plane(self, known: Side, side: Side, kind: str) -> bool:
        if known.plane.id == side.plane.id:
            return True
        if kind != "room":
            facing = float(known.normal @ side.normal) > 0.0
            return facing and self._overlap(known, side)
        cross = known.normal[0] * side.normal[1] - known.normal[1] * side.normal[0]
        turn = np.arctan2(cross, known.normal @ side.normal)
        return bool(np.hypot(turn, known.d - side.d) < self._config.same_plane)

    def _overlap(self, known: Side, side: Side) -> bool:
        distance, _ = known.tree.query(side.points, distance_upper_bound=self._config.overlap)
        return bool(np.isfinite(distance).sum() > self._config.overlapping)

    def _add(self, match: Match, id_: int | None) -> None:
        if id_ is None:
            id_ = self._next
            self._next += 1
        self._rooms.append(Known(id_, match))


def _refreshed(
    match: Match, planes: Mapping[int, MapPlane], axes: Array, config: SgraphsConfig
) -> Match:
    def now(pair: Pair | None) -> Pair | None:
        if pair is None:
            return None
        low, high = (side_of(planes[side.plane.id], axes) for side in pair)
        return low, high

    x, y = now(match.x), now(match.y)
    return Match(x, y, centre_of(x, y, match.cluster @ axes.T, config), match.cluster)
