"""The paper's training set: floors cut into rectangular rooms, four planes each (paper, IV).

Sizes and noise are those that its authors used (grid of 0.1 m, floors of 7 m, rooms of 1 to 6 m,
walls of 5 to 15 cm, planes turned by up to 0.72 degrees, 15 % of them missing); but a plane's width
is its own, where theirs was that of the other side, which gave the answer away.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from semantics.dataset import Sample
from semantics.pieces import Pieces
from slam.core import Array, IntArray


@dataclass(frozen=True)
class LayoutConfig:
    """layouts: floors; side: cells of the floor and cell [m]; room: (least, largest) cells of a
    room's side; thickness: of walls [m]; turn: largest, of a room and of a plane in it [rad]; drop:
    chance of a plane to be missing.
    """

    layouts: int = 800
    side: int = 70
    cell: float = 0.1
    room: tuple[int, int] = (10, 60)
    thickness: tuple[float, float] = (0.05, 0.15)
    turn: float = np.radians(0.72)
    drop: float = 0.15

    def draw(self, seed: np.random.SeedSequence) -> list[Sample]:
        """One floor, at any heading."""
        rng = np.random.default_rng(seed)
        grid, rooms = _grid(rng, self)
        heading = rng.uniform(-np.pi, np.pi)
        thickness = rng.uniform(*self.thickness)
        segment, normal = _sides(rooms, thickness, heading, rng, self)
        face = np.arange(len(segment))
        kept = rng.random(len(segment)) >= self.drop
        pieces = Pieces(face, segment, normal, np.tile([0.0, 2.5], (len(segment), 1)))
        return [Sample(pieces.take(kept), face[kept], face[kept] // 4, _walls(grid))]


def _grid(rng: np.random.Generator, config: LayoutConfig) -> tuple[IntArray, Array]:
    """Room of each cell (side, side), -1 for none; and the rooms' cells (R, 4): first and one past
    the last along x and y."""
    grid = np.full((config.side, config.side), -2, dtype=np.int64)
    least, most = config.room
    rooms: list[tuple[int, int, int, int]] = []
    for i, j in np.ndindex(grid.shape):
        if grid[i, j] != -2:
            continue
        run_i, run_j = (_free(line) for line in (grid[i:, j], grid[i, j:]))
        width, depth = (int(rng.integers(least + 1, most + 1)) for _ in range(2))
        width, depth = min(width, run_i), min(depth, run_j)
        big = width >= least and depth >= least
        grid[i : i + width, j : j + depth] = len(rooms) if big else -1
        if big:
            rooms.append((i, i + width, j, j + depth))
    return grid, np.array(rooms, dtype=np.float64).reshape(-1, 4)


def _free(line: IntArray) -> int:
    """Free cells at the start of a line."""
    taken = np.flatnonzero(line != -2)
    return int(taken[0]) if len(taken) else len(line)


def _sides(
    rooms: Array, thickness: float, heading: float, rng: np.random.Generator, config: LayoutConfig
) -> tuple[Array, Array]:
    """Segments (4R, 2, 2) and normals (4R, 2): of each room the sides at +x, +y, -x, -y."""
    centre = config.cell * np.column_stack([rooms[:, :2].mean(axis=1), rooms[:, 2:].mean(axis=1)])
    inner = (
        config.cell * np.column_stack([np.diff(rooms[:, :2]), np.diff(rooms[:, 2:])]) - thickness
    )
    turned = rng.uniform(-config.turn, config.turn, (len(rooms), 1))
    turned = turned + rng.uniform(-config.turn, config.turn, (len(rooms), 4))
    angle = turned + np.arange(4) * 0.5 * np.pi
    outward = np.stack([np.cos(angle), np.sin(angle)], axis=2)  # (R, 4, 2)
    along = np.stack([-outward[:, :, 1], outward[:, :, 0]], axis=2)
    reach = inner[:, [0, 1, 0, 1]][:, :, None]
    width = inner[:, [1, 0, 1, 0]][:, :, None]
    middle = centre[:, None, :] + 0.5 * reach * outward
    ends = np.stack([middle - 0.5 * width * along, middle + 0.5 * width * along], axis=2)
    turn = np.array([[np.cos(heading), -np.sin(heading)], [np.sin(heading), np.cos(heading)]])
    return (ends @ turn.T).reshape(-1, 2, 2), (-outward @ turn.T).reshape(-1, 2)


def _walls(grid: IntArray) -> IntArray:
    """(W, 2) faces back to back: where cells of two rooms touch."""
    found = set()
    for first, second, side in ((grid[:-1], grid[1:], 0), (grid[:, :-1], grid[:, 1:], 1)):
        touch = (first != second) & (first >= 0) & (second >= 0)
        pairs = np.unique(np.column_stack([first[touch], second[touch]]), axis=0)
        found |= {(4 * int(a) + side, 4 * int(b) + side + 2) for a, b in pairs}
    return np.array(sorted(found), dtype=np.int64).reshape(-1, 2)
