"""Ramps between storeys as solids, and the floors and ceilings that they pass through."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from shapely.geometry import Polygon

from worlds.fittings import BOX_TRIANGLES
from worlds.model import SLAB, Slab
from worlds.plan import Plan, Ramp
from worlds.solids import Solid
from worlds.truth import FLOOR, NO_FACE

INTO_WALLS = 0.05
"""A ramp reaches this far into the walls beside it, so that no ray slips between [m]."""
INTO_FLOOR = 0.05
"""... and into the floor that it starts from [m]."""


def ramp_solids(plan: Plan, ramps: Sequence[Ramp]) -> list[Solid]:
    """The ramps as wedges. Their surface is no face, and no storey's floor."""
    return [_wedge(plan, ramp, f"ramp{k}") for k, ramp in enumerate(ramps)]


def _wedge(plan: Plan, ramp: Ramp, name: str) -> Solid:
    left = ramp.foot[0] - ramp.foot[1]
    aside = INTO_WALLS * left / np.linalg.norm(left)
    # Corners as those of a box: x uphill, y to the left, z upwards.
    level = np.array(
        [
            ramp.foot[1] - aside,
            ramp.head[1] - aside,
            ramp.foot[0] + aside,
            ramp.head[0] + aside,
        ]
    )
    low, high = plan.storeys[ramp.storey].z_floor, plan.storeys[ramp.storey + 1].z_floor
    z = np.concatenate([np.full(4, low - INTO_FLOOR), [low, high, low, high]])
    vertices = np.column_stack([np.tile(level, (2, 1)), z])
    return Solid(name, vertices, BOX_TRIANGLES, np.full(12, NO_FACE, dtype=np.int32))


def ramp_holes(index: int, plate: Slab, ramps: Sequence[Ramp]) -> list[Polygon]:
    """Where ramps pass through a floor or ceiling of storey ``index``."""
    is_floor = plate.label == FLOOR
    return [ramp.outline for ramp in ramps if ramp.storey + is_floor == index]


def down_to_ceiling(plan: Plan, index: int, plate: Slab) -> Slab:
    """The floor of storey ``index``, reaching down to the ceiling below it: nobody looks into what
    is between them."""
    below = plan.storeys[index - 1].z_ceiling + SLAB
    return replace(plate, low=np.append(plate.low[:2], min(plate.low[2], below)))
