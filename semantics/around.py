"""In which order the sides of a room follow one another.

Written out in plain numbers: a room has a handful of sides, for which arrays are slower.
"""

from __future__ import annotations

import math

import numpy as np

from semantics.pieces import Pieces

NEAR = 1.5
"""A round that would make the way longer by less is no pillar but a corner of the wall [m]."""
ALONE = 1e6
"""What it costs a side to close a round alone [m]: only one that is alone does."""
BEFORE = 0.6
"""A shorter side that stands so far before a longer one is a pier or a chase [m]."""

Point = tuple[float, float]
Side = tuple[Point, Point]
"""From its start to its end, with the inside of the room on the left."""
Round = list[Side]
"""Sides in the order in which they follow each other, the first after the last."""


def way_around(pieces: Pieces) -> Round:
    """The sides on the shortest way from end to start that takes each once.

    What closes by itself within that, a pillar, is left out, and so is what stands close before a
    longer side, a pier.
    """
    return _joined(_rounds(_outer(_walked(pieces))))


def _walked(pieces: Pieces) -> Round:
    """Segments turned so that the normal is to the left of the way from start to end."""
    walked = []
    for ((ax, ay), (bx, by)), (nx, ny) in zip(
        pieces.segment.tolist(), pieces.normal.tolist(), strict=True
    ):
        left = (bx - ax) * ny - (by - ay) * nx >= 0.0
        walked.append(((ax, ay), (bx, by)) if left else ((bx, by), (ax, ay)))
    return walked


def _outer(sides: Round) -> Round:
    """Without those that stand before a longer one."""
    return [
        side
        for k, side in enumerate(sides)
        if not any(_stands_before(side, other) for j, other in enumerate(sides) if j != k)
    ]


def _stands_before(side: Side, other: Side) -> bool:
    """Is a side parallel to a longer one, close to it, and within its ends?"""
    (ax, ay), (bx, by) = other
    long = math.dist(*other)
    if long <= math.dist(*side):
        return False
    x, y = (bx - ax) / long, (by - ay) / long
    along = [(px - ax) * x + (py - ay) * y for px, py in side]
    off = [(py - ay) * x - (px - ax) * y for px, py in side]
    parallel = along[1] - along[0] > 0.9 * math.dist(*side)
    middle = sum(along) / 2.0
    return parallel and abs(sum(off) / 2.0) < BEFORE and 0.0 < middle < long


def _rounds(sides: Round) -> list[Round]:
    """The sides in closed rounds, with the least way between them in all."""
    from scipy.optimize import linear_sum_assignment  # slow to load, and for rooms alone

    gap = [[_gap(side, following) for following in sides] for side in sides]
    for place, row in enumerate(gap):
        row[place] = ALONE
    _, after = linear_sum_assignment(np.array(gap))
    following = after.tolist()
    rounds: list[Round] = []
    waiting = set(range(len(sides)))
    while waiting:
        place = min(waiting)
        order = []
        while place in waiting:
            waiting.remove(place)
            order.append(sides[place])
            place = following[place]
        rounds.append(order)
    return rounds


def _gap(side: Side, following: Side) -> float:
    """From the end of a side to the start of another one [m]."""
    return math.dist(side[1], following[0])


def _joined(rounds: list[Round]) -> Round:
    """One round: the largest, and each other one that is no pillar within it, or is near, put in
    where that makes the way longer by the least."""
    whole, *others = sorted(rounds, key=_area, reverse=True)
    for other in others:
        added, at, start = min(
            (
                _gap(side, other[k])
                + _gap(other[k - 1], whole[(i + 1) % len(whole)])
                - _gap(side, whole[(i + 1) % len(whole)])
                - _gap(other[k - 1], other[k]),
                i,
                k,
            )
            for i, side in enumerate(whole)
            for k in range(len(other))
        )
        if _area(other) > 0.0 or added < NEAR:
            whole = [*whole[: at + 1], *other[start:], *other[:start], *whole[at + 1 :]]
    return whole


def _area(order: Round) -> float:
    """Twice what a round encloses [m2], negative if it goes clockwise, around something."""
    points = [point for side in order for point in side]
    return sum(
        ax * by - ay * bx
        for (ax, ay), (bx, by) in zip(points, [*points[1:], points[0]], strict=True)
    )
