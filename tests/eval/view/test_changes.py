"""Events are told once, in words."""

from __future__ import annotations

from dataclasses import replace

from eval.view.changes import Changes
from slam.core import Proposals


def test_found_revised_retracted(proposals: Proposals) -> None:
    changes = Changes()
    assert changes.of(proposals) == [
        "room 7 found (2 planes, confidence 0.90)",
        "room 8 found (0 planes, confidence 0.50)",
        "wall 0 found",
    ]
    assert changes.of(proposals) == []
    room = proposals.rooms[0]
    fewer = replace(room, pieces=room.pieces[:1])
    events = changes.of(Proposals((fewer,)))
    assert events == [
        "room 7 revised (1 planes, confidence 0.90)",
        "room 8 retracted",
        "wall 0 retracted",
    ]


def test_confidence_alone_is_no_event(proposals: Proposals) -> None:
    changes = Changes()
    changes.of(proposals)
    rooms = tuple(replace(room, confidence=0.1) for room in proposals.rooms)
    assert changes.of(replace(proposals, rooms=rooms)) == []
