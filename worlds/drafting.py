"""Wall bodies and door footprints from what a drawing gives: centre lines, points and widths."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import shapely
from shapely import STRtree
from shapely.geometry import LineString, MultiPolygon, Point, Polygon

from slam.core import Array

MITRE_LIMIT = 3.0
"""A corner reaches at most this many half thicknesses beyond its joint."""
JOINT = 1e-6
"""Ends of centre lines that are nearer than this meet [m]."""
DEEPER = 0.01
"""What a door's footprint reaches beyond the wall body on either side [m]."""
JAMB = 0.3
"""Sides of a wall body that are shorter than this are taken for its ends [m]."""
THICKEST = 0.8
"""The thickest wall body that a door given by point and width can lie on [m]."""


@dataclass(frozen=True)
class CentreLine:
    """A straight wall: the middle of its body from ``start`` to ``end``, (2,) each [m]."""

    start: Array
    end: Array
    thickness: float

    @property
    def direction(self) -> Array:
        """(2,) unit vector from start to end."""
        return (self.end - self.start) / np.linalg.norm(self.end - self.start)

    def body(self) -> Polygon:
        """The wall's footprint, cut off square at both ends."""
        across = self.thickness / 2.0 * left_of(self.direction)
        corners = [self.start - across, self.end - across, self.end + across, self.start + across]
        return Polygon(corners)


def left_of(direction: Array) -> Array:
    """A plan vector turned by +90 degrees."""
    return np.array([-direction[1], direction[0]])


def draw_bodies(lines: Sequence[CentreLine], outlines: Sequence[Polygon]) -> list[Polygon]:
    """Polygons whose union is the walls; centre lines that meet end to end get a proper corner."""
    return [line.body() for line in lines] + joints(lines) + list(outlines)


def as_multipolygon(shape: shapely.Geometry) -> MultiPolygon:
    """The polygons of any geometry, also of a collection of several."""
    parts = shapely.get_parts(shapely.get_parts(shape))
    return MultiPolygon([p for p in parts if p.geom_type == "Polygon" and not p.is_empty])


def joints(lines: Sequence[CentreLine]) -> list[Polygon]:
    """What the square ends of walls that meet at a point leave out of the corner's outer side."""
    if not lines:
        return []
    ends = np.array([p for line in lines for p in (line.start, line.end)])
    away = np.array([sign * line.direction for line in lines for sign in (1.0, -1.0)])
    half = np.repeat([line.thickness / 2.0 for line in lines], 2)
    keys = np.round(ends / JOINT).astype(np.int64)
    _, group = np.unique(keys, axis=0, return_inverse=True)
    order = np.argsort(group, kind="stable")
    meetings = np.split(order, np.flatnonzero(np.diff(group[order])) + 1)
    found = [_corner(ends[m[0]], away[m], half[m]) for m in meetings if len(m) > 1]
    return [corner for corner in found if corner is not None]


def _corner(point: Array, away: Array, half: Array) -> Polygon | None:
    """The outer corner where walls leave ``point`` in directions ``away`` (K, 2), if it has one."""
    order = np.argsort(np.arctan2(away[:, 1], away[:, 0]), kind="stable")
    following = np.roll(order, -1)
    for i, j in zip(order, following, strict=True):
        sine = away[i, 0] * away[j, 1] - away[i, 1] * away[j, 0]
        if sine < -1e-9:  # more than half a turn to the next wall: the outer side
            return _mitre(point, (away[i], half[i]), (away[j], half[j]))
    return None


def _mitre(point: Array, first: tuple[Array, float], second: tuple[Array, float]) -> Polygon:
    (u, h), (v, k) = first, second
    side_u, side_v = h * left_of(u), -k * left_of(v)
    # point + side_u + a u = point + side_v + b v, the meeting point of the two outer sides
    a, _ = np.linalg.solve(np.column_stack([u, -v]), side_v - side_u)
    tip = side_u + a * u
    reach = MITRE_LIMIT * max(h, k)
    tips = [tip] if np.linalg.norm(tip) <= reach else []
    return Polygon([point + p for p in [np.zeros(2), side_u, *tips, side_v]]).buffer(0)


def door_footprint(at: Array, width: float, bodies: STRtree) -> Polygon | None:
    """The rectangle that a door of ``width`` at ``at`` (2,) cuts out of the wall body it lies on.

    bodies: polygons whose union is the walls. The footprint is slightly deeper than the body. None
    where no body at most THICKEST across surrounds the door.
    """
    walls = _around(at, width / 2.0 + 2.0 * THICKEST, bodies)
    for direction in _directions(at, walls):
        half, across = width / 2.0 * direction, left_of(direction)
        sections = [_section(at + k * half, across, walls) for k in (0.0, -0.98, 0.98)]
        if sections[0] is None or not _inside(at - half, at + half, walls):
            continue
        known = np.array([section for section in sections if section is not None])
        near = at + (known[:, 0].min() - DEEPER) * across
        far = at + (known[:, 1].max() + DEEPER) * across
        return Polygon([near - half, near + half, far + half, far - half])
    return None


def _around(at: Array, reach: float, bodies: STRtree) -> MultiPolygon:
    """The walls in a square around a point."""
    square = shapely.box(*(at - reach), *(at + reach))
    near = bodies.geometries[bodies.query(square)]
    return as_multipolygon(shapely.union_all(near).intersection(square))


def _directions(at: Array, walls: MultiPolygon) -> list[Array]:
    """Directions of the wall sides around ``at``, the nearest first; short ones (jambs) last."""
    rings = [np.asarray(ring.coords) for p in walls.geoms for ring in (p.exterior, *p.interiors)]
    if not rings:
        return []
    starts = np.concatenate([r[:-1] for r in rings])
    ends = np.concatenate([r[1:] for r in rings])
    distance = shapely.distance(shapely.linestrings(np.stack([starts, ends], axis=1)), Point(at))
    run = ends - starts
    length = np.linalg.norm(run, axis=1)
    order = np.lexsort((distance, length < JAMB))
    return [run[i] / length[i] for i in order if distance[i] < THICKEST]


def _section(at: Array, across: Array, walls: MultiPolygon) -> tuple[float, float] | None:
    """From where to where the body around ``at`` reaches along ``across``, if it is a wall's."""
    probe = LineString([at - THICKEST * across, at + THICKEST * across])
    for part in shapely.get_parts(probe.intersection(walls)):
        if part.geom_type == "LineString" and part.distance(Point(at)) < JOINT:
            along = (np.asarray(part.coords) - at) @ across
            if np.ptp(along) <= THICKEST:
                return float(along.min()), float(along.max())
    return None


def _inside(start: Array, end: Array, walls: MultiPolygon) -> bool:
    line = LineString([start, end])
    return bool(line.intersection(walls).length > line.length - JOINT)
