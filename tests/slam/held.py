"""What a graph holds as of its last update, read back from its solver for tests."""

from __future__ import annotations

import gtsam

from slam.core import Array
from slam.graph import LayeredGraph
from slam.variables import FLOOR


def residuals_of(graph: LayeredGraph, kind: str) -> int:
    """How many residuals there are of a type of factors (``LayeredGraph.chi_squares``)."""
    squares = graph.chi_squares().get(kind)
    return 0 if squares is None else squares.residuals


def variable_count(graph: LayeredGraph) -> int:
    """How many variables there are."""
    return int(_values(graph).size())


def floor(graph: LayeredGraph, storey: int = 0) -> Array | None:
    """(2,) where a storey's floor node is; None without a room on it."""
    key, values = gtsam.symbol(FLOOR, storey), _values(graph)
    return values.atPoint2(key) if values.exists(key) else None


def _values(graph: LayeredGraph) -> gtsam.Values:
    return graph._optimiser.solver.values()
