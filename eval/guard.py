"""What a detector answers, before it enters the graph, the scores and the files.

A detector may be anybody's. What can be left out without changing what the rest means is left out,
with one warning for each kind of fault: planes that the map has no more (they merge while a
detector remembers them), a piece named twice in one room, an outline that is none. What nothing can
be made of (an answer of another type, places that are not numbers, ids used twice) ends the run.
"""

from __future__ import annotations

import logging
from dataclasses import replace
from typing import NoReturn

import numpy as np

from eval.score.votes import check_ids
from slam.core import (
    Detector,
    MapView,
    PlanePiece,
    Proposals,
    RoomloopError,
    RoomProposal,
    RunError,
    WallProposal,
)

log = logging.getLogger(__name__)


class Guard:
    """Asks a detector, and passes on what is sound of its answers; one that has failed is not asked
    again."""

    def __init__(self, detector: Detector) -> None:
        self.detector = detector
        self._warned: set[str] = set()
        self._failed = False

    def ask(self, view: MapView) -> Proposals:
        """The detector's word on the map. Raises RunError for an answer that cannot be used."""
        if self._failed:
            return Proposals()
        self._failed = True
        answer = self._sound(self._answer(view), view)
        self._failed = False
        return answer

    def _answer(self, view: MapView) -> object:
        try:
            return self.detector.update(view)
        except RoomloopError:
            raise
        except Exception as error:
            log.debug("detector", exc_info=True)
            text = str(error).splitlines()[0] if str(error) else ""
            raise RunError(f"detector: {type(error).__name__}: {text}") from error

    def _sound(self, answer: object, view: MapView) -> Proposals:
        _check_type("update()", answer, Proposals)
        assert isinstance(answer, Proposals)
        for room in answer.rooms:
            _check_type("rooms", room, RoomProposal)
        for wall in answer.walls:
            _check_type("walls", wall, WallProposal)
        check_ids("room", [room.id for room in answer.rooms])
        check_ids("wall", [wall.id for wall in answer.walls])
        known = {plane.id for plane in view.planes}
        rooms = [self._room(room, known) for room in answer.rooms]
        walls = [self._wall(wall, known) for wall in answer.walls]
        return Proposals(
            tuple(room for room in rooms if room is not None),
            tuple(wall for wall in walls if wall is not None),
        )

    def _room(self, room: RoomProposal, known: set[int]) -> RoomProposal | None:
        name = f"room {room.id}"
        _check_numbers(f"{name}: centre", room.centre, (2,))
        _check_confidence(name, room.confidence)
        pieces = tuple(piece for piece in room.pieces if self._is_known(name, piece, known))
        if room.pieces and not pieces:
            return None
        pieces = self._once(name, pieces)
        polygon = room.polygon
        if polygon is not None and not _is_outline(polygon):
            self._warn("outline", f"{name}: an outline without three corners that are numbers")
            polygon = None
        if len(pieces) == len(room.pieces) and polygon is room.polygon:
            return room
        return replace(room, pieces=pieces, polygon=polygon)

    def _wall(self, wall: WallProposal, known: set[int]) -> WallProposal | None:
        name = f"wall {wall.id}"
        if len(wall.pieces) != 2:
            _fail(f"{name}: {len(wall.pieces)} pieces, expected its two faces")
        _check_confidence(name, wall.confidence)
        return wall if all(self._is_known(name, piece, known) for piece in wall.pieces) else None

    def _is_known(self, name: str, piece: PlanePiece, known: set[int]) -> bool:
        _check_numbers(f"{name}: segment of plane {piece.plane_id}", piece.segment, (2, 2))
        if piece.plane_id in known:
            return True
        self._warn("plane", f"{name}: plane {piece.plane_id} is not in the map")
        return False

    def _once(self, name: str, pieces: tuple[PlanePiece, ...]) -> tuple[PlanePiece, ...]:
        found = {(p.plane_id, np.asarray(p.segment).tobytes()): p for p in pieces}
        if len(found) == len(pieces):
            return pieces
        self._warn("twice", f"{name}: a piece is named twice")
        return tuple(found.values())

    def _warn(self, kind: str, message: str) -> None:
        if kind not in self._warned:
            self._warned.add(kind)
            log.warning("detector: %s: left out (told once)", message)


def _check_type(where: str, value: object, wanted: type) -> None:
    if not isinstance(value, wanted):
        _fail(f"{where}: expected {wanted.__name__}, got {type(value).__name__}")


def _check_numbers(what: str, value: object, shape: tuple[int, ...]) -> None:
    try:
        numbers = np.asarray(value, dtype=np.float64)
    except (TypeError, ValueError):
        _fail(f"{what}: expected numbers, got {value!r}")
    if numbers.shape != shape or not np.isfinite(numbers).all():
        size = " x ".join(map(str, shape))
        _fail(f"{what}: expected {size} finite numbers, got {numbers.tolist()}")


def _check_confidence(name: str, confidence: float) -> None:
    if not np.isfinite(confidence):
        _fail(f"{name}: confidence: expected a number, got {confidence}")


def _is_outline(polygon: object) -> bool:
    corners = np.asarray(polygon)
    flat = corners.ndim == 2 and corners.shape[1:] == (2,) and len(corners) >= 3
    return flat and bool(np.isfinite(corners).all())


def _fail(message: str) -> NoReturn:
    raise RunError(f"detector: {message}")
