"""Walls as they were built: every body a little turned, leaning, shifted, and thicker or thinner.

Each side of the outline stays an exact plane, and corners move to where the planes of their sides
meet: so the walls keep their topology, and nothing leaks.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
import shapely
from shapely.geometry import MultiPolygon, Polygon

from slam.core import Array, IntArray
from worlds.conditions import Conditions
from worlds.outline import Outline, joined, wall_bodies

MAX_MITRE = 4.0
"""A corner moves outward by at most this many times what its sides do."""
ROUNDS = 50
"""How often bodies that got in each other's way are joined before the whole storey becomes one."""
NEAR = 0.05
"""Sides this near to a place where walls cross each other are to blame for it [m]."""


@dataclass(frozen=True)
class Motions:
    """What happened to each wall body (B, ...): turned by yaw about its middle, its foot shifted
    along its normal, leaning by ``lean`` metres per metre of height, each side moved outward by
    ``growth`` [m].
    """

    middle: Array
    normal: Array
    yaw: Array
    lean: Array
    shift: Array
    growth: Array


@dataclass(frozen=True)
class AsBuilt:
    """The walls of a storey as built. body: (E,) the body of each side; height: of the storey."""

    outline: Outline
    body: IntArray
    motions: Motions
    height: float

    def place(self, points: Array) -> Array:
        """(K, 2, 2): where drawn points (K, 2) ended up at the floor and at the ceiling.

        Points on a side stay on it; points inside a wall move with the nearest side; points in the
        open stay where they were drawn.
        """
        corner = self.outline.corner_at(points)
        side = self.outline.side_at(points)
        placed = np.repeat(points[:, None], 2, axis=1)
        inside = (side < 0) & shapely.contains_xy(self.outline.solid, points)
        if inside.any():
            nearest = self.outline.nearest_side(points[inside])
            placed[inside] = self._carried(nearest, points[inside])
        on = side >= 0
        placed[on] = self._on_side(side[on], points[on])
        placed[corner >= 0] = self._placed_corners[corner[corner >= 0]]
        return placed

    def place_polygon(self, polygon: Polygon, height: float) -> Polygon:
        """A drawn polygon as built, at a height above the floor."""
        rings = [_corners(ring) for ring in (polygon.exterior, *polygon.interiors)]
        ends = np.cumsum([len(ring) for ring in rings])[:-1]
        shell, *holes = np.split(self.at_height(np.concatenate(rings), height), ends)
        return Polygon(shell, holes)

    def at_height(self, points: Array, height: float) -> Array:
        """(K, 2): where drawn points (K, 2) ended up at a height above the floor."""
        placed = self.place(points)
        return placed[:, 0] + height / self.height * (placed[:, 1] - placed[:, 0])

    @cached_property
    def normals(self) -> Array:
        """(E, 3) unit normals of the sides' planes, out of the wall."""
        level = self._turned(self.body, self.outline.normal)
        rise = -self.motions.lean[self.body] * self._towards_lean
        normals = np.column_stack([level, rise])
        return normals / np.linalg.norm(normals, axis=1, keepdims=True)

    @cached_property
    def _towards_lean(self) -> Array:
        """(E,) how much of its body's lean each side feels along its own normal."""
        level = self._turned(self.body, self.outline.normal)
        return np.einsum("ij,ij->i", level, self.motions.normal[self.body])

    @cached_property
    def _placed_corners(self) -> Array:
        """(E, 2, 2): where the planes of each side and the one before it meet."""
        after, before = np.arange(len(self.body)), self.outline.previous
        corners = self.outline.start
        placed = self._mitred(before, after, corners)
        apart = self.body[before] != self.body[after]
        placed[apart] = self._crossing(before[apart], after[apart], corners[apart])
        return placed

    def _turned(self, body: IntArray, vectors: Array) -> Array:
        """Vectors (K, 2) turned with their bodies (K,)."""
        cosine, sine = np.cos(self.motions.yaw[body]), np.sin(self.motions.yaw[body])
        x, y = vectors.T
        return np.column_stack([cosine * x - sine * y, sine * x + cosine * y])

    def _carried(self, side: IntArray, points: Array) -> Array:
        """(K, 2, 2): points moved with the bodies of their sides, thickness aside."""
        body, motions = self.body[side], self.motions
        arm = points - motions.middle[body]
        # The difference is added, so that nothing moves by rounding where nothing moves.
        foot = points + (self._turned(body, arm) - arm)
        foot = foot + motions.shift[body][:, None] * motions.normal[body]
        top = foot + (self.height * motions.lean[body])[:, None] * motions.normal[body]
        return np.stack([foot, top], axis=1)

    def _on_side(self, side: IntArray, points: Array) -> Array:
        outward = self._turned(self.body[side], self.outline.normal[side])
        growth = self.motions.growth[self.body[side]][:, None] * outward
        return self._carried(side, points) + growth[:, None]

    def _mitred(self, before: IntArray, after: IntArray, points: Array) -> Array:
        """Corners between two sides of one body."""
        first, second = self.outline.normal[before], self.outline.normal[after]
        together = 1.0 + np.einsum("ij,ij->i", first, second)
        mitre = (first + second) / np.maximum(together, 2.0 / MAX_MITRE)[:, None]
        body = self.body[after]
        growth = self.motions.growth[body][:, None] * self._turned(body, mitre)
        return self._carried(after, points) + growth[:, None]

    def _crossing(self, before: IntArray, after: IntArray, points: Array) -> Array:
        """Corners between sides of two bodies: where their lines cross, at floor and ceiling."""
        level = np.stack(
            [self._turned(self.body[s], self.outline.normal[s]) for s in (before, after)], axis=1
        )
        moved = np.stack([self._on_side(s, points) for s in (before, after)], axis=1)
        offset = np.einsum("kij,kizj->kzi", level, moved - points[:, None, None])
        step = np.linalg.solve(level[:, None], offset[..., None])[..., 0]
        return points[:, None] + step


def _corners(ring: shapely.LinearRing) -> Array:
    return np.asarray(ring.coords)[:-1]


# --- drawing the motions -------------------------------------------------------------------------


def build_walls(
    outline: Outline,
    cuts: Sequence[MultiPolygon],
    in_line: IntArray,
    height: float,
    conditions: Conditions,
    rng: np.random.Generator,
) -> AsBuilt:
    """The walls as built. cuts: the walls with some openings taken out or others, which must all
    stay sound; in_line: (P, 2) sides that are built as one, though they do not touch.

    Bodies that would turn a sliver inside out or run through each other are joined into one, until
    the geometry is sound; any valid plan can be built.
    """
    body = joined(wall_bodies(outline), in_line)
    motions = _draw(outline, body, conditions, rng)
    built = AsBuilt(outline, body, motions, height)
    for _ in range(ROUNDS):
        at_fault = next((f for f in (_at_fault(built, cut) for cut in cuts) if len(f)), None)
        if at_fault is None:
            return built
        built = _reconciled(built, at_fault)
    return _unchanged_thickness(_rejoined(built, np.zeros_like(body)), np.arange(len(body)))


def _draw(
    outline: Outline, body: IntArray, conditions: Conditions, rng: np.random.Generator
) -> Motions:
    count = int(body.max(initial=-1)) + 1
    draws = rng.standard_normal((count, 4))
    middle, normal = _middles(outline, body, count)
    return Motions(
        middle=middle,
        normal=normal,
        yaw=np.radians(conditions.yaw) * draws[:, 0],
        lean=np.tan(np.radians(conditions.lean) * draws[:, 1]),
        shift=conditions.shift * draws[:, 2],
        growth=conditions.thickness / 2.0 * draws[:, 3],
    )


def _middles(outline: Outline, body: IntArray, count: int) -> tuple[Array, Array]:
    """(B, 2) centroid of each body's sides and (B, 2) normal of its longest side."""
    centres = (outline.start + outline.end) / 2.0
    weight = np.bincount(body, outline.length, count)
    sums = [np.bincount(body, outline.length * centres[:, k], count) for k in (0, 1)]
    longest_first = np.lexsort((np.arange(len(body)), -np.round(outline.length, 6)))
    _, first = np.unique(body[longest_first], return_index=True)
    return np.column_stack(sums) / weight[:, None], outline.normal[longest_first[first]]


def _at_fault(built: AsBuilt, cut: MultiPolygon) -> IntArray:
    """(P, 2) pairs of sides whose bodies cannot both stay where they are."""
    rings = [ring for polygon in cut.geoms for ring in (polygon.exterior, *polygon.interiors)]
    if not rings:
        return np.empty((0, 2), dtype=np.int64)
    first = np.concatenate([_corners(ring) for ring in rings])
    second = np.concatenate([np.roll(_corners(ring), -1, axis=0) for ring in rings])
    run = built.place(second) - built.place(first)
    flipped = np.einsum("kzj,kj->kz", run, second - first).min(axis=1) <= 0.0
    if flipped.any():
        return _pairs_around(built, first[flipped], second[flipped])
    return _crossing_pairs(built, cut)


def _pairs_around(built: AsBuilt, first: Array, second: Array) -> IntArray:
    """The sides at both ends of stretches that turned round, in pairs."""
    outline = built.outline
    ends = np.stack([_sides_at(outline, first), _sides_at(outline, second)], axis=1)
    ends = ends.reshape(len(first), 4)
    return np.concatenate([ends[:, [0, k]] for k in (1, 2, 3)])


def _sides_at(outline: Outline, points: Array) -> IntArray:
    """(K, 2) the two sides of a corner, or twice the side that a point is on or nearest to."""
    corner, nearest = outline.corner_at(points), outline.nearest_side(points)
    after = np.where(corner >= 0, corner, nearest)
    return np.column_stack([np.where(corner >= 0, outline.previous[corner], after), after])


def _crossing_pairs(built: AsBuilt, cut: MultiPolygon) -> IntArray:
    """Sides around the first place where the walls cut each other, at floor or ceiling."""
    for height in (0.0, built.height):
        walls = MultiPolygon([built.place_polygon(p, height) for p in cut.geoms])
        reason = shapely.is_valid_reason(walls)
        if "[" in reason:
            x, y = reason[reason.index("[") + 1 : reason.index("]")].split()[:2]
            return _sides_near(built, np.array([float(x), float(y)]))
    return np.empty((0, 2), dtype=np.int64)


def _sides_near(built: AsBuilt, place: Array) -> IntArray:
    distance = shapely.distance(built.outline.tree.geometries, shapely.points(place))
    near = np.flatnonzero(distance < distance.min() + NEAR)
    return np.column_stack([np.full(len(near), near[0]), near])


def _reconciled(built: AsBuilt, pairs: IntArray) -> AsBuilt:
    """The bodies of each pair joined; where they are one already, it keeps its thickness."""
    body = joined(built.body, pairs)
    if not np.array_equal(body, built.body):
        return _rejoined(built, body)
    if built.motions.growth[body[pairs]].any():
        return _unchanged_thickness(built, pairs.ravel())
    return _rejoined(built, np.zeros_like(body))


def _rejoined(built: AsBuilt, body: IntArray) -> AsBuilt:
    """Bodies numbered anew; each moves as the first of those that it was made of."""
    _, first = np.unique(body, return_index=True)
    kept, old = built.body[first], built.motions
    middle, normal = _middles(built.outline, body, len(first))
    turns = (old.yaw[kept], old.lean[kept], old.shift[kept], old.growth[kept])
    return replace(built, body=body, motions=Motions(middle, normal, *turns))


def _unchanged_thickness(built: AsBuilt, sides: IntArray) -> AsBuilt:
    growth = built.motions.growth.copy()
    growth[built.body[sides]] = 0.0
    return replace(built, motions=replace(built.motions, growth=growth))
