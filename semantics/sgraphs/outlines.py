"""A room of sides as a proposal: its polygon, and the stretch of each plane that bounds it."""

from __future__ import annotations

from itertools import pairwise

import numpy as np

from semantics.sgraphs.matching import Match, Pair, Side
from semantics.sgraphs.rooms import Known
from slam.core import Array, PlanePiece, RoomProposal

Line = tuple[Array, float]
"""normal (2,) and d of n.x + d = 0."""


def proposal(known: Known, axes: Array) -> RoomProposal:
    """A room in the map frame; axes: (2, 2) from the map's plan view to the building's axes."""
    match = known.match
    corners = _corners(match, axes)
    ends = [*pairwise(corners), (corners[-1], corners[0])]  # low y, high x, high y, low x
    bounding = {"room": (3, 1, 0, 2), "x": (3, 1), "y": (0, 2)}[match.kind]
    pieces = tuple(
        PlanePiece(side.plane.id, _stretch(side, np.array(ends[k])) @ axes)
        for side, k in zip(match.sides, bounding, strict=True)
    )
    return RoomProposal(known.id, pieces, corners @ axes, match.centre @ axes, 1.0)


def _corners(match: Match, axes: Array) -> Array:
    """(4, 2) counter-clockwise from the corner of low x and low y, axes of the building."""
    vertices = match.cluster @ axes.T
    x = _lines(match.x) or _ends(vertices, 0)
    y = _lines(match.y) or _ends(vertices, 1)
    return np.array([_meet(x[i], y[j]) for i, j in ((0, 0), (1, 0), (1, 1), (0, 1))])


def _lines(pair: Pair | None) -> tuple[Line, Line] | None:
    return None if pair is None else ((pair[0].normal, pair[0].d), (pair[1].normal, pair[1].d))


def _ends(vertices: Array, axis: int) -> tuple[Line, Line]:
    """Where a corridor ends, as far as its free space was seen."""
    normal = np.eye(2)[axis]
    return (normal, -float(vertices[:, axis].min())), (normal, -float(vertices[:, axis].max()))


def _meet(a: Line, b: Line) -> Array:
    return np.linalg.solve(np.array([a[0], b[0]]), -np.array([a[1], b[1]]))


def _stretch(side: Side, ends: Array) -> Array:
    """(2, 2) the part of an edge of the polygon on which the plane was seen; all of it if none."""
    run = ends[1] - ends[0]
    length = float(np.linalg.norm(run))
    if length < 1e-6:
        return ends
    along = (side.points - ends[0]) @ run / length
    low, high = np.clip([along.min(), along.max()], 0.0, length)
    if high - low < 0.1:
        return ends
    return ends[0] + np.outer([low, high], run / length)
