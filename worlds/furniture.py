"""Furniture, and what lies about on a building site, drawn at random within usual sizes.

Every piece stands in a frame of its own: its back against the line y = 0, its depth along y, its
width along x about 0, the floor at z = 0.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np

from slam.core import Array
from worlds.fittings import Block, about_x, about_z

LEVEL = np.eye(3)


@dataclass(frozen=True)
class Piece:
    """A piece of furniture in its own frame. free: it stands in the open, not against a wall."""

    kind: str
    blocks: tuple[Block, ...]
    free: bool = False

    @property
    def extent(self) -> tuple[Array, Array]:
        """Lowest and highest x, y, z (3,) each."""
        corners = np.concatenate([block.corners for block in self.blocks])
        return corners.min(axis=0), corners.max(axis=0)


Maker = Callable[[np.random.Generator], Piece]


def _box(x: tuple[float, float], y: tuple[float, float], z: tuple[float, float]) -> Block:
    low, high = np.array([x[0], y[0], z[0]]), np.array([x[1], y[1], z[1]])
    return Block((low + high) / 2.0, (high - low) / 2.0, LEVEL)


def _chair(x: float, y: float, yaw: float) -> list[Block]:
    """An office chair with its seat's middle at (x, y); at yaw 0 its back is towards +y."""
    parts = [
        _box((-0.25, 0.25), (-0.03, 0.03), (0.04, 0.09)),
        _box((-0.03, 0.03), (-0.25, 0.25), (0.04, 0.09)),
        _box((-0.03, 0.03), (-0.03, 0.03), (0.09, 0.43)),
        _box((-0.23, 0.23), (-0.22, 0.22), (0.43, 0.50)),
        _box((-0.21, 0.21), (0.20, 0.25), (0.55, 0.98)),
    ]
    return [part.moved(about_z(yaw), np.array([x, y, 0.0])) for part in parts]


def desk(rng: np.random.Generator) -> Piece:
    """A desk on two panels, a screen on it, a chair before it."""
    half, depth, top = rng.uniform(0.6, 0.9), rng.uniform(0.7, 0.8), rng.uniform(0.70, 0.76)
    blocks = [
        _box((-half, half), (0.0, depth), (top - 0.03, top)),
        _box((-half, -half + 0.03), (0.02, depth - 0.05), (0.0, top - 0.03)),
        _box((half - 0.03, half), (0.02, depth - 0.05), (0.0, top - 0.03)),
        _box((-0.28, 0.28), (0.18, 0.22), (top + 0.12, top + 0.46)),
    ]
    side, away, turn = rng.uniform(-0.2, 0.2), depth + rng.uniform(0.05, 0.35), rng.normal(0.0, 0.5)
    return Piece("desk", tuple(blocks + _chair(side, away, turn)))


def table(rng: np.random.Generator) -> Piece:
    """A meeting table with chairs on its long sides."""
    half, depth = rng.uniform(0.7, 1.2), rng.uniform(0.8, 1.1)
    blocks = [_box((-half, half), (0.5, 0.5 + depth), (0.71, 0.74))]
    for x in (-half + 0.08, half - 0.08):
        for y in (0.58, 0.42 + depth):
            blocks.append(_box((x - 0.03, x + 0.03), (y - 0.03, y + 0.03), (0.0, 0.71)))
    for x in np.arange(-half + 0.35, half - 0.3, 0.75).tolist():
        blocks += _chair(x, 0.75 + depth, rng.normal(0.0, 0.2))
        blocks += _chair(x, 0.25, np.pi + rng.normal(0.0, 0.2))
    return Piece("table", tuple(blocks), free=True)


def cabinet(rng: np.random.Generator) -> Piece:
    """A closed cupboard."""
    half, depth, top = rng.uniform(0.4, 0.7), rng.uniform(0.38, 0.6), rng.uniform(0.75, 2.0)
    return Piece("cabinet", (_box((-half, half), (0.0, depth), (0.0, top)),))


def shelf(rng: np.random.Generator) -> Piece:
    """An open bookcase."""
    half, depth, top = rng.uniform(0.4, 0.6), rng.uniform(0.28, 0.4), rng.uniform(1.7, 2.2)
    blocks = [
        _box((-half, -half + 0.02), (0.0, depth), (0.0, top)),
        _box((half - 0.02, half), (0.0, depth), (0.0, top)),
        _box((-half + 0.02, half - 0.02), (0.0, 0.01), (0.0, top)),
    ]
    for z in np.linspace(0.05, top - 0.02, 6).tolist():
        blocks.append(_box((-half + 0.02, half - 0.02), (0.01, depth), (z, z + 0.02)))
    return Piece("shelf", tuple(blocks))


def boxes(rng: np.random.Generator) -> Piece:
    """Cardboard boxes on top of each other."""
    blocks, top = [], 0.0
    for _ in range(int(rng.integers(1, 5))):
        half, height = rng.uniform(0.15, 0.25, 2), rng.uniform(0.2, 0.4)
        block = Block(np.zeros(3), np.array([*half, height / 2.0]), about_z(rng.normal(0.0, 0.1)))
        blocks.append(block.moved(LEVEL, np.array([0.0, 0.3, top + height / 2.0])))
        top += height
    return Piece("boxes", tuple(blocks))


# --- on a site -----------------------------------------------------------------------------------


def pallet(rng: np.random.Generator) -> Piece:
    """A pallet with bricks or bags on it."""
    load = rng.uniform(0.2, 1.2)
    back, front = rng.uniform(0.0, 0.1, 2)
    return Piece(
        "pallet",
        (
            _box((-0.6, 0.6), (0.0, 0.8), (0.0, 0.14)),
            _box((-0.6 + back, 0.6 - back), (back, 0.8 - front), (0.14, 0.14 + load)),
        ),
        free=bool(rng.random() < 0.5),
    )


def bags(rng: np.random.Generator) -> Piece:
    """Bags of cement in a heap."""
    blocks = []
    for layer in range(int(rng.integers(2, 6))):
        shift = np.array([*rng.normal(0.0, 0.04, 2), 0.06 + 0.12 * layer])
        turn = about_z(rng.normal(0.0, 0.15) + (np.pi / 2.0 if layer % 2 else 0.0))
        bag = Block(np.zeros(3), np.array([0.32, 0.22, 0.06]), turn)
        blocks.append(bag.moved(LEVEL, shift + np.array([0.0, 0.4, 0.0])))
    return Piece("bags", tuple(blocks))


def ladder(rng: np.random.Generator) -> Piece:
    """A ladder that leans on the wall."""
    length, lean = rng.uniform(1.8, 2.4), rng.uniform(np.radians(10.0), np.radians(18.0))
    blocks = [_box((x - 0.015, x + 0.015), (-0.03, 0.03), (0.0, length)) for x in (-0.2, 0.2)]
    for z in np.arange(0.28, length, 0.28).tolist():
        blocks.append(_box((-0.185, 0.185), (-0.015, 0.015), (z - 0.015, z + 0.015)))
    foot = np.array([0.0, length * np.sin(lean) + 0.05, 0.01])
    return Piece("ladder", tuple(block.moved(about_x(lean), foot) for block in blocks))


def boards(rng: np.random.Generator) -> Piece:
    """Plasterboards leaning on the wall."""
    half, thick, height = rng.uniform(0.4, 0.65), rng.uniform(0.03, 0.15), rng.uniform(1.5, 2.2)
    lean = rng.uniform(np.radians(5.0), np.radians(10.0))
    stack = _box((-half, half), (0.0, thick), (0.0, height))
    foot = np.array([0.0, height * np.sin(lean) + 0.01, 0.0])
    return Piece("boards", (stack.moved(about_x(lean), foot),))


def scaffold(rng: np.random.Generator) -> Piece:
    """A rolling scaffold: four posts, two decks, braces."""
    half, depth, top = rng.uniform(0.8, 1.2), 0.75, rng.uniform(1.7, 2.1)
    blocks = [
        _box((x - 0.025, x + 0.025), (y - 0.025, y + 0.025), (0.0, top))
        for x in (-half, half)
        for y in (0.03, depth - 0.03)
    ]
    blocks += [_box((-half, half), (0.06, depth - 0.06), (z, z + 0.05)) for z in (0.9, top - 0.2)]
    blocks += [_box((-half, half), (y - 0.015, y + 0.015), (0.4, 0.43)) for y in (0.03, depth)]
    return Piece("scaffold", tuple(blocks), free=True)


def barrel(rng: np.random.Generator) -> Piece:
    """A barrel, or a heap of rubble in a bin."""
    half, top = rng.uniform(0.2, 0.4), rng.uniform(0.4, 0.9)
    return Piece("barrel", (_box((-half, half), (0.0, 2.0 * half), (0.0, top)),))


FURNITURE: Mapping[Maker, float] = {desk: 3.0, table: 1.0, cabinet: 3.0, shelf: 2.0, boxes: 1.5}
SITE: Mapping[Maker, float] = {
    pallet: 2.0, bags: 1.5, ladder: 1.0, boards: 2.0, scaffold: 1.0, barrel: 1.5,
}  # fmt: skip
"""What stands about, and how often [relative]."""
