"""How a recording opens: the scene graph, the view from above, the curves, the events."""

from __future__ import annotations

from typing import Any

import numpy as np
import rerun.blueprint as rrb

from slam.core import Array
from worlds.truth import Truth


def blueprint(truth: Truth | None) -> Any:
    """For a building of known extent, or for an unknown one about the origin."""
    low, high = _bounds(truth)
    middle = np.append((low + high) / 2.0, 0.0)
    size = float(max((high - low).max(), 6.0))
    aside, over = size * np.array([0.0, -1.0, 0.85]), np.array([0.0, 0.0, 1.25 * size])
    graph = _scene("Scene graph", middle + np.array([0.0, 0.0, 2.5]), aside, (0, 0, 1))
    above = _scene("From above", middle, over, (0, 1, 0))
    curves = [
        rrb.TimeSeriesView(origin="/plots/error", name="Position error so far [cm]"),
        rrb.TimeSeriesView(origin="/plots/found", name="Rooms and walls, right of found"),
        rrb.TimeSeriesView(origin="/plots/ms", name="Milliseconds by stage"),
    ]
    events = rrb.TextLogView(origin="/events", name="Events")
    return rrb.Blueprint(
        rrb.Horizontal(
            graph,
            rrb.Vertical(above, rrb.Tabs(*curves), events, row_shares=[5, 3, 2]),
            column_shares=[3, 2],
        ),
        collapse_panels=True,
    )


def _scene(name: str, target: Array, away: Array, up: tuple[int, int, int]) -> Any:
    return rrb.Spatial3DView(
        origin="/world",
        name=name,
        eye_controls=rrb.EyeControls3D(position=target + away, look_target=target, eye_up=up),
    )


def _bounds(truth: Truth | None) -> tuple[Array, Array]:
    """Lowest and highest corner in plan view, world frame."""
    ends = [face.segment for face in truth.faces] if truth is not None else []
    corners = np.vstack(ends) if ends else np.array([[-10.0, -10.0], [10.0, 10.0]])
    return corners.min(axis=0), corners.max(axis=0)
