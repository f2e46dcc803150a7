"""A building drawn as a floor plan, for people: its truth, and what stands and walks in it."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from shapely.geometry import Polygon

from slam.core import Array
from worlds.fittings import Fitting
from worlds.truth import CLUTTER, FURNITURE, GLASS, LEAF, Face, Room, Truth
from worlds.world import World

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

WALL = "#3b3f45"
ROOMS = ("#dfe9f3", "#e3f0df", "#f3e3e6", "#ebe4f3", "#f5efd8", "#dcefee")
"""Of rooms, by turns: neighbours mostly differ."""
CORRIDOR = "#f3ead9"
OTHER = "#e6e6e6"
FACE = "#2f6fab"
DOOR = "#c2622d"
GRAPH = "#7a4d9a"
ROUTE = "#1a9850"
PERSON = "#c0267e"
PANE = "#35b6d6"
FITTINGS = {FURNITURE: "#b08a5e", CLUTTER: "#8c8c5a", LEAF: "#c2622d", GLASS: PANE}
NORMAL = 0.22
"""Length of the ticks that show which way a face looks [m]."""
NARROW = 3.0
"""The name of a room narrower than this is broken into its words [m]."""
HEIGHT = 8.0
"""Height of a scene's picture [inches]."""
MANY = 60
"""Of more rooms than this the names are left out."""


@dataclass(frozen=True)
class Details:
    """What a picture shows beyond rooms, walls and doors. route: (N, 2) [m], of one storey."""

    names: bool = True
    normals: bool = True
    graph: bool = True
    route: Array | None = None


def draw_truth(
    axes: Axes,
    world: World,
    storey: int,
    details: Details = Details(),
) -> None:
    """One storey of a world in plan view."""
    truth = world.truth
    rooms = [room for room in truth.rooms if room.storey == storey]
    for k, room in enumerate(rooms):
        _fill(axes, [room.polygon], _room_colour(room, k), 1)
    _fill(axes, world.footprints[storey].geoms, WALL, 2)
    _draw_fittings(axes, [f for f in world.fittings if f.storey == storey])
    _draw_panes(axes, world, storey)
    _draw_faces(axes, [truth.faces[k] for room in rooms for k in room.faces], details.normals)
    if details.graph:
        _draw_graph(axes, truth, rooms)
    _draw_doors(axes, truth, rooms)
    _draw_people(axes, world, storey)
    if details.route is not None:
        axes.plot(*details.route.T, color=ROUTE, lw=1.4, zorder=6, label="route")
        axes.plot(*details.route[0], "o", color=ROUTE, ms=6, zorder=6)
    if details.names and len(rooms) <= MANY:
        for room in rooms:
            _write_name(axes, room)
    axes.set_aspect("equal")
    axes.autoscale_view()
    axes.set_xlabel("x [m]")
    axes.set_ylabel("y [m]")


def scene_figure(
    world: World,
    storeys: Sequence[int] | None = None,
    details: Details = Details(),
    title: str | None = None,
) -> Figure:
    """A figure of the world's storeys side by side (all that were built where None)."""
    from matplotlib.figure import Figure

    shown = [floor.storey for floor in world.truth.floors] if storeys is None else list(storeys)
    extents = [world.footprints[k].bounds or (0.0, 0.0, 1.0, 1.0) for k in shown]
    wide = [max((b[2] - b[0]) / max(b[3] - b[1], 1e-3), 0.3) for b in extents]
    figure = Figure(figsize=(min(HEIGHT * sum(wide) + 1.5, 24.0), HEIGHT), layout="constrained")
    panels = figure.subplots(1, len(shown), squeeze=False, width_ratios=wide)[0]
    head = title or world.plan.name
    for axes, storey in zip(panels, shown, strict=True):
        draw_truth(axes, world, storey, details)
        name = world.plan.storeys[storey].name
        axes.set_title(head if len(shown) == 1 else f"{head}, storey {name}")
    handles, labels = panels[0].get_legend_handles_labels()
    unique = dict(zip(labels, handles, strict=True))
    figure.legend(unique.values(), unique.keys(), loc="outside lower center", ncols=6, fontsize=9)
    return figure


def sheet_figure(worlds: Sequence[World], columns: int = 4) -> Figure:
    """All worlds on one sheet, the lowest storey of each, every panel at its own scale."""
    from matplotlib.figure import Figure

    rows = -(-len(worlds) // columns)
    figure = Figure(figsize=(5.0 * columns, 4.4 * rows), layout="constrained")
    panels = figure.subplots(rows, columns, squeeze=False).ravel()
    for axes, world in zip(panels, worlds, strict=False):
        floors = world.truth.floors
        draw_truth(axes, world, floors[0].storey, Details(names=False, normals=False, graph=False))
        rooms = [room for room in world.truth.rooms if room.storey == floors[0].storey]
        more = f", {len(floors)} storeys" if len(floors) > 1 else ""
        axes.set_title(f"{world.plan.name}: {len(rooms)} rooms{more}", fontsize=11)
        axes.set(xlabel="", ylabel="")
        axes.tick_params(labelsize=7)
    for axes in panels[len(worlds) :]:
        axes.set_axis_off()
    return figure


def _room_colour(room: Room, place: int) -> str:
    return {"room": ROOMS[place % len(ROOMS)], "corridor": CORRIDOR}.get(room.kind, OTHER)


def _fill(axes: Axes, polygons: Iterable[Polygon], colour: str, order: int) -> None:
    from matplotlib.patches import PathPatch
    from matplotlib.path import Path

    for polygon in polygons:
        rings = [np.asarray(ring.coords) for ring in (polygon.exterior, *polygon.interiors)]
        path = Path.make_compound_path(*(Path(ring, closed=True) for ring in rings))
        axes.add_patch(PathPatch(path, facecolor=colour, edgecolor="none", zorder=order))


def _draw_fittings(axes: Axes, fittings: Sequence[Fitting]) -> None:
    """Each box by its outline seen from above."""
    from matplotlib.collections import PolyCollection

    for label, colour in FITTINGS.items():
        own = [fitting for fitting in fittings if fitting.label == label]
        grounds = [np.asarray(fitting.footprint.exterior.coords) for fitting in own]
        if grounds:
            # Over the walls' colour, in which footprints are drawn that the base must not enter.
            boxes = PolyCollection(grounds, facecolors=colour, edgecolors="#4a3a28", linewidths=0.5)
            boxes.set_zorder(3)
            axes.add_collection(boxes)


def _draw_panes(axes: Axes, world: World, storey: int) -> None:
    """Glass in walls, which rays pass, by the middles of its openings."""
    from matplotlib.collections import LineCollection

    mesh = world.mesh
    names = mesh.geom_names
    of_glass = np.unique(mesh.geom_name[mesh.glass])
    lines = []
    for geom in of_glass:
        if names[geom].startswith(f"s{storey}_pane"):
            points = mesh.vertices[mesh.triangles[mesh.geom_name == geom]].reshape(-1, 3)[:, :2]
            spread = points - points.mean(axis=0)
            along = np.linalg.svd(spread, full_matrices=False)[2][0]
            reach = spread @ along
            lines.append(points.mean(axis=0) + np.outer([reach.min(), reach.max()], along))
    if lines:
        axes.add_collection(
            LineCollection(lines, colors=PANE, linewidths=2.5, zorder=4, label="glass")
        )


def _draw_faces(axes: Axes, faces: Sequence[Face], normals: bool) -> None:
    from matplotlib.collections import LineCollection

    parts = [part for face in faces for part in face.parts]
    axes.add_collection(LineCollection(parts, colors=FACE, linewidths=1.6, zorder=3, label="face"))
    if normals:
        middles = [(face.parts.mean(axis=(0, 1)), face.normal[:2]) for face in faces]
        ticks = [[middle, middle + NORMAL * normal] for middle, normal in middles]
        axes.add_collection(LineCollection(ticks, colors=FACE, linewidths=1.0, zorder=3))


def _draw_graph(axes: Axes, truth: Truth, rooms: Sequence[Room]) -> None:
    """Rooms that a door joins, by lines through it from middle to middle."""
    from matplotlib.collections import LineCollection

    place = {room.id: np.array(place_for_name(room.polygon)) for room in rooms}
    lines = [
        [place[a], door.centre[:2], place[b]]
        for door in truth.doors
        for a, b in [door.rooms]
        if a in place and b in place
    ]
    style = {"colors": GRAPH, "linewidths": 1.1, "linestyles": "dashed", "alpha": 0.7}
    axes.add_collection(LineCollection(lines, zorder=4, label="joined by a door", **style))


def _draw_doors(axes: Axes, truth: Truth, rooms: Sequence[Room]) -> None:
    ids = {room.id for room in rooms}
    doors = [door for door in truth.doors if ids & set(door.rooms)]
    if doors:
        x, y = np.array([door.centre for door in doors]).T
        axes.scatter(x, y, s=26, color=DOOR, marker="D", zorder=5, label="door")


def _draw_people(axes: Axes, world: World, storey: int) -> None:
    places = [person.place for person in world.people if person.storey == storey]
    if places:
        x, y = np.array(places).T
        axes.scatter(x, y, s=60, color=PERSON, marker="P", zorder=6, label="person")


def _write_name(axes: Axes, room: Room) -> None:
    from matplotlib.patheffects import withStroke

    x, y = place_for_name(room.polygon)
    tall = np.ptp(room.polygon.exterior.xy[1]) > 2.5 * np.ptp(room.polygon.exterior.xy[0])
    narrow = np.ptp(room.polygon.exterior.xy[0]) < NARROW and not tall
    text = room.name.replace(" ", "\n") if narrow else room.name.replace(" + ", "\n+ ")
    axes.text(
        x,
        y,
        text,
        ha="center",
        va="center",
        fontsize=9,
        rotation=90 if tall else 0,
        zorder=7,
        path_effects=[withStroke(linewidth=2.5, foreground="white")],
    )


def place_for_name(polygon: Polygon) -> tuple[float, float]:
    """The centroid where it is well inside, else the middle of the widest place."""
    from shapely import maximum_inscribed_circle

    circle = maximum_inscribed_circle(polygon, tolerance=0.05)
    if polygon.contains(polygon.centroid.buffer(circle.length / 2.0)):
        return polygon.centroid.x, polygon.centroid.y
    x, y = circle.coords[0]
    return float(x), float(y)
