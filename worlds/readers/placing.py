"""Buildings in the coordinates of a country, brought near the origin.

Ray casting works in single precision: a building 1,000 km from the origin would be made of steps of
several centimetres.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from shapely import affinity

from worlds.plan import Plan, Storey

FAR = 1000.0
"""A building with a corner farther than this from the origin is moved [m]."""
ROUND = 100.0
"""It is moved by multiples of this [m]."""


def near_origin(plan: Plan) -> Plan:
    """The plan; if it is far from the origin, moved there, which its notes then say."""
    boxes = np.array([storey.walls.bounds for storey in plan.storeys]).reshape(-1, 4)
    heights = [z for storey in plan.storeys for z in (storey.z_floor, storey.z_ceiling)]
    low = np.array([*boxes[:, :2].min(axis=0), min(heights)])
    high = np.array([*boxes[:, 2:].max(axis=0), max(heights)])
    far = np.maximum(np.abs(low), np.abs(high)) > FAR
    if not far.any():
        return plan
    x, y, z = np.where(far, -ROUND * np.round(low / ROUND), 0.0).tolist()
    notes = f"{plan.notes} Moved by ({x:g}, {y:g}, {z:g}) m to lie near the origin.".strip()
    storeys = tuple(_moved(storey, x, y, z) for storey in plan.storeys)
    return replace(plan, storeys=storeys, notes=notes)


def _moved(storey: Storey, x: float, y: float, z: float) -> Storey:
    return replace(
        storey,
        z_floor=storey.z_floor + z,
        z_ceiling=storey.z_ceiling + z,
        walls=affinity.translate(storey.walls, x, y),
        rooms=tuple(replace(r, outline=affinity.translate(r.outline, x, y)) for r in storey.rooms),
        openings=tuple(
            replace(o, footprint=affinity.translate(o.footprint, x, y)) for o in storey.openings
        ),
    )
