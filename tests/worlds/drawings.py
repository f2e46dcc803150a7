"""A plan drawn for the tests, as the JSON it is written in."""

from __future__ import annotations

import copy
import json
from pathlib import Path
from typing import Any

HOUSE: dict[str, Any] = {
    "format": "roomloop-plan-1",
    "name": "house",
    "notes": "two rooms over a corridor",
    "storeys": [
        {
            "name": "0",
            "z_floor": 0.0,
            "z_ceiling": 2.6,
            "rooms": [
                {"name": "left", "kind": "room", "outline": [[0, 2], [4, 2], [4, 6], [0, 6]]},
                {"name": "right", "kind": "room", "outline": [[4, 2], [9, 2], [9, 6], [4, 6]]},
                {"name": "hall", "kind": "corridor", "outline": [[0, 0], [9, 0], [9, 2], [0, 2]]},
            ],
            "walls": [
                {"from": [0, 0], "to": [9, 0], "thickness": 0.2},
                {"from": [9, 0], "to": [9, 6], "thickness": 0.2},
                {"from": [9, 6], "to": [0, 6], "thickness": 0.2},
                {"from": [0, 6], "to": [0, 0], "thickness": 0.2},
                {"from": [0, 2], "to": [9, 2], "thickness": 0.1},
                {"from": [4, 2], "to": [4, 6], "thickness": 0.1},
            ],
            "doors": [
                {"at": [2, 2], "width": 0.9, "height": 2.0},
                {"at": [6, 2], "width": 0.9, "height": 2.0},
            ],
        }
    ],
}


def house() -> dict[str, Any]:
    """A copy that may be spoilt."""
    return copy.deepcopy(HOUSE)


def write(tree: object, folder: Path, name: str = "house.json") -> Path:
    """The plan as a file."""
    path = folder / name
    path.write_text(tree if isinstance(tree, str) else json.dumps(tree))
    return path
