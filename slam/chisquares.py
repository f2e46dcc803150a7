"""How well the factors of the graph fit what they are about, by type."""

from __future__ import annotations

from collections.abc import Hashable, Iterable
from dataclasses import dataclass
from typing import cast

from slam.relations import Relation
from slam.sightings import SIGHTING
from slam.variables import FLOOR, ROOM, WALL

KINDS = {
    "odometry": "odometry",
    SIGHTING: "planes",
    "plumb": "plumb",
    "loop": "loops",
    ROOM: "rooms",
    WALL: "walls",
    FLOOR: "floors",
    "floor": "floors",
}
"""Types of factors, by the first part of their names; relations tell theirs themselves."""


@dataclass(frozen=True)
class ChiSquare:
    """Of all factors of one type: how many residuals, and the sum of their squares, each over its
    variance; what is far off as much as it counts."""

    residuals: int
    chi2: float


def chi_squares(squares: Iterable[tuple[Hashable, int, float]]) -> dict[str, ChiSquare]:
    """By type, of what every factor has: its name, how many residuals, and the sum of their
    squares."""
    sums: dict[str, ChiSquare] = {}
    for name, residuals, chi2 in squares:
        kind = name.kind if isinstance(name, Relation) else KINDS[cast(tuple, name)[0]]
        known = sums.get(kind, ChiSquare(0, 0.0))
        sums[kind] = ChiSquare(known.residuals + residuals, known.chi2 + chi2)
    return sums
