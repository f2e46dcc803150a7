"""The things of a scene graph as rerun archetypes. Everything in metres, frame of the caller."""

from __future__ import annotations

import colorsys
from collections.abc import Sequence
from typing import Any

import numpy as np
import rerun as rr
import shapely
from shapely.geometry import Polygon

from slam.core import Array, MapPlane, PlanePiece

Colour = tuple[int, int, int]

GREY: Colour = (150, 150, 150)
FAINT: Colour = (70, 70, 74)
PINK: Colour = (226, 84, 164)
COLOURS = 12
LEVEL_POINTS = 500
"""Points of a level plane that its rectangle is laid about, at most twice as many."""

NO_ROOM = 0
"""Class of what belongs to no room; 1 to ``COLOURS`` are rooms and planes, in turn."""


def class_of(identity: int) -> int:
    """The class, hence the colour, of a room or a plane."""
    return 1 + identity % COLOURS


def palette() -> Any:
    """Class 0 is grey, the others go round the colour circle."""
    colours = [GREY, *(colour_of(k) for k in range(COLOURS))]
    infos = [rr.AnnotationInfo(id=k, color=colour) for k, colour in enumerate(colours)]
    return rr.AnnotationContext(infos)


def colour_of(identity: int) -> Colour:
    """The colour of a room or a plane."""
    hue = identity % COLOURS * 0.618 % 1.0
    r, g, b = (int(255 * part) for part in colorsys.hsv_to_rgb(hue, 0.65, 0.95))
    return r, g, b


def transform(T_parent_child: Array) -> Any:
    """A pose (4, 4)."""
    return rr.Transform3D(translation=T_parent_child[:3, 3], mat3x3=T_parent_child[:3, :3])


def body(colour: Colour) -> Any:
    """The robot's body, standing on the floor."""
    return rr.Boxes3D(centers=[[0, 0, 0.25]], half_sizes=[[0.2, 0.2, 0.25]], colors=[colour])


def lines(strips: Sequence[Any], colour: Colour = GREY, radius: float = 0.015) -> Any:
    """Line strips of one colour."""
    return rr.LineStrips3D(strips, colors=[colour] if len(strips) else None, radii=radius)


def floor_polygon(polygon: Array, z: float, colour: Colour, alpha: int) -> Any:
    """A translucent polygon (K, 2) at a height, or nothing (K < 3). Mended if it crosses itself."""
    if len(polygon) < 3:
        return _mesh(np.zeros((0, 3)), colour, alpha)
    outline = shapely.make_valid(Polygon(polygon))
    parts = [part for part in shapely.get_parts(outline) if isinstance(part, Polygon)]
    triangles = [
        np.array(triangle.exterior.coords)[:3]
        for part in parts
        for triangle in shapely.get_parts(shapely.constrained_delaunay_triangles(part))
    ]
    corners = np.vstack(triangles) if triangles else np.zeros((0, 2))
    return _mesh(np.column_stack([corners, np.full(len(corners), z)]), colour, alpha)


def _mesh(corners: Array, colour: Colour, alpha: int) -> Any:
    """Triangles (3 K, 3), three corners each."""
    return rr.Mesh3D(
        vertex_positions=corners,
        triangle_indices=np.arange(len(corners)).reshape(-1, 3),
        albedo_factor=(*colour, alpha),
    )


def upright(segments: Sequence[Array], heights: Sequence[tuple[float, float]], alpha: int) -> Any:
    """Translucent grey rectangles over segments (2, 2) in plan view, each with its z range."""
    quads = [rectangle(ends, span) for ends, span in zip(segments, heights, strict=True)]
    corners = [quad[[0, 1, 2, 0, 2, 3]] for quad in quads]
    return _mesh(np.vstack(corners) if corners else np.zeros((0, 3)), GREY, alpha)


def rectangle(segment: Array, z_range: tuple[float, float]) -> Array:
    """(5, 3) closed outline over a segment (2, 2) in plan view."""
    low, high = z_range
    ends = np.vstack([segment, segment[::-1], segment[:1]])
    return np.column_stack([ends, [low, low, high, high, low]])


def plane_strips(plane: MapPlane) -> list[Array]:
    """The outline of a plane's extent, and its normal from the middle."""
    middle = plane_middle(plane)
    return [plane_outline(plane), np.array([middle, middle + 0.4 * plane.normal])]


def plane_outline(plane: MapPlane) -> Array:
    """(5, 3) closed: an upright plane's rectangle, or the smallest about a level one's points."""
    if not plane.horizontal:
        return rectangle(plane.segment, plane.z_range)
    points = plane.points[:: 1 + len(plane.points) // LEVEL_POINTS, :2]
    hull = shapely.convex_hull(shapely.multipoints(points))
    # A little wider, so that a rectangle is about those points too that lie on one line.
    around = shapely.oriented_envelope(shapely.buffer(hull, 0.01, quad_segs=1))
    corners = np.array(around.exterior.coords)
    z = -(plane.d + corners @ plane.normal[:2]) / plane.normal[2]
    return np.column_stack([corners, z])


def plane_middle(plane: MapPlane) -> Array:
    """(3,) the middle of a plane's extent."""
    return np.asarray(plane_outline(plane)[:4].mean(axis=0))


def piece_middle(plane: MapPlane, piece: PlanePiece) -> Array:
    """(3,) the middle of a piece, half way up its plane."""
    return np.append(piece.segment.mean(axis=0), np.mean(plane.z_range))


def slab(first: Array, second: Array, z_range: tuple[float, float], colour: Colour) -> Any:
    """The body of a wall between two pieces' segments (2, 2), as a box."""
    run = first[1] - first[0]
    length = max(float(np.linalg.norm(run)), 1e-6)
    direction = run / length
    along = np.sort((second - first[0]) @ direction)
    low, high = max(0.0, along[0]), min(length, along[1])
    if high <= low:
        low, high = 0.0, length
    across = np.array([-direction[1], direction[0]])
    thickness = float((second.mean(axis=0) - first[0]) @ across)
    centre = first[0] + 0.5 * (low + high) * direction + 0.5 * thickness * across
    return rr.Boxes3D(
        centers=[[*centre, np.mean(z_range)]],
        half_sizes=[[(high - low) / 2, max(abs(thickness) / 2, 0.01), np.ptp(z_range) / 2]],
        quaternions=[rr.Quaternion(xyzw=_turn(direction))],
        colors=[colour],
        fill_mode="solid",
    )


def _turn(direction: Array) -> list[float]:
    """Quaternion (x, y, z, w) about z that turns the x axis to a direction (2,)."""
    half = 0.5 * float(np.arctan2(direction[1], direction[0]))
    return [0.0, 0.0, float(np.sin(half)), float(np.cos(half))]
