"""Rooms that are not rectangles: joined with a neighbour, carved, or with a corner cut off."""

from __future__ import annotations

import numpy as np
from shapely import affinity
from shapely.geometry import Polygon, box
from shapely.ops import unary_union

from worlds.generator.config import GeneratorConfig
from worlds.generator.facing import facing
from worlds.generator.layouts import Rect


def merged(rects: list[Rect], corridors: set[int]) -> tuple[list[Polygon], list[str]]:
    """Rooms and their kinds; a rectangle that touches the one before it is of the same room."""
    polygons: list[Polygon] = []
    kinds: list[str] = []
    for i, rect in enumerate(rects):
        shape = box(*rect)
        if polygons and polygons[-1].distance(shape) == 0.0:
            polygons[-1] = unary_union([polygons[-1], shape])
        else:
            polygons.append(shape)
            kinds.append("corridor" if i in corridors else "room")
    return polygons, kinds


def reshaped(
    rng: np.random.Generator,
    config: GeneratorConfig,
    gap: float,
    polygons: list[Polygon],
    kinds: list[str],
) -> tuple[list[Polygon], list[str]]:
    """Some rooms joined with a neighbour, some carved, some with a slanted corner."""
    polygons, kinds = list(polygons), list(kinds)
    for i in range(len(polygons) - 1, 0, -1):
        if rng.random() < config.join:
            j = int(rng.integers(i))
            joined = _joined(polygons[i], polygons[j], gap)
            if joined is not None:
                polygons[j] = joined
                del polygons[i], kinds[i]
    for i in range(len(polygons)):
        if rng.random() < config.carve:
            polygons[i], closet = _carved(rng, polygons[i], gap)
            if closet is not None and rng.random() < 0.7:
                polygons.append(closet)
                kinds.append("room")
        elif rng.random() < config.chamfer:
            polygons[i] = _chamfered(rng, polygons[i], config.curve)
    return polygons, kinds


def _joined(a: Polygon, b: Polygon, gap: float) -> Polygon | None:
    """Two neighbours as one room with the wall between them taken out; None if they are none."""
    for (p, q), (r, s) in facing(a, b, 1.0):
        bridge = Polygon([p, q, r, s])
        joined = unary_union([a, b, bridge.buffer(1e-6, join_style="mitre")]).simplify(1e-4)
        if isinstance(joined, Polygon) and not joined.interiors:
            return joined
    return None


def _carved(
    rng: np.random.Generator, polygon: Polygon, gap: float
) -> tuple[Polygon, Polygon | None]:
    """A rectangle without one corner, and the closet in that corner (None: too small)."""
    x0, y0, x1, y1 = polygon.bounds
    if len(polygon.exterior.coords) != 5 or min(x1 - x0, y1 - y0) < 3.2:
        return polygon, None
    width = float(rng.uniform(1.0, (x1 - x0) - 1.4 - gap))
    depth = float(rng.uniform(1.0, (y1 - y0) - 1.4 - gap))
    left, low = rng.random() < 0.5, rng.random() < 0.5
    cx0, cx1 = (x0, x0 + width) if left else (x1 - width, x1)
    cy0, cy1 = (y0, y0 + depth) if low else (y1 - depth, y1)
    body = box(cx0, cy0, cx1, cy1).buffer(gap, join_style="mitre")
    room = polygon.difference(body)
    return (room, box(cx0, cy0, cx1, cy1)) if isinstance(room, Polygon) else (polygon, None)


def _chamfered(rng: np.random.Generator, polygon: Polygon, curve: float) -> Polygon:
    """A rectangle with one corner cut off by a slanted wall, or by a round one."""
    x0, y0, x1, y1 = polygon.bounds
    if len(polygon.exterior.coords) != 5 or min(x1 - x0, y1 - y0) < 3.0:
        return polygon
    dx, dy = rng.uniform(0.8, 0.5 * (x1 - x0)), rng.uniform(0.8, 0.5 * (y1 - y0))
    ends = [(x0 + dx, y0), (x0, y0 + dy)]
    if curve > 0.0 and rng.random() < curve:
        radius = float(max(dx, dy))
        angle = np.linspace(1.5 * np.pi, np.pi, 1 + max(2, round(radius * 0.5 * np.pi / 0.7)))
        ends = [(x0 + radius * (1.0 + np.cos(a)), y0 + radius * (1.0 + np.sin(a))) for a in angle]
    corner = Polygon([(x0, y0), *ends])
    if rng.random() < 0.5:
        corner = affinity.scale(corner, -1, 1, origin=((x0 + x1) / 2, 0))
    room = polygon.difference(corner)
    return room if isinstance(room, Polygon) else polygon
