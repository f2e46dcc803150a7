"""Ramps between storeys as solids, and the floors and ceilings that they pass through."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import shapely

from slam.core import Array
from worlds.convex import ConvexPart, convex_parts
from worlds.drafting import as_multipolygon
from worlds.model import BOX_TRIANGLES, SLAB, Slab
from worlds.plan import Plan, Ramp
from worlds.solids import Solid, prism
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


def with_openings(plan: Plan, index: int, plate: Slab, ramps: Sequence[Ramp]) -> list[Solid] | None:
    """A floor or ceiling of storey ``index`` as solids, open where ramps pass; None: it is whole.

    Such a floor reaches down to the ceiling below it: nobody looks into what is between them.
    """
    is_floor = plate.label == FLOOR
    holes = [ramp.outline for ramp in ramps if ramp.storey + is_floor == index]
    if not holes:
        return None
    if is_floor:
        below = plan.storeys[index - 1].z_ceiling + SLAB
        low = np.append(plate.low[:2], min(plate.low[2], below))
        plate = replace(plate, low=low)
    whole = shapely.box(*plate.low[:2], *plate.high[:2])
    convex = convex_parts(as_multipolygon(whole.difference(shapely.union_all(holes))))
    return [
        _part_of(f"{plate.name}_{k}", plate, convex.points, part)
        for k, part in enumerate(convex.parts)
    ]


def _part_of(name: str, plate: Slab, points: Array, part: ConvexPart) -> Solid:
    ring, count = list(part.ring), len(part.ring)
    caps = np.array([[ring.index(corner) for corner in triangle] for triangle in part.triangles])
    low, high = (
        np.column_stack([points[ring], np.full(count, level[2])])
        for level in (plate.low, plate.high)
    )
    return prism(name, low, high, np.full(count, NO_FACE), caps, plate.label)
