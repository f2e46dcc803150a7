"""The doors of a random building, and the openings between its corridors."""

from __future__ import annotations

import numpy as np
from shapely.geometry import Polygon

from worlds.generator.config import GeneratorConfig
from worlds.generator.facing import Stretch, facing

DOOR_OVERHANG = 0.01
"""How far a door's footprint reaches into the rooms, so that it surely cuts the wall [m]."""
WIDEST_OPENING = 4.5
"""Between corridors: where they face each other along more than this, they lie side by side [m]."""


def draw_doors(
    rng: np.random.Generator, config: GeneratorConfig, polygons: list[Polygon], kinds: list[str]
) -> tuple[list[Polygon], list[Polygon]]:
    """Footprints that join every room to the others where a wall allows it: of doors, and of
    openings between corridors."""
    pairs = [(i, j) for i in range(len(polygons)) for j in range(i)]
    group = list(range(len(polygons)))
    doors: list[Polygon] = []
    openings: list[Polygon] = []
    # Big rooms and corridors first: doors lead to them rather than from cell to cell.
    size = [p.length + float(rng.uniform(0.0, 6.0)) for p in polygons]
    for i, j in sorted(pairs, key=lambda pair: -max(size[pair[0]], size[pair[1]])):
        halls = config.opening > 0.0 and kinds[i] == kinds[j] == "corridor"
        again = max(config.extra_door, config.opening) if halls else config.extra_door
        if group[i] == group[j] and rng.random() > again:
            continue
        wide = halls and rng.random() < config.opening
        door = (_opening if wide else _door)(rng, config, polygons[i], polygons[j])
        if door is not None and all(door.distance(d) > 0.3 for d in doors + openings):
            (openings if wide else doors).append(door)
            group = [group[j] if g == group[i] else g for g in group]
    return doors, openings


def _door(
    rng: np.random.Generator, config: GeneratorConfig, a: Polygon, b: Polygon
) -> Polygon | None:
    """A door somewhere in a wall between two rooms; None if no stretch of wall is long enough."""
    width = float(rng.uniform(*config.door_width))
    stretches = facing(a, b, width + 0.2)
    if not stretches:
        return None
    stretch = stretches[int(rng.integers(len(stretches)))]
    return _through(stretch, rng.uniform(0.1, _length(stretch) - width - 0.1), width, a, b)


def _opening(
    rng: np.random.Generator, config: GeneratorConfig, a: Polygon, b: Polygon
) -> Polygon | None:
    """What is left open of a wall between two corridors: most of it, or all."""
    stretches = [s for s in facing(a, b, config.door_width[1]) if _length(s) < WIDEST_OPENING]
    if not stretches:
        return None
    stretch = stretches[int(rng.integers(len(stretches)))]
    length = _length(stretch)
    stubs = rng.uniform(0.0, min(0.5, (length - config.door_width[0]) / 2), 2)
    stubs[rng.random(2) < 0.3] = 0.0
    return _through(stretch, stubs[0], length - stubs.sum(), a, b)


def _length(stretch: Stretch) -> float:
    (p, q), _ = stretch
    return float(np.linalg.norm(q - p))


def _through(stretch: Stretch, at: float, width: float, a: Polygon, b: Polygon) -> Polygon | None:
    """A footprint of that width through a wall from ``at`` along it; None if a room is not behind
    it: a corner cut off can leave an edge with none."""
    (p, q), (_, s) = stretch
    run = (q - p) / _length(stretch)
    across = (s - p) / np.linalg.norm(s - p)
    start = p + run * at - DOOR_OVERHANG * across
    depth = (np.linalg.norm(s - p) + 2 * DOOR_OVERHANG) * across
    door = Polygon([start, start + width * run, start + width * run + depth, start + depth])
    joins = all(room.intersection(door).area > 0.5 * DOOR_OVERHANG * width for room in (a, b))
    return door if joins else None
