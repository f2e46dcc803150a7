"""Piers on the walls of random rooms, chases in them, and pillars that stand free."""

from __future__ import annotations

import numpy as np
from shapely.geometry import Polygon, box

from worlds.generator.config import GeneratorConfig
from worlds.generator.facing import edges


def with_piers(
    rng: np.random.Generator, config: GeneratorConfig, polygon: Polygon, doors: list[Polygon]
) -> Polygon:
    """A room with some short parts of its walls stepped into it or out of it."""
    if rng.random() >= config.piers:
        return polygon
    for _ in range(int(rng.integers(1, 4))):
        sides = [(p, q) for p, q in edges(polygon) if np.linalg.norm(q - p) > 2.0]
        if not sides:
            break
        p, q = sides[int(rng.integers(len(sides)))]
        length = float(np.linalg.norm(q - p))
        run = (q - p) / length
        inward = np.array([-run[1], run[0]])
        width, depth = float(rng.uniform(0.3, 1.2)), float(rng.uniform(0.12, 0.5))
        start = p + run * float(rng.uniform(0.0, length - width))
        corners = [start, start + width * run]
        pier = Polygon([*corners, corners[1] + depth * inward, corners[0] + depth * inward])
        # Nobody could pass by a pier that leaves less than a door's width.
        free = pier.buffer(config.door_width[1], join_style="mitre").intersection(polygon)
        whole = free.area > 2.2 * config.door_width[1] * (width + depth)
        if whole and all(door.distance(pier) > 0.3 for door in doors):
            stepped = polygon.difference(pier)
            polygon = stepped if isinstance(stepped, Polygon) else polygon
    return polygon


def pillars(
    rng: np.random.Generator,
    config: GeneratorConfig,
    polygons: list[Polygon],
    doors: list[Polygon],
) -> list[Polygon]:
    """Pillars that stand free in rooms."""
    found: list[Polygon] = []
    for polygon in polygons:
        inner = polygon.buffer(-1.2)
        if inner.is_empty or rng.random() >= config.pillars:
            continue
        side = float(rng.uniform(0.3, 0.8))
        x0, y0, x1, y1 = inner.bounds
        for _ in range(int(rng.integers(1, 5))):
            x, y = rng.uniform([x0, y0], [x1, y1])
            pillar = box(x - side / 2, y - side / 2, x + side / 2, y + side / 2)
            if inner.covers(pillar) and all(pillar.distance(other) > 1.2 for other in found):
                found.append(pillar)
    return [pillar for pillar in found if all(pillar.distance(door) > 1.0 for door in doors)]
