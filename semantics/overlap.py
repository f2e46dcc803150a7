"""How much of their planes two sets of pieces share; plain numbers, as there are a handful."""

from __future__ import annotations

import math
from collections.abc import Sequence

from slam.core import PlanePiece


def common(a: Sequence[PlanePiece], b: Sequence[PlanePiece]) -> float:
    """Length [m] of what two sets of pieces share of their planes."""
    total = 0.0
    for first in a:
        for second in b:
            if first.plane_id == second.plane_id:
                total += _overlap(first, second)
    return total


def _overlap(a: PlanePiece, b: PlanePiece) -> float:
    """Length of b, laid on a's line, that is on a [m]; plain numbers are the faster here."""
    (x0, y0), (x1, y1) = a.segment.tolist()
    run_x, run_y = x1 - x0, y1 - y0
    size = math.hypot(run_x, run_y)
    if size < 1e-9:
        return 0.0
    (x, y), (u, v) = b.segment.tolist()
    start = ((x - x0) * run_x + (y - y0) * run_y) / size
    end = ((u - x0) * run_x + (v - y0) * run_y) / size
    return max(0.0, min(max(start, end), size) - max(min(start, end), 0.0))


def length(pieces: Sequence[PlanePiece]) -> float:
    """Total length of pieces [m]."""
    return max(sum(math.dist(*piece.segment.tolist()) for piece in pieces), 1e-9)
