"""Plane pieces, and by what measures planes are cut into them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from slam.core import Array, IntArray, PlanePiece


@dataclass(frozen=True)
class PreprocessConfig:
    """Metres and radians. bin: along the plane, and min_count points in one for it to be occupied;
    gap: longest hole within a piece (doors are 1 m, an opening that joins rooms 2.5 m); min_length:
    of a piece; seen: least share of it with points; reach: how far a wall that was not seen to its
    end is taken to go on, or across a door, where nothing stands between; inside: how far from both
    ends of a piece a cut may lie; in_front: how far a wall must stand out to cut; crossing: least
    angle between the two; wall: nothing that only stands there is as long, and what is shorter [m]
    cuts if it was seen as_high (share) as what it cuts was about there: furniture does not make two
    pieces of the wall behind it; about: how far along that is; stub: least and largest hole
    of a wall too short to be mapped, between stub_bins that were all seen, and stub_off: how far
    the holes in two faces may be from opposite each other; passage: widest that is looked at;
    duplicate_*: a piece is
    dropped when a longer one that faces the same way lies this near and beside most of it.
    """

    bin: float = 0.1
    min_count: int = 2
    gap: float = 1.8
    min_length: float = 0.35
    seen: float = 0.4
    reach: float = 1.7
    inside: float = 0.25
    in_front: float = 0.3
    crossing: float = np.radians(30.0)
    wall: float = 0.8
    as_high: float = 0.7
    about: float = 1.0
    stub: tuple[float, float] = (0.12, 0.5)
    stub_bins: int = 4
    stub_off: float = 0.2
    passage: float = 10.0
    duplicate_distance: float = 0.12
    duplicate_angle: float = np.radians(8.0)
    duplicate_share: float = 0.6


STANDARD = PreprocessConfig()


@dataclass(frozen=True)
class Pieces:
    """M plane pieces in plan view, map frame [m].

    plane_id: (M,); segment: (M, 2, 2), ends in the order of the plane's axis; normal: (M, 2) unit,
    to the side it was seen from; height: (M, 2) where it was seen lowest and highest, on average
    along it [m]; barrier: (B, 2, 2) where a wall must stand across a passage that is too short to
    be mapped.
    """

    plane_id: IntArray
    segment: Array
    normal: Array
    height: Array
    barrier: Array = field(default_factory=lambda: np.zeros((0, 2, 2)))

    def __len__(self) -> int:
        return len(self.plane_id)

    @cached_property
    def centre(self) -> Array:
        """(M, 2)"""
        return 0.5 * (self.segment[:, 0] + self.segment[:, 1])

    @cached_property
    def length(self) -> Array:
        """(M,)"""
        x, y = (self.segment[:, 1] - self.segment[:, 0]).T
        return np.sqrt(x * x + y * y)

    @cached_property
    def axis(self) -> Array:
        """(M, 2) unit, from the first to the second end."""
        run = self.segment[:, 1] - self.segment[:, 0]
        return run / np.maximum(self.length, 1e-9)[:, None]

    @cached_property
    def along(self) -> Array:
        """(M, 2) the ends along the plane, as its bins are counted, ascending [m]."""
        x, y = self.normal.T
        at = self.segment[:, :, 1] * x[:, None] - self.segment[:, :, 0] * y[:, None]
        return np.sort(at, axis=1)

    def take(self, places: IntArray | NDArray[np.bool_] | slice) -> Pieces:
        """Some of them."""
        return Pieces(
            self.plane_id[places],
            self.segment[places],
            self.normal[places],
            self.height[places],
            self.barrier,
        )

    def split(self, groups: Sequence[IntArray]) -> list[Pieces]:
        """Those at the places of each group."""
        members = self.take(np.concatenate(groups))
        bounds = np.cumsum([0, *map(len, groups)]).tolist()
        return [members.take(slice(a, b)) for a, b in pairwise(bounds)]

    def piece(self, place: int) -> PlanePiece:
        """One of them, as proposals name it."""
        return PlanePiece(int(self.plane_id[place]), self.segment[place])

    def every(self) -> tuple[PlanePiece, ...]:
        """All of them, as proposals name them."""
        return tuple(map(PlanePiece, self.plane_id.tolist(), self.segment))


def joined(parts: Sequence[Pieces]) -> Pieces:
    """All pieces in one."""
    if not parts:
        return Pieces(
            np.zeros(0, np.int64), np.zeros((0, 2, 2)), np.zeros((0, 2)), np.zeros((0, 2))
        )
    return Pieces(
        np.concatenate([part.plane_id for part in parts]),
        np.concatenate([part.segment for part in parts]),
        np.concatenate([part.normal for part in parts]),
        np.concatenate([part.height for part in parts]),
    )
