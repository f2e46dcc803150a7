"""Walls as closed convex solids whose every side knows the face that it shows."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np
import shapely
from numpy.typing import NDArray
from shapely.geometry import MultiPolygon

from slam.core import Array, IntArray
from worlds.asbuilt import AsBuilt
from worlds.convex import ConvexPart, ConvexParts, convex_parts
from worlds.doorways import THRESHOLD
from worlds.drafting import as_multipolygon
from worlds.layout import Layout
from worlds.outline import TOUCH
from worlds.plan import Opening
from worlds.sidemap import SideMap
from worlds.truth import GLASS, NO_FACE

OVERLAP = 0.02
"""Walls reach this far into the floor and the ceiling slab, so that no ray slips between [m]."""
PANE = 0.02
"""Thickness of a pane of glass [m]."""
THINNEST = 1e-4
"""Solids thinner than this cannot be built; what is left of them no sensor would notice [m]."""


@dataclass(frozen=True)
class Solid:
    """A closed convex solid. vertices: (V, 3) world frame [m]; triangles: (T, 3), outward; face:
    (T,) the face id or the label of ``worlds.truth`` that each triangle shows.
    """

    name: str
    vertices: Array
    triangles: NDArray[np.int32]
    face: NDArray[np.int32]


@dataclass(frozen=True)
class _Ring:
    """A convex part's outline. points: (K, 2) as drawn; faces: (K,) what each side shows; caps:
    (T, 3) corners of the triangles that fill it."""

    points: Array
    faces: IntArray
    caps: IntArray


@dataclass(frozen=True)
class Mould:
    """What turns a convex part of a drawn polygon into a solid."""

    layout: Layout
    built: AsBuilt
    labels: SideMap

    def cast(self, name: str, convex: ConvexParts, z: tuple[float, float]) -> list[Solid]:
        """The solids over convex parts of the drawn plan, between two heights above the floor."""
        rings = self._rings(convex)
        if not rings:
            return []
        placed = self.built.place(np.concatenate([ring.points for ring in rings]))
        ends = np.cumsum([len(ring.points) for ring in rings])[:-1]
        low, high = (np.split(self._at(placed, height), ends) for height in z)
        return [
            prism(f"{name}_{k}", bottom, top, ring.faces, ring.caps)
            for k, (ring, bottom, top) in enumerate(zip(rings, low, high, strict=True))
        ]

    def _at(self, placed: Array, height: float) -> Array:
        """(K, 3) world coordinates at a height above the floor, which may lie beyond the walls."""
        share = height / self.built.height
        level = placed[:, 0] + share * (placed[:, 1] - placed[:, 0])
        z = np.full(len(level), self.layout.storey.z_floor + height)
        return np.column_stack([level, z])

    def _rings(self, convex: ConvexParts) -> list[_Ring]:
        """The drawn ring of each part, cut where the face changes."""
        outline = self.layout.outline
        order = [corner for part in convex.parts for corner in part.ring]
        after = [corner for part in convex.parts for corner in (*part.ring[1:], part.ring[0])]
        corners, following = convex.points[order], convex.points[after]
        if not order:
            return []
        side = outline.side_under(corners, following)
        on = np.maximum(side, 0)
        spans = np.column_stack([outline.along(on, corners), outline.along(on, following)])
        found, k = [], 0
        for part in convex.parts:
            own = slice(k, k + len(part.ring))
            found.append(self._ring(part, corners[own], side[own], spans[own]))
            k += len(part.ring)
        return found

    def _ring(self, part: ConvexPart, corners: Array, side: IntArray, spans: Array) -> _Ring:
        outline = self.layout.outline
        ring: list[Array] = []
        faces: list[int] = []
        place: dict[int, int] = {}
        for k, corner in enumerate(part.ring):
            place[corner] = len(ring)
            ring.append(corners[k])
            if side[k] < 0:
                faces.append(NO_FACE)
                continue
            cuts = self.labels.split(int(side[k]), *map(float, np.sort(spans[k])))
            cuts = cuts if spans[k, 0] < spans[k, 1] else cuts[::-1]
            faces += [face for _, _, face in cuts]
            ends = [b if spans[k, 0] < spans[k, 1] else a for a, b, _ in cuts[:-1]]
            ring += [outline.start[side[k]] + t * outline.direction[side[k]] for t in ends]
        caps = np.array([[place[c] for c in triangle] for triangle in part.triangles])
        return _Ring(np.array(ring), np.array(faces, dtype=np.int64), caps)


def prism(
    name: str, low: Array, high: Array, faces: IntArray, caps: IntArray, cap: int = NO_FACE
) -> Solid:
    """The solid between two rings of corners (K, 3), anticlockwise from above.

    faces: (K,) what its sides show; caps: (T, 3) corners of the triangles that fill a ring; cap:
    what those show.
    """
    count = len(low)
    here = np.arange(count)
    there = np.roll(here, -1)
    sides = [[here, there, there + count], [here, there + count, here + count]]
    return Solid(
        name=name,
        vertices=np.concatenate([low, high]),
        triangles=np.concatenate(
            [np.stack(side, axis=1) for side in sides] + [caps[:, ::-1], caps + count]
        ).astype(np.int32),
        face=np.concatenate([faces, faces, np.full(2 * len(caps), cap)]).astype(np.int32),
    )


def wall_solids(layout: Layout, built: AsBuilt, labels: SideMap, prefix: str) -> list[Solid]:
    """All walls of a storey: full-height parts, what is below and above each opening, panes."""
    mould = Mould(layout, built, labels)
    whole = (-OVERLAP, layout.height + OVERLAP)
    solids = list(_cast_all(mould, layout.cut, whole, f"{prefix}wall"))
    for k, (space, opening) in enumerate(_openings(layout)):
        if opening.z_min >= THRESHOLD:
            span = (-OVERLAP, opening.z_min)
            solids += _cast_all(mould, space, span, f"{prefix}sill{k}")
        if opening.z_max < layout.height - TOUCH:
            span = (opening.z_max, layout.height + OVERLAP)
            solids += _cast_all(mould, space, span, f"{prefix}lintel{k}")
        if opening.glass:
            panes = _cast_all(mould, *_pane(layout, space, opening), f"{prefix}pane{k}")
            solids += [replace(p, face=np.full_like(p.face, GLASS)) for p in panes]
    return [solid for solid in solids if _thickness(solid) > THINNEST]


def _pane(
    layout: Layout, space: MultiPolygon, opening: Opening
) -> tuple[MultiPolygon, tuple[float, float]]:
    """The plan of an opening's pane, in the middle of the wall, and its heights above the floor."""
    outline = layout.outline
    if space.is_empty:
        return space, (0.0, 0.0)
    sides = outline.tree.query(opening.footprint, predicate="intersects")
    common = shapely.length(shapely.intersection(outline.tree.geometries[sides], opening.footprint))
    along = outline.direction[sides[int(np.argmax(common))]]
    middle = np.asarray(space.centroid.coords[0])
    reach = 2.0 * shapely.length(space)
    line = shapely.linestrings([middle - reach * along, middle + reach * along])
    strip = shapely.buffer(line, PANE / 2.0, cap_style="flat")
    low = opening.z_min if opening.z_min >= THRESHOLD else -OVERLAP
    high = opening.z_max if opening.z_max < layout.height - TOUCH else layout.height + OVERLAP
    return as_multipolygon(space.intersection(strip)), (low, high)


def _openings(layout: Layout) -> Iterator[tuple[MultiPolygon, Opening]]:
    """What each opening takes out of the walls, and out of no earlier opening."""
    openings = layout.storey.openings
    if not openings:
        return
    footprints = shapely.STRtree([opening.footprint for opening in openings])
    for k, opening in enumerate(openings):
        earlier = [openings[i].footprint for i in footprints.query(opening.footprint) if i < k]
        own = opening.footprint.difference(shapely.union_all(earlier))
        inside = own.intersection(layout.outline.near(own))
        space = shapely.remove_repeated_points(inside, TOUCH)
        if not space.is_valid:  # a footprint that ends where a wall does can leave a thread of it
            space = shapely.make_valid(space)
        yield as_multipolygon(space), opening


def _cast_all(
    mould: Mould, polygons: MultiPolygon, z: tuple[float, float], name: str
) -> Iterator[Solid]:
    if polygons.is_empty:
        return
    yield from mould.cast(name, convex_parts(polygons), z)


def _thickness(solid: Solid) -> float:
    """Smallest width of a solid in plan: twice its area over its longest extent."""
    footprint = shapely.MultiPoint(solid.vertices[:, :2]).convex_hull
    return float(2.0 * footprint.area / max(footprint.length, 1e-12)) if footprint.area else 0.0
