"""What changed from one answer of the detector to the next, in words."""

from __future__ import annotations

from slam.core import Proposals, RoomProposal, WallProposal


class Changes:
    """Compares each answer with the one before."""

    def __init__(self) -> None:
        self._rooms: dict[int, RoomProposal] = {}
        self._walls: dict[int, WallProposal] = {}

    def of(self, proposals: Proposals) -> list[str]:
        """One line an event: found, revised (other planes), retracted."""
        rooms = {room.id: room for room in proposals.rooms}
        walls = {wall.id: wall for wall in proposals.walls}
        both = [(room, self._rooms[k]) for k, room in rooms.items() if k in self._rooms]
        events = [f"room {k} found ({_said(rooms[k])})" for k in rooms if k not in self._rooms]
        events += [
            f"room {now.id} revised ({_said(now)})"
            for now, before in both
            if _sides(now) != _sides(before)
        ]
        events += [f"room {k} retracted" for k in self._rooms if k not in rooms]
        events += [f"wall {k} found" for k in walls if k not in self._walls]
        events += [f"wall {k} retracted" for k in self._walls if k not in walls]
        self._rooms, self._walls = rooms, walls
        return events


def _sides(room: RoomProposal) -> frozenset[int]:
    return frozenset(piece.plane_id for piece in room.pieces)


def _said(room: RoomProposal) -> str:
    return f"{len(_sides(room))} planes, confidence {room.confidence:.2f}"
