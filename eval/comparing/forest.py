"""The picture of an ablation: every paired difference with its interval, metric by metric."""

from __future__ import annotations

import io
from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from eval.comparing.ablation import Comparison, Result
from eval.comparing.tables import unit_of
from eval.comparing.values import sense

if TYPE_CHECKING:
    from matplotlib.axes import Axes

BETTER, WORSE, NEITHER = "#1b7837", "#b2182b", "#555555"
COLUMNS = 2


def forest_png(result: Result) -> bytes:
    """One panel a metric. A row is a pair of variants: the mean difference and its 95 % interval,
    and behind it the means of the single scenes; green where it is better, red where worse, grey
    where the interval holds zero."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    metrics = [m for m in result.ablation.metrics if any(c.difference for c in _of(result, m))]
    lines = max(1, -(-len(metrics) // COLUMNS))
    height = 1.0 + lines * (0.8 + 0.32 * max(1, len(result.ablation.pairs)))
    figure = Figure(figsize=(13.0, height), layout="constrained")
    FigureCanvasAgg(figure)
    axes = figure.subplots(lines, COLUMNS, squeeze=False, sharey=True).ravel()
    for place, metric in enumerate(metrics):
        _panel(axes[place], result, metric)
    for empty in axes[len(metrics) :]:
        empty.set_axis_off()
    seeds, scenes = len(result.ablation.seeds), len(result.ablation.scenes)
    figure.suptitle(
        f"Paired differences, {scenes} scene{'s' * (scenes > 1)} x {seeds} seed{'s' * (seeds > 1)}:"
        " mean, 95 % bootstrap interval, and each scene",
        fontsize=11,
    )
    data = io.BytesIO()
    figure.savefig(data, format="png", dpi=130)
    return data.getvalue()


def _of(result: Result, metric: str) -> list[Comparison]:
    return [c for c in result.comparisons if c.metric == metric]


def _panel(ax: Axes, result: Result, metric: str) -> None:
    scale, unit = unit_of(metric)
    comparisons = _of(result, metric)
    names = [f"{c.variant}  vs  {c.against}" for c in comparisons]
    ax.set_yticks(range(len(names)), names, fontsize=8)
    ax.set_ylim(len(names) - 0.5, -0.5)
    ax.axvline(0.0, color="#999999", linewidth=0.8)
    for place, comparison in enumerate(comparisons):
        _row(ax, place, comparison, _scene_means(result, comparison), scale)
    better = {1: "  (higher is better)", -1: "  (lower is better)", 0: ""}[sense(metric)]
    ax.set_title(f"{metric}{f' [{unit}]' if unit else ''}{better}", fontsize=9, loc="left")
    ax.tick_params(axis="x", labelsize=8)
    ax.grid(axis="x", color="#eeeeee")
    ax.set_axisbelow(True)
    for side in ("top", "right", "left"):
        ax.spines[side].set_visible(False)


def _row(ax: Axes, place: int, c: Comparison, scenes: Sequence[float], scale: float) -> None:
    if c.difference is None:
        ax.text(0.0, place, "no pairs", fontsize=8, va="center")
        return
    d = c.difference
    colour = _colour(c)
    ax.plot(scale * np.array(scenes), [place] * len(scenes), "o", ms=3.5, color="#bbbbbb", zorder=2)
    if d.interval is not None:
        ends = [scale * d.interval.low, scale * d.interval.high]
        ax.plot(ends, [place, place], color=colour, linewidth=2.2, zorder=3)
    ax.plot([scale * d.mean], [place], "D", ms=5, color=colour, zorder=4)


def _colour(c: Comparison) -> str:
    d = c.difference
    if d is None or d.interval is None or not d.interval.clear_of_zero or sense(c.metric) == 0:
        return NEITHER
    return BETTER if d.mean * sense(c.metric) > 0.0 else WORSE


def _scene_means(result: Result, c: Comparison) -> list[float]:
    """The mean paired difference of each scene that has pairs."""
    a, b = result.level(c.variant, c.metric), result.level(c.against, c.metric)
    differences = [np.subtract(a.values[scene], b.values[scene]) for scene in a.values]
    return [float(np.nanmean(part)) for part in differences if not np.isnan(part).all()]
