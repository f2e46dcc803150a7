"""Drawings inside a page: they take the page's colours, light or dark."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from html import escape
from itertools import pairwise

import numpy as np
from shapely.geometry import Polygon

from slam.core import Array

POINTS = 500
"""Of a line; more are not to be seen."""

LEAST = 1e-9
"""What is less is nothing: an axis has no finer ticks."""

BINS = ("#2c7bb6", "#00a6a6", "#7fb84e", "#e6a117", "#d7191c")
"""Small errors to large ones; readable on light and on dark."""


@dataclass(frozen=True)
class Area:
    """A room in plan view. outline: (K, 2); kind: the page's colour, "good" or "bad"."""

    name: str
    outline: Array
    kind: str


@dataclass(frozen=True)
class Line:
    """A curve. x, y: (N,); kind: the page's colour, "estimate", "odometry" or "true"."""

    name: str
    x: Array
    y: Array
    kind: str


def plan(areas: Sequence[Area], walls: Sequence[Array], path: Array, errors: Array) -> str:
    """Rooms, plane segments (2, 2) and a path (N, 2) whose colour is its error (N,) [m]."""
    everything = [path, *walls, *(area.outline for area in areas)]
    corners = np.vstack([part.reshape(-1, 2) for part in everything])
    if len(corners) == 0:
        return ""
    low, high = corners.min(axis=0) - 0.5, corners.max(axis=0) + 0.5
    unit = float((high - low).max()) / 100.0
    parts = [_area(area, unit) for area in areas]
    parts += [_polyline(wall, "var(--ink)", 0.25 * unit) for wall in walls]
    parts += _coloured(path, errors, 0.45 * unit)
    parts += [_area_name(area, unit) for area in areas]
    box = f"{low[0]:.2f} {-high[1]:.2f} {high[0] - low[0]:.2f} {high[1] - low[1]:.2f}"
    return _svg(box, "Plan: detected rooms, mapped planes and the path", parts)


def legend(errors: Array) -> list[tuple[str, str]]:
    """The path's colours and the errors [cm] that they stand for; none without errors."""
    if len(errors) == 0:
        return []
    edges = 100.0 * _edges(errors)
    return [(c, f"{a:.1f}-{b:.1f} cm") for c, (a, b) in zip(BINS, pairwise(edges), strict=True)]


def chart(lines: Sequence[Line], x_name: str, y_name: str) -> str:
    """Curves over one axis, both from zero."""
    lines = [line for line in lines if len(line.x)]
    if not lines:
        return ""
    width, height, left, foot, head = 480.0, 250.0, 40.0, 40.0, 28.0
    x_ticks = ticks(max(float(line.x.max()) for line in lines))
    y_ticks = ticks(max(float(line.y.max()) for line in lines))
    x_scale = (width - left - 18.0) / x_ticks[-1]
    y_scale = (height - foot - head) / y_ticks[-1]
    parts: list[str] = []
    for tick in x_ticks:
        x = left + tick * x_scale
        parts.append(_text(x, height - foot + 16.0, f"{tick:g}", "middle"))
    for tick in y_ticks:
        y = height - foot - tick * y_scale
        level = np.array([[left, -y], [width - 18.0, -y]])
        parts += [
            _polyline(level, "var(--line)", 1.0),
            _text(left - 6.0, y + 4.0, f"{tick:g}", "end"),
        ]
    for line in lines:
        points = np.column_stack([left + line.x * x_scale, line.y * y_scale - (height - foot)])
        parts.append(_polyline(points, f"var(--{line.kind})", 1.8))
    parts += [
        _text(width - 12.0, height - 6.0, x_name, "end"),
        _text(4.0, 13.0, y_name, "start"),
    ]
    names = ", ".join(line.name for line in lines)
    return _svg(f"0 0 {width:g} {height:g}", f"{y_name} over {x_name}: {names}", parts, "chart")


def bars(names: Sequence[str], values: Array, marks: Array, unit: str) -> str:
    """Bars with a mark each (a higher percentile), from zero."""
    if len(names) == 0:
        return ""
    step, left, width = 26.0, 90.0, 480.0
    scale = (width - left - 125.0) / max(float(marks.max()), float(values.max()), 1e-9)
    parts: list[str] = []
    for i, (name, value, mark) in enumerate(zip(names, values, marks, strict=True)):
        y = i * step + 4.0
        end = left + mark * scale
        parts += [
            _text(left - 8.0, y + 13.0, name, "end", dim=False),
            f'<rect x="{left:g}" y="{y:.1f}" width="{value * scale:.1f}" height="18" '
            'rx="2" fill="var(--estimate)"/>',
            _polyline(np.array([[end, -y], [end, -y - 18.0]]), "var(--ink)", 2.0),
            _text(end + 6.0, y + 13.0, f"{value:.1f} / {mark:.1f} {unit}", "start"),
        ]
    said = ", ".join(f"{n} {v:.1f} {unit}" for n, v in zip(names, values, strict=True))
    return _svg(f"0 0 {width:g} {len(names) * step + 4:g}", said, parts, "chart")


def ticks(highest: float, count: int = 5) -> list[float]:
    """Round numbers from 0 to at least ``highest``, about ``count`` steps."""
    if not highest > LEAST:
        return [0.0, 1.0]
    power = 10.0 ** np.floor(np.log10(highest / count))
    step = next(power * m for m in (1.0, 2.0, 5.0, 10.0) if power * m * count >= highest * 0.999)
    return [round(float(step * i), 12) for i in range(int(np.ceil(highest / step - 1e-9)) + 1)]


def _edges(errors: Array) -> Array:
    return np.linspace(0.0, max(float(errors.max()), 1e-3), len(BINS) + 1)


def _coloured(path: Array, errors: Array, width: float) -> list[str]:
    """A line in stretches of one colour each."""
    chosen = np.unique(np.linspace(0, len(path) - 1, min(len(path), POINTS)).astype(int))
    if len(chosen) < 2:
        return []
    points = path[chosen]
    if len(errors) != len(path):
        return [_polyline(points, "var(--estimate)", width)]
    bins = np.clip(np.searchsorted(_edges(errors), errors[chosen][:-1]) - 1, 0, len(BINS) - 1)
    cuts = [0, *(np.flatnonzero(np.diff(bins)) + 1), len(bins)]
    return [_polyline(points[a : b + 1], BINS[bins[a]], width) for a, b in pairwise(cuts)]


def _area(area: Area, unit: float) -> str:
    colour = f"var(--{area.kind})"
    return (
        f'<polygon points="{_points(area.outline)}" fill="{colour}" fill-opacity=".18" '
        f'stroke="{colour}" stroke-width="{0.25 * unit:.3f}"/>'
    )


def _area_name(area: Area, unit: float) -> str:
    """Above the middle, where paths lead; no wider than the area, but to be read."""
    low, high = area.outline.min(axis=0), area.outline.max(axis=0)
    size = np.clip(1.6 * (high[0] - low[0]) / max(len(area.name), 1), 1.2 * unit, 2.2 * unit)
    polygon = Polygon(area.outline).buffer(0.0)
    middle = polygon.centroid if polygon.contains(polygon.centroid) else polygon.point_on_surface()
    x, y = (low + high) / 2.0 if polygon.is_empty else (middle.x, middle.y)
    y += 0.8 * size
    place = f'x="{x:.2f}" y="{-y:.2f}" font-size="{size:.3f}"'
    return f'<text {place} text-anchor="middle">{escape(area.name)}</text>'


def _polyline(points: Array, colour: str, width: float) -> str:
    """Points with y upwards."""
    if len(points) > POINTS:
        points = points[np.linspace(0, len(points) - 1, POINTS).astype(int)]
    return (
        f'<polyline points="{_points(points)}" fill="none" stroke="{colour}" '
        f'stroke-width="{width:.3f}" stroke-linejoin="round" stroke-linecap="round"/>'
    )


def _points(points: Array) -> str:
    return " ".join(f"{x:.2f},{-y:.2f}" for x, y in points)


def _text(x: float, y: float, text: str, anchor: str, dim: bool = True) -> str:
    kind = ' class="dim"' if dim else ""
    place = f'x="{x:.1f}" y="{y:.1f}" text-anchor="{anchor}"'
    return f'<text {place} font-size="13"{kind}>{escape(text)}</text>'


def _svg(box: str, said: str, parts: Sequence[str], kind: str = "plan") -> str:
    """said: what it shows, for those who cannot see it; kind: "plan" or "chart"."""
    return (
        f'<svg class="{kind}" viewBox="{box}" role="img" aria-label="{escape(said)}" '
        f'xmlns="http://www.w3.org/2000/svg"><title>{escape(said)}</title>{"".join(parts)}</svg>'
    )
