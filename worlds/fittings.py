"""Things that stand in a building without being part of it: boxes, put together."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import shapely
from numpy.typing import NDArray
from shapely.geometry import Polygon

from slam.core import Array
from worlds.solids import Solid

# Corners of a box count in binary (x lowest); two triangles a side, outward.
BOX_CORNERS = np.array([[x, y, z] for z in (-1, 1) for y in (-1, 1) for x in (-1, 1)])
BOX_TRIANGLES = np.array(
    [
        [0, 2, 1], [1, 2, 3], [4, 5, 6], [5, 7, 6], [0, 1, 4], [1, 5, 4],
        [2, 6, 3], [3, 6, 7], [0, 4, 2], [2, 4, 6], [1, 3, 5], [3, 7, 5],
    ],
    dtype=np.int32,
)  # fmt: skip


@dataclass(frozen=True)
class Block:
    """A box. centre, half: (3,) [m]; rotation: (3, 3) from the box to the frame it stands in."""

    centre: Array
    half: Array
    rotation: Array

    @property
    def corners(self) -> Array:
        """(8, 3)."""
        return self.centre + (BOX_CORNERS * self.half) @ self.rotation.T

    def moved(self, rotation: Array, translation: Array) -> Block:
        """The same box, turned and then shifted."""
        return Block(self.centre @ rotation.T + translation, self.half, rotation @ self.rotation)


@dataclass(frozen=True)
class Fitting:
    """One thing. name: of its own in the building; kind: what it is; label: of its returns, see
    ``worlds.truth``; footprint: what of the floor it takes, world frame.
    """

    name: str
    kind: str
    storey: int
    label: int
    blocks: tuple[Block, ...]
    footprint: Polygon

    def solids(self) -> list[Solid]:
        """Its boxes as triangles; they carry the names of its geoms."""
        label: NDArray[np.int32] = np.full(12, self.label, dtype=np.int32)
        return [
            Solid(f"{self.name}_{k}", block.corners, BOX_TRIANGLES, label)
            for k, block in enumerate(self.blocks)
        ]


def about_z(angle: float) -> Array:
    """(3, 3)."""
    c, s = np.cos(angle), np.sin(angle)
    return np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])


def about_x(angle: float) -> Array:
    """(3, 3)."""
    c, s = np.cos(angle), np.sin(angle)
    return np.array([[1.0, 0.0, 0.0], [0.0, c, -s], [0.0, s, c]])


def footprint_of(blocks: Sequence[Block]) -> Polygon:
    """What boxes cover of the floor, filled up to a convex outline: nobody drives under a table."""
    return shapely.MultiPoint(np.concatenate([b.corners[:, :2] for b in blocks])).convex_hull
