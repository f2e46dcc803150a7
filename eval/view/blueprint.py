"""How a recording opens: the scene graph, the view from above, the curves, the events."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import rerun.blueprint as rrb

from slam.core import Array
from worlds.truth import Truth

NAMES = ("truth/rooms",)
JUDGEMENT = ("map/judgement/**", "truth/judgement/**")
LIFTED = ("map/graph/**",)

SHAPE = 1.6
"""Width of the view from above, by its height."""

WHOLE = rrb.TimeRange(rrb.TimeRangeBoundary.infinite(), rrb.TimeRangeBoundary.infinite())

GRID = [255, 255, 255, 14]
BACKGROUND = [16, 18, 22]


def blueprint(truth: Truth | None) -> Any:
    """For a building of known extent, or for an unknown one about the origin; it opens at the
    newest moment and stays with it."""
    low, high = bounds(truth)
    middle = np.append((low + high) / 2.0, 0.0)
    wide, deep = np.maximum(high - low, 6.0)
    aside = max(deep, 0.85 * wide) * np.array([-0.45, -0.98, 0.78])
    over = np.array([0.0, 0.0, 1.3 * max(deep, wide / SHAPE)])
    aim = middle + np.array([0.0, 0.0, 1.2])
    graph = _scene("Scene graph", aim, aside, (0, 0, 1), [*NAMES, *JUDGEMENT])
    judged = _scene("Against the truth", aim, aside, (0, 0, 1), NAMES)
    above = _scene("From above", middle, over, (0, 1, 0), LIFTED)
    curves = [
        _curves("error", "Position error so far [cm]"),
        _curves("found", "Rooms and walls: found, and right"),
        _curves("ms", "Milliseconds by stage"),
    ]
    events = rrb.TextLogView(origin="/events", name="Events", columns=_event_columns())
    return rrb.Blueprint(
        rrb.Horizontal(
            rrb.Tabs(graph, judged),
            rrb.Vertical(above, rrb.Tabs(*curves, active_tab=1), events, row_shares=[5, 3, 2]),
            column_shares=[3, 2],
        ),
        rrb.TimePanel(state="collapsed", timeline="sim_time", play_state="following"),
        collapse_panels=True,
    )


def bounds(truth: Truth | None) -> tuple[Array, Array]:
    """Lowest and highest corner (2,) in plan view, world frame; unknown: 20 m x 20 m."""
    ends = [face.segment for face in truth.faces] if truth is not None else []
    corners = np.vstack(ends) if ends else np.array([[-10.0, -10.0], [10.0, 10.0]])
    return corners.min(axis=0), corners.max(axis=0)


def _curves(of: str, name: str) -> Any:
    legend = rrb.PlotLegend(rrb.Corner2D.LeftTop)
    return rrb.TimeSeriesView(
        origin=f"/plots/{of}",
        name=name,
        plot_legend=legend,
        axis_x=rrb.TimeAxis(view_range=WHOLE),
    )


def _event_columns() -> Any:
    return rrb.TextLogColumns(text_log_columns=["Body"])


def _scene(
    name: str, target: Array, away: Array, up: tuple[int, int, int], without: Sequence[str]
) -> Any:
    """A view of the world without some entities."""
    return rrb.Spatial3DView(
        origin="/world",
        contents=["$origin/**", *(f"- $origin/{entity}" for entity in without)],
        name=name,
        eye_controls=rrb.EyeControls3D(position=target + away, look_target=target, eye_up=up),
        background=BACKGROUND,
        line_grid=rrb.LineGrid3D(spacing=1.0, color=GRID),
    )
