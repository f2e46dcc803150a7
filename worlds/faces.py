"""Faces of the rooms of a storey as built: coplanar stretches of wall, seen from one room."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from slam.core import Array, IntArray
from worlds.asbuilt import AsBuilt
from worlds.layout import Layout
from worlds.outline import TOUCH
from worlds.sidemap import SideMap
from worlds.truth import CLUTTER, NO_FACE, Face

SAME_DIRECTION = np.cos(np.radians(1.0))
"""Stretches can be coplanar if their normals are within one degree of each other."""
SAME_PLANE = 0.0005
"""Stretches of one face are at most this far off each other's plane [m]."""
MAX_BEND = np.cos(np.radians(20.0))
"""Cosine of the angle up to which two facets are of one curve."""
MAX_TURN = np.cos(np.radians(40.0))
"""... and of how far a curve turns within one face, at most."""
MIN_LENGTH = 0.5
"""Faces with less real wall than this are not scored [m]."""


@dataclass(frozen=True)
class Stretches:
    """Stretches of wall as built, in the world frame.

    normal: (S, 3) into the room; ends: (S, 2, 3) at mid height, left end first seen from there.
    """

    normal: Array
    ends: Array

    @property
    def length(self) -> Array:
        """(S,) [m]."""
        return np.linalg.norm(self.ends[:, 1] - self.ends[:, 0], axis=1)


def measured(layout: Layout, built: AsBuilt, side: IntArray, low: Array, high: Array) -> Stretches:
    """Stretches of sides (from low to high along them, as drawn) as they were built."""
    outline, height = layout.outline, layout.height
    drawn = [outline.start[side] + t[:, None] * outline.direction[side] for t in (low, high)]
    ends = np.stack([built.at_height(points, height / 2.0) for points in drawn], axis=1)
    z = np.full((len(side), 2, 1), layout.storey.z_floor + height / 2.0)
    return Stretches(built.normals[side], np.concatenate([ends, z], axis=2))


def coplanar(stretches: Stretches, most_off: float) -> IntArray:
    """(S,) groups of same-facing stretches whose ends are at most ``most_off`` [m] off one plane;
    the longest of a group decides which."""
    group = np.full(len(stretches.normal), -1, dtype=np.int64)
    for row in np.argsort(-np.round(stretches.length, 6), kind="stable"):
        if group[row] >= 0:
            continue
        normal, point = stretches.normal[row], stretches.ends[row, 0]
        off = np.abs((stretches.ends - point) @ normal).max(axis=1)
        same = (off <= most_off) & (stretches.normal @ normal >= SAME_DIRECTION)
        group[same & (group < 0)] = group.max() + 1
    return group


def sides_in_line(layout: Layout) -> IntArray:
    """(P, 2) sides that bound one room on one line: whoever builds them snaps one line for both."""
    bounds, outline = layout.bounds, layout.outline
    wall = ~np.isin(outline.part[bounds.side], list(layout.pillars))
    level = np.zeros((len(outline.start), 1))
    normal = np.hstack([outline.normal, level])
    ends = np.stack([np.hstack([outline.start, level]), np.hstack([outline.end, level])], axis=1)
    pairs = [np.empty((0, 2), dtype=np.int64)]
    for room in range(len(layout.rooms)):
        sides = np.unique(bounds.side[(bounds.value == room) & wall])
        group = coplanar(Stretches(normal[sides], ends[sides]), SAME_PLANE)
        first = np.unique(group, return_index=True)[1]
        pairs.append(np.column_stack([sides[first][group], sides]))
    return np.concatenate(pairs)


def storey_faces(
    layout: Layout, built: AsBuilt, face_0: int, room_0: int
) -> tuple[list[Face], SideMap]:
    """The scored faces of a storey, and which face (or label) each stretch of wall belongs to.

    Ids count from face_0, rooms from room_0; faces get their surfaces later. Lintels and sills
    carry the face of the wall that they are in.
    """
    bounds = layout.bounds
    drawn = measured(layout, built, bounds.side, bounds.low, bounds.high)
    pillar = np.isin(layout.outline.part[bounds.side], list(layout.pillars))
    label = np.where(pillar, CLUTTER, NO_FACE)
    faces: list[Face] = []
    for room in range(len(layout.rooms)):
        rows = np.flatnonzero((bounds.value == room) & ~pillar)
        for own in _groups(layout, drawn, rows):
            table = _real_wall(layout, own)
            parts = measured(layout, built, table[:, 0].astype(np.int64), table[:, 1], table[:, 2])
            if parts.length.sum() >= MIN_LENGTH:
                label[own] = face_0 + len(faces)
                top = _top(layout, table)
                faces.append(_face(layout, parts, top, face_0 + len(faces), room_0 + room))
    return faces, bounds.relabelled(label)


def _groups(layout: Layout, drawn: Stretches, rows: IntArray) -> list[IntArray]:
    """Rows of stretches that are one face: those on one plane, and the facets of a curve that are
    each too short to be scored, taken together until they are long enough."""
    group = coplanar(Stretches(drawn.normal[rows], drawn.ends[rows]), SAME_PLANE)
    groups = [rows[group == g] for g in range(int(group.max(initial=-1)) + 1)]
    facets = [own[0] for own in groups if len(own) == 1 and drawn.length[own[0]] < MIN_LENGTH]
    curves = _curves(layout, drawn, np.array(facets, dtype=np.int64))
    of_curves = {int(row) for curve in curves for row in curve}
    return [own for own in groups if int(own[0]) not in of_curves] + curves


def _curves(layout: Layout, drawn: Stretches, facets: IntArray) -> list[IntArray]:
    """Facets that follow one another round a curve, in runs of at least the scored length that
    turn by little."""
    side = layout.bounds.side[facets]
    place = {int(s): k for k, s in enumerate(side)}
    before = [place.get(int(p), -1) for p in layout.outline.previous[side]]
    bends = np.einsum("ij,ij->i", drawn.normal[facets], drawn.normal[facets[before]])
    first = [k for k in range(len(facets)) if before[k] < 0 or bends[k] < MAX_BEND]
    following = {b: k for k, b in enumerate(before) if b >= 0 and bends[k] >= MAX_BEND}
    found: list[IntArray] = []
    seen: set[int] = set()
    for start in [*first, *range(len(facets))]:  # the rest are rings without a beginning
        run: list[int] = []
        k: int | None = start
        while k is not None and k not in seen:
            seen.add(k)
            run.append(k)
            if drawn.length[facets[run]].sum() >= MIN_LENGTH:
                found.append(facets[run])
                run = []
            k = following.get(k)
    return [run for run in found if drawn.normal[run[0]] @ drawn.normal[run[-1]] >= MAX_TURN]


def _real_wall(layout: Layout, rows: IntArray) -> Array:
    """(P, 3) side, low and high of what the openings down to the floor leave of some stretches."""
    bounds = layout.bounds
    found: list[tuple[float, float, float]] = []
    spans = sorted(zip(bounds.side[rows], bounds.low[rows], bounds.high[rows], strict=True))
    for side, low, high in spans:
        for a, b, opening in layout.gaps.split(int(side), float(low), float(high)):
            if opening >= 0 or b - a < TOUCH:
                continue
            if found and found[-1][0] == side and abs(found[-1][2] - a) < TOUCH:
                found[-1] = (side, found[-1][1], b)
            else:
                found.append((side, a, b))
    return np.array(found, dtype=np.float64).reshape(-1, 3)


def _top(layout: Layout, table: Array) -> float:
    """The highest point above the floor of stretches (P, 3) of real wall: low walls end early."""
    openings = layout.storey.openings
    return max(
        openings[k].z_min if k >= 0 else layout.height
        for side, low, high in table.tolist()
        for _, _, k in layout.parapets.split(int(side), low, high)
    )


def _face(layout: Layout, parts: Stretches, top: float, identity: int, room: int) -> Face:
    """One face from its stretches of real wall."""
    normal = parts.length @ parts.normal
    normal /= np.linalg.norm(normal)
    middle = parts.length @ parts.ends.mean(axis=1) / parts.length.sum()
    right = np.array([-normal[1], normal[0]]) / np.hypot(normal[0], normal[1])
    order = np.argsort(parts.ends[:, :, :2].mean(axis=1) @ right)
    ends = parts.ends[order][:, :, :2]
    points = ends.reshape(-1, 2)
    along = points @ right
    return Face(
        id=identity,
        room=room,
        normal=normal,
        d=float(-normal @ middle),
        segment=points[[np.argmin(along), np.argmax(along)]],
        parts=ends,
        z_range=(layout.storey.z_floor, layout.storey.z_floor + top),
        surface=-1,
    )
