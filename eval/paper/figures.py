"""The paper's two figures: precision and recall of rooms, and two scenes seen by every method."""

from __future__ import annotations

import io
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from eval.comparing.ablation import Result
from eval.graphfile import PlaneNode, RoomNode, SceneGraph, WallNode
from eval.metrics import Metrics
from eval.paper.published import COUNTS, OURS, WALL_COUNTS, WITHOUT_PLANES
from eval.paper.sheets import spread
from eval.picture import FACE, FALSE, MISSED, ROOM, TRUE
from eval.score.rooms import match_centres, to_world
from eval.score.votes import RoomVote, inner_point
from slam.core import Array, RoomProposal
from worlds.truth import Room, Truth

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

BARS = ("#7f9c6c", "#a9bf9b", "#c98b4b", "#dcb58c", "#3a6ea5", "#8fb4dc")
DPI = 130
COLUMNS = 4
WIDTH = 12.3
"""Of the two scenes: 1600 pixels [inch]."""


def png_of(figure: Figure) -> bytes:
    """A figure as a file's content."""
    data = io.BytesIO()
    figure.savefig(data, format="png", dpi=DPI)
    return data.getvalue()


# --- precision and recall -------------------------------------------------------------------------


def rooms_png(worlds: Sequence[tuple[str, Result]], methods: Sequence[str]) -> bytes:
    """By the centre rule, over all scenes and seeds of a kind of world: bars to the mean, lines of
    one standard deviation within 0 and 1, and marks at the largest and the smallest value."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(11.0, 3.4 * len(worlds)), layout="constrained")
    axes = figure.subplots(len(worlds), 2, squeeze=False, sharey=True)
    for row, (world, result) in zip(axes, worlds, strict=True):
        for ax, measure in zip(row, ("precision", "recall"), strict=True):
            _bars(ax, result, methods, f"rooms.centre_{measure}")
            ax.set_title(f"{world}, {measure}", fontsize=10, loc="left")
    figure.suptitle("Rooms by the centre rule: mean, deviation, maximum and minimum", fontsize=11)
    return png_of(figure)


def _bars(ax: Axes, result: Result, methods: Sequence[str], metric: str) -> None:
    names = [method.replace(", ", ",\n") for method in methods]
    ax.set_xticks(range(len(methods)), names, fontsize=9)
    ax.set_xlim(-0.6, len(methods) - 0.4)
    ax.set_ylim(0.0, 1.2)
    ax.set_yticks(np.linspace(0.0, 1.0, 6))
    ax.grid(axis="y", color="#e5e5e5")
    ax.set_axisbelow(True)
    for side in ("top", "right"):
        ax.spines[side].set_visible(False)
    for place, method in enumerate(methods):
        level = result.level(method, metric)
        found = spread(level)
        if found is None:
            ax.text(place, 0.03, "no detection", ha="center", fontsize=8, rotation=90)
            continue
        ax.bar(place, found.mean, width=0.6, color=BARS[place % len(BARS)])
        ends = np.array([[found.mean], [1.0 - found.mean]])
        deviation = np.minimum(found.deviation or 0.0, ends)
        ax.errorbar(place, found.mean, yerr=deviation, color="#222222", capsize=4, lw=1.2)
        ax.plot([place, place], [found.low, found.high], "_", color="#b2182b", ms=14, mew=1.6)
        runs = sum(map(len, level.values.values()))
        ax.text(place, 1.05, f"{found.mean:.2f}", ha="center", fontsize=9)
        if found.count < runs:
            ax.text(place, 1.13, f"{found.count} of {runs} runs", ha="center", fontsize=7)


# --- two scenes -----------------------------------------------------------------------------------


@dataclass(frozen=True)
class Panel:
    """A run to be drawn: what it found, its metrics, and the truth of its world."""

    scene: str
    method: str
    graph: SceneGraph
    metrics: Metrics
    truth: Truth

    @property
    def T_world_map(self) -> Array:
        """(4, 4); the map as it lies where the run could not be aligned."""
        T = self.metrics.T_world_map
        return np.eye(4) if T is None else np.array(T)


Drawing = Callable[["Axes", Panel], None]


def scenes_png(panels: Sequence[Panel]) -> bytes:
    """Lines of a scene's methods by the centre rule, ours once more with its walls at their end."""
    from matplotlib.figure import Figure

    scenes = dict.fromkeys(panel.scene for panel in panels)
    lines = [line for scene in scenes for line in _lines(panels, scene)]
    figure = Figure(figsize=(WIDTH, 2.45 * len(lines)), layout="constrained")
    for row, line in zip(figure.subplots(len(lines), COLUMNS, squeeze=False), lines, strict=True):
        for ax in row:
            ax.set_axis_off()
        for ax, (draw, panel) in zip(row, line, strict=False):
            draw(ax, panel)
    figure.suptitle(
        "Rooms over the truth (grey), by the centre rule: green true, red false, hatched not found "
        "or not entered",
        fontsize=11,
    )
    return png_of(figure)


def _lines(panels: Sequence[Panel], scene: str) -> list[list[tuple[Drawing, Panel]]]:
    """What is drawn of a scene, COLUMNS a line."""
    own = [panel for panel in panels if panel.scene == scene]
    drawn: list[tuple[Drawing, Panel]] = [(_draw_rooms, panel) for panel in own]
    drawn += [(_draw_walls, panel) for panel in own if panel.method == OURS]
    return [drawn[start : start + COLUMNS] for start in range(0, len(drawn), COLUMNS)]


def centre_matches(panel: Panel) -> dict[str, int]:
    """Detected rooms that are true by the centre rule: node -> room."""
    nodes = [node for node in panel.graph.nodes if isinstance(node, RoomNode)]
    votes = [_vote(node, place) for place, node in enumerate(nodes)]
    matches = match_centres(votes, panel.truth.rooms, panel.T_world_map)
    return {nodes[place].id: room for place, room in matches.items()}


def _vote(node: RoomNode, place: int) -> RoomVote:
    """All that the centre rule asks for."""
    inner = inner_point(RoomProposal(place, (), node.polygon, node.centre, node.confidence))
    return RoomVote(place, (), None, 0.0, 0, (float(node.centre[0]), float(node.centre[1])), inner)


def _draw_truth(ax: Axes, truth: Truth, missed: Sequence[Room] = ()) -> None:
    from matplotlib.collections import LineCollection

    for room in truth.rooms:
        x, y = np.array(room.polygon.exterior.coords).T
        ax.fill(x, y, color=ROOM, lw=0)
    for room in missed:
        x, y = np.array(room.polygon.exterior.coords).T
        ax.fill(x, y, fill=False, hatch="///", edgecolor=MISSED, lw=0)
    parts = [part for face in truth.faces for part in face.parts]
    ax.add_collection(LineCollection(parts, colors=FACE, linewidths=1.0))
    ax.set_aspect("equal")


def _draw_rooms(ax: Axes, panel: Panel) -> None:
    matches = centre_matches(panel)
    missed = [room for room in panel.truth.rooms if room.id not in matches.values()]
    _draw_truth(ax, panel.truth, missed)
    nodes = [node for node in panel.graph.nodes if isinstance(node, RoomNode)]
    for node in nodes:
        color = TRUE if node.id in matches else FALSE
        if node.polygon is not None:
            x, y = to_world(panel.T_world_map, node.polygon).T
            ax.fill(x, y, color=color, alpha=0.25, lw=0)
            ax.plot(np.append(x, x[0]), np.append(y, y[0]), color=color, lw=1.0)
        ax.plot(*to_world(panel.T_world_map, node.centre[None])[0], "P", color=color, ms=4)
    ax.set_title(f"{panel.scene}, {panel.method}\n{rooms_caption(panel)}", fontsize=8)


def rooms_caption(panel: Panel) -> str:
    """Counts by the centre rule, by pieces where there are some, and the paper's."""
    rooms, matches = panel.metrics.rooms, centre_matches(panel)
    total = sum(isinstance(node, RoomNode) for node in panel.graph.nodes)
    recalled = round((rooms.centre_recall or 0.0) * (rooms.entered or 0))
    text = f"P {len(matches)}/{total}, R {recalled}/{rooms.entered}"
    if panel.method not in WITHOUT_PLANES and rooms.detected is not None:
        true = f"{rooms.true_positive:g}"
        recall = f"{(rooms.recall or 0.0) * (rooms.entered or 0):g}"
        text += f"; by pieces P {true}/{rooms.detected:g}, R {recall}/{rooms.entered}"
    theirs = COUNTS.get((panel.scene, panel.method))
    return text + (f"\npaper: P {theirs[0]}, R {theirs[1]}" if theirs else "")


def walls_caption(panel: Panel) -> str:
    """Walls found, and the paper's count."""
    walls = panel.metrics.walls
    text = f"walls {walls.true_positive} of {walls.detected} right, {walls.truth} to be found"
    theirs = WALL_COUNTS.get(panel.scene)
    return text + (f"\npaper: {theirs}" if theirs else "")


def _draw_walls(ax: Axes, panel: Panel) -> None:
    """Both planes of each wall, and a line between them; false ones dashed over the others, with
    which they may share their planes."""
    _draw_truth(ax, panel.truth)
    planes = {node.id: node for node in panel.graph.nodes if isinstance(node, PlaneNode)}
    for wall in (node for node in panel.graph.nodes if isinstance(node, WallNode)):
        false = panel.graph.truth.get(wall.id) == "false"
        color, style, z = (FALSE, (0, (2, 2)), 4) if false else (TRUE, "-", 3)
        ends = [to_world(panel.T_world_map, planes[plane].segment) for plane in wall.planes]
        middles = np.array([segment.mean(axis=0) for segment in ends])
        for line in (*ends, middles):
            ax.plot(*line.T, color=color, ls=style, lw=1.6, zorder=z)
    ax.set_title(f"{panel.scene}, {panel.method}, walls\n{walls_caption(panel)}", fontsize=8)
