"""The outline of a storey's walls as drawn: its sides, and which of them form one wall body."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import shapely
from numpy.typing import NDArray
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components
from scipy.spatial import KDTree
from shapely import STRtree
from shapely.geometry import MultiPolygon, Polygon

from slam.core import Array, IntArray

TOUCH = 1e-6
"""Points nearer than this to a side lie on it [m]."""
SPECK = 1e-3
"""Wall parts and enclosed gaps smaller than this are drawing errors [m2]."""
PLUG = 1e-3
"""Half the side of the square that joins walls which touch in a point [m]."""
STRAIGHT = np.radians(8.0)
"""Sides that meet at a smaller angle belong to one body [rad]."""
THICKEST = 0.6
"""Sides that face away from each other across at most this much wall belong to one body [m]."""
MIN_COMMON = 0.1
"""... if they run beside each other for this long [m]."""
AROUND = 0.5
"""How far around a shape the solid is cut out [m]: farther than anything that is asked of it."""
SHORT = 0.15
"""A side shorter than this belongs to one body with both its neighbours [m]."""


@dataclass(frozen=True)
class Outline:
    """Sides of the walls' union, in order around its rings, with solid to their left.

    solid: the union; start, end: (E, 2) ends of each side [m]; previous: (E,) the side before;
    part: (E,) which polygon of ``solid`` the side belongs to.
    """

    solid: MultiPolygon
    start: Array
    end: Array
    previous: IntArray
    part: IntArray

    @cached_property
    def length(self) -> Array:
        """(E,) [m]."""
        return np.linalg.norm(self.end - self.start, axis=1)

    @cached_property
    def direction(self) -> Array:
        """(E, 2) unit vectors from start to end."""
        return (self.end - self.start) / self.length[:, None]

    @cached_property
    def normal(self) -> Array:
        """(E, 2) unit vectors out of the solid."""
        return np.column_stack([self.direction[:, 1], -self.direction[:, 0]])

    @cached_property
    def tree(self) -> STRtree:
        """The sides as line strings."""
        return STRtree(shapely.linestrings(np.stack([self.start, self.end], axis=1)))

    def near(self, shape: Polygon | MultiPolygon) -> MultiPolygon | Polygon:
        """The solid around a shape: what it takes to cut or to fill it, in large buildings too."""
        low_x, low_y, high_x, high_y = shape.bounds
        window = (low_x - AROUND, low_y - AROUND, high_x + AROUND, high_y + AROUND)
        try:
            clipped = shapely.clip_by_rect(self.solid, *window)
        except shapely.GEOSException:  # where a sliver is left it fails, now and then
            clipped = None
        if clipped is None or not clipped.is_valid:
            return self.solid.intersection(shapely.box(*window))
        return clipped

    @cached_property
    def _corners(self) -> KDTree:
        return KDTree(self.start)

    def corner_at(self, points: Array) -> IntArray:
        """(K,) the side that starts at each of the points (K, 2), -1 where none does."""
        distance, side = self._corners.query(points)
        return np.where(distance < TOUCH, side, -1)

    def side_at(self, points: Array) -> IntArray:
        """(K,) the side on which each of the points (K, 2) lies, -1 where it lies on none."""
        return self.side_under(points, points)

    def side_under(self, first: Array, second: Array) -> IntArray:
        """(K,) the side on which the stretches from first to second (K, 2) lie, or -1."""
        middle = shapely.points((first + second) / 2.0)
        query, side = self.tree.query(middle, predicate="dwithin", distance=TOUCH)
        sides = self.tree.geometries[side]
        reach = [shapely.distance(shapely.points(p[query]), sides) for p in (first, second)]
        on = np.maximum(*reach) < TOUCH
        found = np.full(len(first), -1, dtype=np.int64)
        found[query[on]] = side[on]
        return found

    def nearest_side(self, points: Array) -> IntArray:
        """(K,) the side nearest to each of the points (K, 2)."""
        return self.tree.nearest(shapely.points(points))

    def along(self, side: IntArray, points: Array) -> Array:
        """(K,) how far from the start of its side each of the points (K, 2) lies [m]."""
        return np.einsum("ij,ij->i", points - self.start[side], self.direction[side])


def trace(walls: MultiPolygon) -> Outline:
    """The outline of walls as drawn: their union, without superfluous corners and specks."""
    solid = clean_union(walls)
    rings = [(index, corners[:-1]) for index, corners in _rings(solid)]
    if not rings:
        return Outline(solid, *np.empty((2, 0, 2)), *np.empty((2, 0), dtype=np.int64))
    counts = np.array([len(corners) for _, corners in rings])
    firsts = np.cumsum(counts) - counts
    return Outline(
        solid=solid,
        start=np.concatenate([corners for _, corners in rings]),
        end=np.concatenate([np.roll(corners, -1, axis=0) for _, corners in rings]),
        previous=np.concatenate(
            [first + np.roll(np.arange(n), 1) for first, n in zip(firsts, counts, strict=True)]
        ),
        part=np.repeat([index for index, _ in rings], counts),
    )


def clean_union(walls: MultiPolygon) -> MultiPolygon:
    """The union in a canonical order, whatever the order in which the walls were drawn."""
    union = _plugged(shapely.union_all(shapely.get_parts(walls)).simplify(TOUCH))
    parts = [p for p in shapely.get_parts(union) if p.geom_type == "Polygon" and p.area > SPECK]
    kept = [Polygon(p.exterior, [h for h in p.interiors if Polygon(h).area > SPECK]) for p in parts]
    solid = shapely.normalize(MultiPolygon(kept))
    return shapely.orient_polygons(solid)


def _plugged(union: shapely.Geometry) -> shapely.Geometry:
    """Walls that touch in a single point are joined there: one cannot tell whose corner it is."""
    rings = shapely.get_rings(shapely.get_parts(union))
    coords = [shapely.get_coordinates(ring)[:-1] for ring in rings]
    if not coords:
        return union
    corners, count = np.unique(np.concatenate(coords), axis=0, return_counts=True)
    if (count < 2).all():
        return union
    plugs = shapely.buffer(shapely.points(corners[count > 1]), PLUG, cap_style="square")
    return shapely.union_all([union, *plugs])


def _rings(solid: MultiPolygon) -> Iterator[tuple[int, Array]]:
    for index, polygon in enumerate(solid.geoms):
        for ring in (polygon.exterior, *polygon.interiors):
            yield index, np.asarray(ring.coords)


# --- bodies --------------------------------------------------------------------------------------


def wall_bodies(outline: Outline) -> IntArray:
    """(E,) the wall body of each side, numbered in the order of their first sides."""
    pairs = [_through_corners(outline), _through_short(outline), _through_walls(outline)]
    return joined(np.arange(len(outline.start)), np.concatenate(pairs))


def joined(body: IntArray, pairs: IntArray) -> IntArray:
    """(E,) bodies after those of the sides in each of the pairs (P, 2) became one."""
    if not len(body):
        return body
    count = int(body.max()) + 1
    links = body[pairs.reshape(-1, 2)]
    graph = coo_array((np.ones(len(links)), (links[:, 0], links[:, 1])), shape=(count, count))
    _, group = connected_components(graph, directed=False)
    merged = group[body]
    _, first, label = np.unique(merged, return_index=True, return_inverse=True)
    rank = np.empty(len(first), dtype=np.int64)
    rank[np.argsort(first)] = np.arange(len(first))
    return rank[label]


def _through_corners(outline: Outline) -> IntArray:
    """Neighbours whose lines nearly coincide: straight on, or folded back."""
    before = outline.direction[outline.previous]
    sine = before[:, 0] * outline.direction[:, 1] - before[:, 1] * outline.direction[:, 0]
    straight = np.flatnonzero(np.abs(sine) < np.sin(STRAIGHT))
    return np.column_stack([outline.previous[straight], straight])


def _through_short(outline: Outline) -> IntArray:
    either = np.minimum(outline.length, outline.length[outline.previous]) < SHORT
    short = np.flatnonzero(either)
    return np.column_stack([outline.previous[short], short])


def _through_walls(outline: Outline) -> IntArray:
    """Sides that face away from each other with nothing but wall between them."""
    sides = outline.tree.geometries
    i, j = outline.tree.query(sides, predicate="dwithin", distance=THICKEST)
    pairs = np.column_stack([i, j])[i < j]
    return pairs[np.array(_common_wall(outline, pairs), dtype=bool)]


def _common_wall(outline: Outline, pairs: IntArray) -> NDArray[np.bool_]:
    i, j = pairs.T
    opposite = np.einsum("ij,ij->i", outline.direction[i], outline.direction[j])
    ends = [outline.along(i, p[j]) for p in (outline.start, outline.end)]
    low = np.maximum(np.minimum(*ends), 0.0)
    high = np.minimum(np.maximum(*ends), outline.length[i])
    near = outline.start[i] + ((low + high) / 2.0)[:, None] * outline.direction[i]
    depth = np.einsum("ij,ij->i", near - outline.start[j], outline.normal[j])
    depth = depth / np.minimum(opposite, -1e-3)  # along -normal[i] until it meets the other side
    fits = (opposite < -np.cos(STRAIGHT)) & (high - low > MIN_COMMON)
    fits &= (depth > 0.0) & (depth < THICKEST)
    probe = near[:, None] - (depth[:, None] * [0.02, 0.98])[:, :, None] * outline.normal[i][:, None]
    solid = outline.solid
    shapely.prepare(solid)
    fits[fits] = shapely.covers(solid, shapely.linestrings(probe[fits]))
    return fits
