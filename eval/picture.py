"""plan.png: the truth of a building and what a run made of it, over each other."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from eval.files import whole_file
from eval.score.rooms import to_world
from eval.score.scores import RunRecord, Scores
from eval.score.trajectory import Trajectory, origin_alignment
from slam.core import Array, MapPlane, Proposals, transform_points
from worlds.plan import UNLABELLED
from worlds.truth import Room, Truth

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

UNJUDGED = "#6a51a3"
TRUE, FALSE, MISSED = "#1a9850", "#d73027", "#fdae61"
ROOM, FACE = "#ececec", "#9a9a9a"
PLANES = ("#1f78b4", "#6a3d9a", "#00a6ca", "#c51b7d", "#8c510a", "#4d4dff")
"""Colours of mapped planes, by turns; none is near those of rooms."""


@dataclass(frozen=True)
class RunPicture:
    """What is drawn, and the alignments (4, 4) that bring it over the truth.

    matches: proposal id -> room of true detections; entered: room ids; T_world_odom: the
    odometry's own alignment; judged: whether rooms were held against the truth.
    """

    title: str
    truth: Truth
    true_path: Trajectory
    estimate: Trajectory
    odometry: Trajectory
    T_world_map: Array
    T_world_odom: Array
    planes: Sequence[MapPlane] = ()
    proposals: Proposals = field(default_factory=Proposals)
    matches: Mapping[int, int] = field(default_factory=dict)
    entered: frozenset[int] = frozenset()
    judged: bool = True


def plan_png(record: RunRecord, scores: Scores, path: Path, title: str = "") -> None:
    """Write the picture of a run, whole or not at all."""
    save(picture_of(record, scores, title), path)


def save(picture: RunPicture, path: Path) -> None:
    """Write a picture, whole or not at all."""
    figure = run_figure(picture)
    with whole_file(path) as part:
        figure.savefig(part, format="png", dpi=150)


def picture_of(record: RunRecord, scores: Scores, title: str = "") -> RunPicture:
    """What there is to draw; a run that cannot be aligned is laid over the truth by its start."""
    true_path, truth = scores.truth_trajectory, record.keeper.truth
    alignments = [
        _over(score.T_truth_estimate, path, true_path)
        for score, path in ((scores.estimate, record.estimate), (scores.odometry, record.odometry))
    ]
    judged = truth.rooms_known and scores.T_world_map is not None
    return RunPicture(
        title=", ".join(filter(None, [title, _headline(scores)])),
        truth=truth,
        true_path=true_path,
        estimate=record.estimate,
        odometry=record.odometry,
        T_world_map=alignments[0],
        T_world_odom=alignments[1],
        planes=record.view.planes,
        proposals=record.proposals,
        matches=scores.rooms.matches,
        entered=frozenset(record.keeper.visits.entered if judged else ()),
        judged=judged,
    )


def _over(T: Array | None, path: Trajectory, true_path: Trajectory) -> Array:
    if T is not None:
        return T
    return origin_alignment(path, true_path) if len(path) and len(true_path) else np.eye(4)


def _headline(scores: Scores) -> str:
    ate, odometry = scores.estimate.ate, scores.odometry.ate
    rooms = "no room truth"
    if scores.rooms.entered is not None:
        rooms = f"rooms {len(scores.rooms.matches)} of {scores.rooms.entered} entered"
    if ate is None or odometry is None:
        return "not aligned, rooms not judged"
    return f"ATE {100 * ate:.1f} cm (odometry {100 * odometry:.1f} cm), {rooms}"


def run_figure(picture: RunPicture) -> Figure:
    """The picture as a matplotlib figure that belongs to no window."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=_size(picture.truth), layout="constrained")
    axes = figure.add_subplot()
    _draw_truth(axes, picture)
    _draw_rooms(axes, picture)
    _draw_planes(axes, picture)
    _draw_paths(axes, picture)
    axes.set(aspect="equal", xlabel="x [m]", ylabel="y [m]", title=picture.title)
    handles, labels = axes.get_legend_handles_labels()
    unique = dict(zip(labels, handles, strict=True))
    figure.legend(unique.values(), unique.keys(), loc="outside lower center", ncols=4, fontsize=8)
    return figure


def _size(truth: Truth) -> tuple[float, float]:
    """Inches: 10 on the longer side and room for the legend."""
    bounds = np.array([room.polygon.bounds for room in truth.rooms]).reshape(-1, 4)
    if len(bounds) == 0:
        return 10.0, 8.0
    width, height = np.maximum(bounds[:, 2:].max(axis=0) - bounds[:, :2].min(axis=0), 1.0)
    scale = 10.0 / max(width, height)
    return max(6.0, scale * width + 1.0), max(4.0, scale * height + 1.8)


def _draw_truth(axes: Axes, picture: RunPicture) -> None:
    from matplotlib.collections import LineCollection

    found = set(picture.matches.values())
    for room in picture.truth.rooms:
        missed = room.id in picture.entered and room.id not in found
        _draw_room(axes, room, missed)
    parts = [part for face in picture.truth.faces for part in face.parts]
    axes.add_collection(LineCollection(parts, colors=FACE, linewidths=2.5, label="true faces"))


def _draw_room(axes: Axes, room: Room, missed: bool) -> None:
    from matplotlib.patheffects import withStroke

    x, y = np.array(room.polygon.exterior.coords).T
    label = "free areas" if room.kind == UNLABELLED else "true rooms"
    axes.fill(x, y, color=ROOM, lw=0, label=label)
    if missed:
        label = "entered, missed"
        axes.fill(x, y, fill=False, hatch="///", edgecolor=MISSED, lw=0, label=label)
    place = room.polygon.representative_point()
    axes.annotate(
        f"{room.name} (missed)" if missed else room.name,
        (place.x, place.y),
        xytext=(0, 14),  # points: clear of the centre's mark
        textcoords="offset points",
        ha="center",
        fontsize=8,
        color="#b35806" if missed else "#404040",
        path_effects=[withStroke(linewidth=2.5, foreground="white")],
        zorder=7,
    )


def _draw_rooms(axes: Axes, picture: RunPicture) -> None:
    for room in picture.proposals.rooms:
        color, label = _verdict(room.id in picture.matches, picture.judged)
        if room.polygon is not None:
            x, y = to_world(picture.T_world_map, room.polygon).T
            axes.fill(x, y, color=color, alpha=0.18, lw=0, zorder=2)
            outline = np.append(x, x[0]), np.append(y, y[0])
            axes.plot(*outline, color=color, lw=1.2, zorder=3, label=label)
        centre = to_world(picture.T_world_map, room.centre[None])[0]
        axes.plot(*centre, "P", color=color, ms=6, mec="white", mew=0.6, zorder=5, label=label)


def _verdict(good: bool, judged: bool) -> tuple[str, str]:
    """Colour and label of a detected room."""
    if not judged:
        return UNJUDGED, "detected"
    return (TRUE, "detected, true") if good else (FALSE, "detected, false")


def _draw_planes(axes: Axes, picture: RunPicture) -> None:
    for plane in picture.planes:
        if not plane.horizontal:
            ends = to_world(picture.T_world_map, plane.segment)
            color = PLANES[plane.id % len(PLANES)]
            axes.plot(*ends.T, color=color, lw=1.3, zorder=4, label="mapped planes")


def _draw_paths(axes: Axes, picture: RunPicture) -> None:
    odometry = transform_points(picture.T_world_odom, picture.odometry.positions)
    estimate = transform_points(picture.T_world_map, picture.estimate.positions)
    true = picture.true_path.positions
    axes.plot(*odometry[:, :2].T, color="#8c6bb1", lw=1.0, ls=":", zorder=4, label="odometry")
    axes.plot(*true[:, :2].T, color="black", lw=1.4, zorder=4, label="true path")
    axes.plot(*estimate[:, :2].T, color="#2b8cbe", lw=1.0, ls="--", zorder=5, label="estimate")
    if len(true):
        axes.plot(*true[0, :2], "o", color="black", ms=5, zorder=5, label="start")
