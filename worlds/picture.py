"""The truth drawn as a floor plan, for people."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
from shapely.geometry import MultiPolygon, Polygon

from worlds.truth import Room, Truth
from worlds.world import World

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

WALL = "#3b3f45"
ROOM = "#dfe9f3"
CORRIDOR = "#f3ead9"
OTHER = "#e6e6e6"
FACE = "#2f6fab"
DOOR = "#c2622d"
NARROW = 3.0
"""The name of a room narrower than this is broken into its words [m]."""
HEIGHT = 8.0
"""Height of a scene's picture [inches]."""


def draw_truth(
    axes: Axes, truth: Truth, storey: int | None = None, walls: MultiPolygon | None = None
) -> None:
    """Rooms with their names, faces and doors of one storey (the first where None) in plan view.

    walls: the walls' footprint, drawn solid if given.
    """
    shown = min((f.storey for f in truth.floors), default=0) if storey is None else storey
    rooms = [room for room in truth.rooms if room.storey == shown]
    for room in rooms:
        _fill(axes, room.polygon, {"room": ROOM, "corridor": CORRIDOR}.get(room.kind, OTHER), 1)
    for polygon in walls.geoms if walls is not None else ():
        _fill(axes, polygon, WALL, 2)
    _draw_faces(axes, truth, rooms)
    _draw_doors(axes, truth, rooms)
    for room in rooms:
        _write_name(axes, room)
    axes.set_aspect("equal")
    axes.autoscale_view()
    axes.set_xlabel("x [m]")
    axes.set_ylabel("y [m]")


def scene_figure(world: World, storeys: Sequence[int] | None = None) -> Figure:
    """A figure of the world's storeys side by side (all that were built where None)."""
    from matplotlib.figure import Figure

    shown = [floor.storey for floor in world.truth.floors] if storeys is None else list(storeys)
    extents = [world.footprints[k].bounds or (0.0, 0.0, 1.0, 1.0) for k in shown]
    wide = [max((b[2] - b[0]) / max(b[3] - b[1], 1e-3), 0.3) for b in extents]
    figure = Figure(figsize=(min(HEIGHT * sum(wide) + 1.5, 24.0), HEIGHT), layout="constrained")
    panels = figure.subplots(1, len(shown), squeeze=False, width_ratios=wide)[0]
    for axes, storey in zip(panels, shown, strict=True):
        draw_truth(axes, world.truth, storey, world.footprints[storey])
        name = world.plan.storeys[storey].name
        axes.set_title(world.plan.name if len(shown) == 1 else f"{world.plan.name}, storey {name}")
    return figure


def _fill(axes: Axes, polygon: Polygon, colour: str, order: int) -> None:
    from matplotlib.patches import PathPatch
    from matplotlib.path import Path

    rings = [np.asarray(ring.coords) for ring in (polygon.exterior, *polygon.interiors)]
    path = Path.make_compound_path(*(Path(ring, closed=True) for ring in rings))
    axes.add_patch(PathPatch(path, facecolor=colour, edgecolor="none", zorder=order))


def _draw_faces(axes: Axes, truth: Truth, rooms: Sequence[Room]) -> None:
    from matplotlib.collections import LineCollection

    own = [truth.faces[k] for room in rooms for k in room.faces]
    parts = [part for face in own for part in face.parts]
    axes.add_collection(LineCollection(parts, colors=FACE, linewidths=1.6, zorder=3))


def _draw_doors(axes: Axes, truth: Truth, rooms: Sequence[Room]) -> None:
    ids = {room.id for room in rooms}
    doors = [door for door in truth.doors if ids & set(door.rooms)]
    if doors:
        x, y = np.array([door.centre for door in doors]).T
        axes.scatter(x, y, s=26, color=DOOR, marker="D", zorder=4, label="door")


def _write_name(axes: Axes, room: Room) -> None:
    x, y = _place_for_name(room.polygon)
    tall = np.ptp(room.polygon.exterior.xy[1]) > 2.5 * np.ptp(room.polygon.exterior.xy[0])
    narrow = np.ptp(room.polygon.exterior.xy[0]) < NARROW and not tall
    text = room.name.replace(" ", "\n") if narrow else room.name.replace(" + ", "\n+ ")
    axes.text(
        x, y, text, ha="center", va="center", fontsize=9, rotation=90 if tall else 0, zorder=5
    )


def _place_for_name(polygon: Polygon) -> tuple[float, float]:
    """The centroid where it is well inside, else the middle of the widest place."""
    from shapely import maximum_inscribed_circle

    circle = maximum_inscribed_circle(polygon, tolerance=0.05)
    if polygon.contains(polygon.centroid.buffer(circle.length / 2.0)):
        return polygon.centroid.x, polygon.centroid.y
    x, y = circle.coords[0]
    return float(x), float(y)
