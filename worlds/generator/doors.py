"""The doors of a random building."""

from __future__ import annotations

import numpy as np
from shapely.geometry import Polygon

from worlds.generator.config import GeneratorConfig
from worlds.generator.facing import facing

DOOR_OVERHANG = 0.01
"""How far a door's footprint reaches into the rooms, so that it surely cuts the wall [m]."""


def draw_doors(
    rng: np.random.Generator, config: GeneratorConfig, polygons: list[Polygon]
) -> list[Polygon]:
    """Door footprints that join every room to the others where a wall allows it."""
    pairs = [(i, j) for i in range(len(polygons)) for j in range(i)]
    group = list(range(len(polygons)))
    doors: list[Polygon] = []
    # Big rooms and corridors first: doors lead to them rather than from cell to cell.
    size = [p.length + float(rng.uniform(0.0, 6.0)) for p in polygons]
    for i, j in sorted(pairs, key=lambda pair: -max(size[pair[0]], size[pair[1]])):
        if group[i] == group[j] and rng.random() > config.extra_door:
            continue
        door = _door(rng, config, polygons[i], polygons[j])
        if door is not None and all(door.distance(d) > 0.3 for d in doors):
            doors.append(door)
            group = [group[j] if g == group[i] else g for g in group]
    return doors


def _door(
    rng: np.random.Generator, config: GeneratorConfig, a: Polygon, b: Polygon
) -> Polygon | None:
    """A door somewhere in a wall between two rooms; None if no stretch of wall is long enough."""
    width = float(rng.uniform(*config.door_width))
    stretches = facing(a, b, width + 0.2)
    if not stretches:
        return None
    (p, q), (_, s) = stretches[int(rng.integers(len(stretches)))]
    length = float(np.linalg.norm(q - p))
    run = (q - p) / length
    across = (s - p) / np.linalg.norm(s - p)
    start = p + run * float(rng.uniform(0.1, length - width - 0.1)) - DOOR_OVERHANG * across
    depth = (np.linalg.norm(s - p) + 2 * DOOR_OVERHANG) * across
    door = Polygon([start, start + width * run, start + width * run + depth, start + depth])
    # A corner cut off can leave an edge with no room behind it.
    joins = all(room.intersection(door).area > 0.5 * DOOR_OVERHANG * width for room in (a, b))
    return door if joins else None
