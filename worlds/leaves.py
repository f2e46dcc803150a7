"""Door leaves that stand open."""

from __future__ import annotations

import numpy as np

from slam.core import Array
from worlds.conditions import Conditions
from worlds.doorways import Doorway
from worlds.fittings import Block, Fitting, about_z, footprint_of
from worlds.roomspace import RoomSpace
from worlds.sidemap import NOTHING
from worlds.survey import BuiltStorey
from worlds.truth import GLASS, LEAF

THICK = 0.04
"""Of a leaf [m]."""
OFF_WALL = 0.05
"""Between a leaf's hinge and the face of the wall: more than a leaf is thick [m]."""
OFF_FLOOR = 0.01
"""Under a leaf [m]."""
ANGLES = (np.radians(82.0), np.radians(165.0))
"""How far leaves are opened."""
WIDTHS = (0.5, 1.4)
"""Doorways with a single leaf [m]."""
TRIES = 8


def open_leaves(
    storey: BuiltStorey,
    spaces: dict[int, RoomSpace],
    first_room: int,
    conditions: Conditions,
    rng: np.random.Generator,
) -> list[Fitting]:
    """Leaves of the storey's doors, each in one of the two rooms, where there is space for it.

    spaces: the free floor of each room by its id, which shrinks; first_room: id of the storey's
    first room.
    """
    found: list[Fitting] = []
    for door in storey.layout.doors:
        chance, glass = rng.random(2)
        share = max(conditions.open_doors, conditions.glass_doors)
        if chance >= share or not WIDTHS[0] <= door.width <= WIDTHS[1] or door.space.is_empty:
            continue
        of_glass = conditions.open_doors == 0.0 or glass < conditions.glass_doors
        leaf = _hung(storey, door, spaces, first_room, rng)
        if leaf is not None:
            name = f"s{storey.index}_leaf{len(found)}"
            label = GLASS if of_glass else LEAF
            blocks = (leaf,)
            found.append(Fitting(name, "leaf", storey.index, label, blocks, footprint_of(blocks)))
    return found


def _hung(
    storey: BuiltStorey,
    door: Doorway,
    spaces: dict[int, RoomSpace],
    first_room: int,
    rng: np.random.Generator,
) -> Block | None:
    """A leaf at one of the four jambs of a doorway, None where none can be opened."""
    for _ in range(TRIES):
        side, jamb = int(rng.integers(2)), int(rng.integers(2))
        angle = float(rng.uniform(*ANGLES))
        room = door.rooms[side]
        if room == NOTHING:
            continue
        leaf = _leaf(storey, door, side, jamb, angle)
        if spaces[first_room + room].take(footprint_of([leaf]), in_doorway=True):
            return leaf
    return None


def _leaf(storey: BuiltStorey, door: Doorway, side: int, jamb: int, angle: float) -> Block:
    """The leaf at a jamb (0, 1) on a side (0, 1) of the wall, opened by an angle."""
    across = door.across if side == 0 else -door.across
    along = np.array([-across[1], across[0]])
    towards = along if jamb == 0 else -along  # from the hinge to the other jamb
    corners = np.asarray(door.space.exterior.coords) - door.middle
    foot = door.middle - door.width / 2.0 * towards + float((corners @ across).max()) * across
    hinge = storey.built.at_height(foot[None], door.height / 2.0)[0]
    # The closed leaf lies along ``towards``; it opens towards ``across``, behind its hinge.
    swing = np.cos(angle) * towards + np.sin(angle) * across
    back = np.sin(angle) * -towards + np.cos(angle) * across
    hinge = hinge + OFF_WALL * across
    z_floor, height = storey.layout.storey.z_floor, door.height - 2.0 * OFF_FLOOR
    half = np.array([(door.width - 0.01) / 2.0, THICK / 2.0, height / 2.0])
    middle = hinge + half[0] * swing + half[1] * back
    centre: Array = np.append(middle, z_floor + OFF_FLOOR + half[2])
    return Block(centre, half, about_z(float(np.arctan2(swing[1], swing[0]))))
