"""Which planes bound a cluster: two across x and two across y, or one pair of a corridor."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.spatial import cKDTree

from semantics.sgraphs.config import SgraphsConfig
from slam.core import Array, MapPlane


@dataclass(frozen=True)
class Side:
    """A vertical plane in plan view, in the axes of the building (N, 2) [m].

    normal: (2,), d: n.x + d = 0 in plan view.
    """

    plane: MapPlane
    points: Array
    normal: Array
    d: float

    @property
    def axis(self) -> int:
        """0: across x, 1: across y."""
        return int(abs(self.normal[1]) > abs(self.normal[0]))

    @property
    def high(self) -> bool:
        """Is a room before it on the side of lower coordinates?"""
        return bool(self.normal[self.axis] < 0.0)

    def foot(self, origin: Array) -> Array:
        """(2,) the point of the plane nearest to ``origin``."""
        return np.asarray(origin - (self.normal @ origin + self.d) * self.normal)

    @cached_property
    def tree(self) -> cKDTree:
        """Of its points, which many clusters ask."""
        return cKDTree(self.points)

    @property
    def at(self) -> float:
        """Coordinate along ``axis`` where its points lie."""
        return float(np.median(self.points[:, self.axis]))


Pair = tuple[Side, Side]
"""The low and the high side across one axis."""


@dataclass(frozen=True)
class Match:
    """A cluster with its sides across x and across y; one pair is None in a corridor.

    centre: (2,) in the axes of the building; cluster: (V, 2) its vertices, map frame.
    """

    x: Pair | None
    y: Pair | None
    centre: Array
    cluster: Array

    @property
    def sides(self) -> tuple[Side, ...]:
        """Low and high across x, low and high across y, as far as there are any."""
        return (self.x or ()) + (self.y or ())

    @property
    def kind(self) -> str:
        """room (four sides), x or y (a corridor between two planes across that axis)."""
        return "room" if self.x and self.y else "x" if self.x else "y"


def axes_of(planes: Sequence[MapPlane], before: Array) -> Array:
    """(2, 2) rotation from plan view of the map to the building's axes: the direction in which
    the walls run, weighted by length; of four such, the one next to ``before``."""
    total = 0j
    for plane in planes:
        if not plane.horizontal:
            angle = np.arctan2(plane.normal[1], plane.normal[0])
            length = float(np.linalg.norm(plane.segment[1] - plane.segment[0]))
            total += length * np.exp(4j * angle)
    earlier = float(np.arctan2(before[0, 1], before[0, 0]))
    yaw = float(np.angle(total * np.exp(-4j * earlier))) / 4.0 + earlier
    cosine, sine = np.cos(yaw), np.sin(yaw)
    return np.array([[cosine, sine], [-sine, cosine]])


def side_of(plane: MapPlane, axes: Array) -> Side:
    """A vertical plane in the building's axes, in plan view at the height of its points."""
    steepness = float(np.hypot(*plane.normal[:2]))
    d = (plane.d + plane.normal[2] * float(np.median(plane.points[:, 2]))) / steepness
    return Side(plane, plane.points[:, :2] @ axes.T, axes @ plane.normal[:2] / steepness, d)


def match(
    cluster: Array, axes: Array, sides: Sequence[Side], config: SgraphsConfig
) -> Match | None:
    """The sides of a cluster (V, 2) of the map, if it is a room or a corridor."""
    vertices = cluster @ axes.T
    slots = _best_sides(vertices, sides, config)
    x, y = (
        _pair(slots.get((a, False)), slots.get((a, True)), vertices.mean(axis=0), config)
        for a in (0, 1)
    )
    tree = cKDTree(vertices)
    is_room = x and y and _crossing(x, y) and _aligned(x, y, config)
    is_half = config.halves or not (x and y)
    for pairs in ([(x, y)] if is_room else []) + ([(x, None), (None, y)] if is_half else []):
        if any(pairs):
            centre = centre_of(*pairs, vertices, config)
            if tree.query(centre)[0] <= config.centre:
                return Match(*pairs, centre, cluster)
    return None


def centre_of(x: Pair | None, y: Pair | None, vertices: Array, config: SgraphsConfig) -> Array:
    """(2,) where the lines half-way between the planes meet; a corridor's: half-way between its
    planes, level with the middle of those vertices (V, 2) that are near them."""
    if x and y:
        origin = np.zeros(2) if config.faults else vertices.mean(axis=0)
        return _middle(x, origin) + _middle(y, origin) - origin
    pair = x or y
    assert pair is not None
    near = [s.tree.query(vertices, distance_upper_bound=config.near)[0] for s in pair]
    close = np.isfinite(near).any(axis=0)
    between = vertices[close] if close.any() else vertices
    middle = 0.5 * (between.min(axis=0) + between.max(axis=0))
    if not config.faults:
        return _middle(pair, middle)
    centre = _middle(pair, np.zeros(2))
    u = centre / max(float(np.linalg.norm(centre)), 1e-9)
    return np.asarray(centre + middle - (middle @ u) * u)


def _best_sides(
    vertices: Array, sides: Sequence[Side], config: SgraphsConfig
) -> dict[tuple[int, bool], Side]:
    """By (axis, high): the plane to which most vertices are near."""
    best: dict[tuple[int, bool], tuple[int, Side]] = {}
    for side in sides:
        distance, _ = side.tree.query(vertices, distance_upper_bound=config.near)
        near = np.isfinite(distance)
        if not config.faults:
            near &= vertices @ side.normal + side.d > 0.0
        votes = int(near.sum())
        slot = side.axis, side.high
        if votes >= config.votes and votes > best.get(slot, (0, side))[0]:
            best[slot] = votes, side
    return {slot: side for slot, (_, side) in best.items()}


def _pair(low: Side | None, high: Side | None, origin: Array, config: SgraphsConfig) -> Pair | None:
    """Two sides that face each other, wide enough apart."""
    if low is None or high is None or low.at > high.at:
        return None
    pair = low, high
    return pair if width_of(pair, origin, config) >= config.width else None


def width_of(pair: Pair, origin: Array, config: SgraphsConfig) -> float:
    """How far apart two sides are [m], at a point (2,) between them."""
    low, high = pair
    if config.faults:
        return abs(float((high.foot(np.zeros(2)) - low.foot(np.zeros(2))).sum()))
    return float((high.foot(origin) - low.foot(origin)) @ _direction(low, high))


def _crossing(x: Pair, y: Pair) -> bool:
    """Do the sides across x run across those of y, so that there are corners?"""
    return all(abs(float(a.normal @ b.normal)) < 0.7 for a in x for b in y)


def _direction(low: Side, high: Side) -> Array:
    """(2,) unit vector from the low to the high side."""
    mean = low.normal - high.normal
    return np.asarray(mean / np.linalg.norm(mean))


def _aligned(x: Pair, y: Pair, config: SgraphsConfig) -> bool:
    """Does each plane have enough points on the inner side of the planes across?"""
    counts = [
        count
        for side in y
        for count in (
            (side.points[:, 0] > x[0].points[:, 0].min()).sum(),
            (side.points[:, 0] < x[1].points[:, 0].max()).sum(),
        )
    ]
    counts += [(side.points[:, 1] < y[1].points[:, 1].max()).sum() for side in x]
    if not config.faults:
        counts += [(side.points[:, 1] > y[0].points[:, 1].min()).sum() for side in x]
    return bool(min(counts) > config.aligned)


def _middle(pair: Pair, origin: Array) -> Array:
    return 0.5 * (pair[0].foot(origin) + pair[1].foot(origin))
