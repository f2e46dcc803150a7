"""Rooms filled with furniture and building material, so that the base still gets everywhere."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from slam.core import Array
from worlds.conditions import Conditions
from worlds.fittings import Fitting, about_z, footprint_of
from worlds.furniture import FURNITURE, SITE, Maker, Piece
from worlds.leaves import open_leaves
from worlds.roomspace import RoomSpace
from worlds.survey import BuiltStorey
from worlds.truth import CLUTTER, Room, Truth
from worlds.truth import FURNITURE as FURNITURE_LABEL

OFF_WALL = (0.03, 0.12)
"""Between furniture and the wall behind it [m]."""
PASSAGE = 0.25
"""What is not a room (corridors, stairs) gets this part of what a room gets."""
SIDE_BY_SIDE = 0.1
"""How far beyond its width a piece counts as covering the wall [m]."""
TRIES = 3
"""Attempts for every metre of wall that is to be covered."""
HEADROOM = 0.1
"""Between a piece and the ceiling, at least [m]."""


@dataclass(frozen=True)
class _Stock:
    """What is brought: kinds with their weights, the label of its returns, and how much of it."""

    makers: Mapping[Maker, float]
    label: int
    share: float


def furnished(
    storey: BuiltStorey, truth: Truth, conditions: Conditions, rng: np.random.Generator
) -> list[Fitting]:
    """All that stands in a storey. truth: of the building as built."""
    stocks = [
        _Stock(FURNITURE, FURNITURE_LABEL, conditions.furniture),
        _Stock(SITE, CLUTTER, conditions.clutter),
    ]
    stocks = [stock for stock in stocks if stock.share > 0.0]
    leaves = max(conditions.open_doors, conditions.glass_doors) > 0.0
    rooms = [room for room in truth.rooms if room.storey == storey.index]
    if not rooms or not (stocks or leaves):
        return []
    spaces = {room.id: _space(room, truth) for room in rooms}
    fittings = open_leaves(storey, spaces, rooms[0].id, conditions, rng) if leaves else []
    for room in rooms:
        for stock in stocks:
            pieces = _filled(room, truth, spaces[room.id], stock, storey.layout.height, rng)
            fittings += [
                _standing(piece, at, yaw, storey, stock.label, len(fittings) + k)
                for k, (piece, at, yaw) in enumerate(pieces)
            ]
    return fittings


def _space(room: Room, truth: Truth) -> RoomSpace:
    doors = [door for door in truth.doors if room.id in door.rooms]
    return RoomSpace(room.polygon, doors)


Placed = tuple[Piece, Array, float]
"""A piece, where its frame's origin stands (2,), and its yaw."""


def _filled(
    room: Room,
    truth: Truth,
    space: RoomSpace,
    stock: _Stock,
    height: float,
    rng: np.random.Generator,
) -> list[Placed]:
    """Pieces until enough of the walls is covered, or nothing fits any more."""
    walls = [(part, truth.faces[f].normal[:2]) for f in room.faces for part in truth.faces[f].parts]
    lengths = np.array([np.linalg.norm(part[1] - part[0]) for part, _ in walls])
    if not len(walls):
        return []
    to_cover = stock.share * float(lengths.sum()) * (1.0 if room.kind == "room" else PASSAGE)
    placed: list[Placed] = []
    for _ in range(int(np.ceil(TRIES * to_cover))):
        piece = _drawn(stock.makers, rng)
        low, high = piece.extent
        if high[2] > height - HEADROOM:
            continue
        if piece.free:
            at, yaw = _in_the_open(room, walls, lengths, rng)
        else:
            at, yaw = _at_a_wall(walls, lengths, float(high[0] - low[0]), rng)
        if space.take(
            footprint_of([b.moved(about_z(yaw), np.append(at, 0.0)) for b in piece.blocks])
        ):
            placed.append((piece, at, yaw))
            to_cover -= float(high[0] - low[0]) + SIDE_BY_SIDE
            if to_cover <= 0.0:
                break
    return placed


def _drawn(makers: Mapping[Maker, float], rng: np.random.Generator) -> Piece:
    kinds, weights = list(makers), np.array(list(makers.values()))
    return kinds[int(rng.choice(len(kinds), p=weights / weights.sum()))](rng)


def _at_a_wall(
    walls: Sequence[tuple[Array, Array]], lengths: Array, width: float, rng: np.random.Generator
) -> tuple[Array, float]:
    """Somewhere with its back to a wall, y into the room; in a corner as often as not."""
    k = int(rng.choice(len(walls), p=lengths / lengths.sum()))
    (left, right), normal = walls[k][0], walls[k][1] / np.linalg.norm(walls[k][1])
    slack = max(float(lengths[k]) - width, 0.0)
    share = float(np.clip(rng.uniform(-0.3, 1.3), 0.0, 1.0))
    along = (right - left) / lengths[k]
    gap = float(rng.uniform(*OFF_WALL))
    clear = width / 2.0 + gap if slack > 2.0 * gap else width / 2.0
    place = clear + share * max(float(lengths[k]) - 2.0 * clear, 0.0)
    at = left + place * along + gap * normal
    return at, float(np.arctan2(-normal[0], normal[1]))


def _in_the_open(
    room: Room, walls: Sequence[tuple[Array, Array]], lengths: Array, rng: np.random.Generator
) -> tuple[Array, float]:
    """Anywhere in the room, square to its longest wall or nearly so."""
    low_x, low_y, high_x, high_y = room.polygon.bounds
    normal = walls[int(np.argmax(lengths))][1]
    turn = float(rng.integers(4)) * np.pi / 2.0 + float(rng.normal(0.0, 0.05))
    yaw = float(np.arctan2(-normal[0], normal[1])) + turn
    return rng.uniform([low_x, low_y], [high_x, high_y]), yaw


def _standing(
    piece: Piece, at: Array, yaw: float, storey: BuiltStorey, label: int, number: int
) -> Fitting:
    foot = np.append(at, storey.layout.storey.z_floor)
    blocks = tuple(block.moved(about_z(yaw), foot) for block in piece.blocks)
    name = f"s{storey.index}_{piece.kind}{number}"
    return Fitting(name, piece.kind, storey.index, label, blocks, footprint_of(blocks))
