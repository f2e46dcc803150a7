"""Polygons cut into few convex parts (constrained Delaunay, then Hertel and Mehlhorn's merging)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import shapely
from shapely.geometry import MultiPolygon

from slam.core import Array

MAX_DENT = 1e-3
"""A corner that is re-entrant by less than this counts as straight [rad]."""
MIN_AREA = 1e-12
"""Triangles below this are numerical noise [m2]."""

Triangle = tuple[int, int, int]


@dataclass(frozen=True)
class ConvexPart:
    """A convex part. ring: its corners, counter-clockwise; triangles: that it is made of."""

    ring: tuple[int, ...]
    triangles: tuple[Triangle, ...]


@dataclass(frozen=True)
class ConvexParts:
    """Convex parts of a polygon over common points (P, 2); only the polygon's own corners occur."""

    points: Array
    parts: tuple[ConvexPart, ...]


def convex_parts(polygons: MultiPolygon) -> ConvexParts:
    """Few convex parts that fill the polygons."""
    triangles = shapely.get_parts(shapely.constrained_delaunay_triangles(polygons))
    corners = np.array([np.asarray(t.exterior.coords)[:3] for t in triangles]).reshape(-1, 2)
    points, index = np.unique(corners, axis=0, return_inverse=True)
    oriented = [_anticlockwise(points, t) for t in index.reshape(-1, 3).tolist()]
    sound = [t for t in oriented if abs(_turn(points, *t)) > 2.0 * MIN_AREA]
    return ConvexParts(points, tuple(_merged(points, sound)))


def _turn(points: Array, a: int, b: int, c: int) -> float:
    """Cross product of ab and bc: positive for a left turn at b."""
    (ax, ay), (bx, by), (cx, cy) = points[a], points[b], points[c]
    return float((bx - ax) * (cy - by) - (by - ay) * (cx - bx))


def _anticlockwise(points: Array, corners: Sequence[int]) -> Triangle:
    a, b, c = corners
    return (a, b, c) if _turn(points, a, b, c) > 0.0 else (a, c, b)


def _merged(points: Array, triangles: list[Triangle]) -> list[ConvexPart]:
    """Removes diagonals, the longest first, as long as the parts beside them stay convex."""
    rings: dict[int, list[int]] = {i: list(t) for i, t in enumerate(triangles)}
    members: dict[int, list[Triangle]] = {i: [t] for i, t in enumerate(triangles)}
    owner = {edge: i for i, t in enumerate(triangles) for edge in _edges(t)}
    diagonals = [e for e in owner if e[0] < e[1] and (e[1], e[0]) in owner]
    diagonals.sort(key=lambda e: (-float(np.hypot(*(points[e[0]] - points[e[1]]))), e))
    for a, b in diagonals:
        i, j = owner[a, b], owner[b, a]
        ring = _without_diagonal(rings[i], rings[j], a, b)
        if i == j or not (_convex_at(points, ring, a) and _convex_at(points, ring, b)):
            continue
        for edge in _edges(rings[j]):
            owner[edge] = i
        rings[i] = ring
        members[i] += members.pop(j)
        del rings[j]
    return [ConvexPart(tuple(rings[i]), tuple(members[i])) for i in rings]


def _edges(ring: Sequence[int]) -> list[tuple[int, int]]:
    return [(ring[k], ring[(k + 1) % len(ring)]) for k in range(len(ring))]


def _without_diagonal(first: list[int], second: list[int], a: int, b: int) -> list[int]:
    """The ring around two rings, the first with the edge a-b and the second with b-a."""
    k, m = first.index(b), second.index(a)
    from_b = first[k:] + first[:k]
    from_a = second[m:] + second[:m]
    return from_b[:-1] + from_a[:-1]


def _convex_at(points: Array, ring: list[int], corner: int) -> bool:
    k = ring.index(corner)
    before, here, after = points[ring[k - 1]], points[corner], points[ring[(k + 1) % len(ring)]]
    u, v = here - before, after - here
    sine = (u[0] * v[1] - u[1] * v[0]) / (np.hypot(*u) * np.hypot(*v))
    return bool(sine >= -MAX_DENT and u @ v > -0.999 * np.hypot(*u) * np.hypot(*v))
