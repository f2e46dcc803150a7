"""report.html: what a run asked for, what came out, and where it went wrong; from the run's files.

Nothing is computed anew but the errors along the path; what a file does not say is left out.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from eval.files import read_bytes, read_json, write_text
from eval.folder import CONFIG_FILE
from eval.graphfile import PlaneNode, RoomNode, SceneGraph, read_graph
from eval.outputs import read_tum
from eval.report import html, svg
from eval.roomtable import FALSE, FOUND, MISSED, ROOMS_FILE, RoomRow, read_rooms
from eval.score.rooms import to_world
from eval.score.trajectory import Trajectory, align, origin_alignment, position_errors, travelled
from slam.core import HORIZONTAL, Array, InputError

REPORT_FILE = "report.html"
NONE = "-"
"""Said where a number does not apply."""

MOST = 1e15
"""A number that is no smaller says nothing."""

STAGE_TIMES = ("median_ms", "p95_ms")

CAUSES = {
    "unseen": "the sensor has seen too few of its walls",
    "planes": "the map does not hold its walls, or not apart; or it is made of no walls",
    "edges": "its walls are mapped; the detector did not join them, or joined them with others'",
    "clustering": "its walls are mapped; the detector made something else of them",
}
"""The causes of ``eval/score/failures.py`` in other words."""


@dataclass(frozen=True)
class RunFiles:
    """A run's folder, read. truth: None where there is none; rooms: empty where they are not
    scored; plan: plan.png, empty if absent."""

    config: Mapping[str, object]
    metrics: Mapping[str, object]
    graph: SceneGraph
    estimate: Trajectory
    odometry: Trajectory
    truth: Trajectory | None
    rooms: Sequence[RoomRow]
    plan: bytes


def read_run(folder: Path) -> RunFiles:
    """The files of a finished run. Raises InputError."""
    if not folder.is_dir():
        raise InputError(f"{folder}: no such run; expected its folder, as runs/SE1-gnn-s0")
    truth, rooms, plan = (folder / name for name in ("truth.tum", ROOMS_FILE, "plan.png"))
    return RunFiles(
        config=read_json(folder / CONFIG_FILE),
        metrics=read_json(folder / "metrics.json"),
        graph=read_graph(folder / "graph.json"),
        estimate=read_tum(folder / "trajectory.tum"),
        odometry=read_tum(folder / "odometry.tum"),
        truth=read_tum(truth) if truth.exists() else None,
        rooms=read_rooms(rooms) if rooms.exists() else (),
        plan=read_bytes(plan) if plan.exists() else b"",
    )


def write_report(folder: Path) -> Path:
    """Makes the page of a finished run from its files. Raises InputError."""
    path = folder / REPORT_FILE
    write_text(path, run_page(read_run(folder)))
    return path


def run_page(run: RunFiles) -> str:
    """The page as HTML."""
    scene, detector = run.config.get("scene", NONE), run.config.get("detector", NONE)
    title = f"{Path(str(scene)).stem}, {detector}, seed {run.config.get('seed', NONE)}"
    seconds = number(get(run.metrics, "simulated_s"), digits=0)
    metres = number(get(run.metrics, "path_m"), digits=0)
    lead = f"{metres} m driven in {seconds} simulated seconds; {_state(run.metrics)}"
    sections = [
        html.section("Result", *_result(run.metrics)),
        html.section("Plan", *_plan(run)),
        html.section("Rooms", *_rooms(run)),
        html.section("Error along the path", *_errors(run)),
        html.section("Time", *_time(run.metrics)),
        html.folded("All metrics", _metrics_table(run.metrics)),
        html.folded("Configuration", _table("What the run was asked for", run.config)),
    ]
    return html.page(title, lead, sections)


def get(tree: object, path: str) -> object:
    """A value by its dotted path, or None."""
    value = tree
    for key in path.split("."):
        value = value.get(key) if isinstance(value, Mapping) else None
    return value


def number(value: object, scale: float = 1.0, digits: int = 2, unit: str = "") -> str:
    """A number as text; ``NONE`` for what is none."""
    if isinstance(value, bool) or not isinstance(value, (int, float)) or not abs(value) < MOST:
        return NONE
    return f"{scale * value:.{digits}f}{unit}"


def _state(metrics: Mapping[str, object]) -> str:
    error = get(metrics, "error")
    return str(get(metrics, "status") or NONE) + (f": {error}" if error else "")


def _result(metrics: Mapping[str, object]) -> Iterator[str]:
    if get(metrics, "status") != "complete":
        yield html.paragraph(f"This run did not end well: {_state(metrics)}", "bad")

    def both(kind: str) -> str:
        names = (f"{kind}.precision", f"{kind}.recall")
        return " / ".join(number(get(metrics, name)) for name in names)

    yield html.cards(
        [
            ("rooms: precision / recall", both("rooms")),
            ("walls: precision / recall", both("walls")),
            ("position error (ATE)", number(get(metrics, "ate_m"), 100.0, 1, " cm")),
            ("odometry alone (ATE)", number(get(metrics, "ate_odometry_m"), 100.0, 1, " cm")),
            ("map error (MMA)", number(get(metrics, "mma_m"), 100.0, 1, " cm")),
            ("first room", number(get(metrics, "first_room_s"), 1.0, 1, " s")),
        ]
    )


# --- the plan ------------------------------------------------------------------------------------


def _alignment(estimate: Trajectory, truth: Trajectory | None) -> Array | None:
    """T_truth_estimate, by the start where a path cannot be aligned; None without truth."""
    if truth is None or len(truth) != len(estimate) or len(estimate) == 0:
        return None
    T = align(estimate.positions, truth.positions)
    return origin_alignment(estimate, truth) if T is None else T


def _along(estimate: Trajectory, truth: Trajectory | None) -> Array:
    """Position error of each scan [m]; empty without truth."""
    T = _alignment(estimate, truth)
    if T is None or truth is None:
        return np.zeros(0)
    return np.linalg.norm(position_errors(T, estimate, truth), axis=1)


def _plan(run: RunFiles) -> Iterator[str]:
    T = _alignment(run.estimate, run.truth)
    T = np.eye(4) if T is None else T
    rooms = [node for node in run.graph.nodes if isinstance(node, RoomNode)]
    areas = [
        svg.Area(_name(node, run.graph), to_world(T, node.polygon), _kind(node, run.graph))
        for node in rooms
        if node.polygon is not None
    ]
    planes = [node for node in run.graph.nodes if isinstance(node, PlaneNode)]
    upright = [to_world(T, node.segment) for node in planes if abs(node.normal[2]) < HORIZONTAL]
    path = to_world(T, run.estimate.positions[:, :2])
    errors = _along(run.estimate, run.truth)
    words = "What was found: rooms (green: true, red: false), mapped planes, the estimated path"
    if len(errors):
        words += ", coloured by its error:"
    yield html.figure(svg.plan(areas, upright, path, errors), words, svg.legend(errors))
    if run.plan:
        words = "Truth and estimate over each other; rooms entered and missed are hatched"
        yield html.figure(html.image(run.plan, words), words)


def _name(node: RoomNode, graph: SceneGraph) -> str:
    label = graph.truth.get(node.id, node.id)
    return f"{node.id}, false" if label == "false" else label


def _kind(node: RoomNode, graph: SceneGraph) -> str:
    """True and false rooms; without truth they are estimates, no more."""
    label = graph.truth.get(node.id)
    return "estimate" if label is None else ("bad" if label == "false" else "good")


def _rooms(run: RunFiles) -> Iterator[str]:
    """The faults first, by name; then every room."""
    missed = [row for row in run.rooms if row.state == MISSED]
    false = [row for row in run.rooms if row.state == FALSE]
    entered = len(missed) + sum(row.state == FOUND for row in run.rooms)
    if run.rooms:
        words = f"Rooms entered: {entered}; missed: {len(missed)}; false detections: {len(false)}"
        yield html.paragraph(words, "bad" if missed or false else "good")
    yield html.items([f"Missed: {row.room}. {_cause(row)}" for row in missed])
    yield html.items([f"False: {row.detection}{_about(row)}. {_cause(row)}" for row in false])
    nodes = {node.id: node for node in run.graph.nodes if isinstance(node, RoomNode)}
    rows = run.rooms or [RoomRow(NONE, "", node) for node in nodes]
    if rows:
        header = ("room", "state", "detection", "plane pieces", "confidence")
        yield html.table(html.Table("Rooms", header, [_room(row, nodes) for row in rows]))


def _room(row: RoomRow, nodes: Mapping[str, RoomNode]) -> tuple[str, ...]:
    node = nodes.get(row.detection)
    of_node = (NONE, NONE) if node is None else (str(len(node.pieces)), f"{node.confidence:.2f}")
    return (row.room or NONE, row.state or NONE, row.detection or NONE, *of_node)


def _about(row: RoomRow) -> str:
    return f" (about {row.room})" if row.room else ""


def _cause(row: RoomRow) -> str:
    words = CAUSES.get(row.cause, row.cause)
    return words[:1].upper() + words[1:] + "."


# --- along the path, time, and all the rest ------------------------------------------------------


def _errors(run: RunFiles) -> Iterator[str]:
    lines = []
    for name, path in (("estimate", run.estimate), ("odometry", run.odometry)):
        errors = _along(path, run.truth)
        if run.truth is not None and len(errors):
            lines.append(svg.Line(name, travelled(run.truth.positions), 100.0 * errors, name))
    if lines:
        picture = svg.chart(lines, "distance driven [m]", "position error [cm]")
        yield html.figure(picture, "Estimate (blue) and odometry alone (violet), each aligned")


def _time(metrics: Mapping[str, object]) -> Iterator[str]:
    stages = get(metrics, "stages")
    if not isinstance(stages, Mapping):
        return
    times = {name: [get(stage, key) for key in STAGE_TIMES] for name, stage in stages.items()}
    known = {name: pair for name, pair in times.items() if NONE not in map(number, pair)}
    median, p95 = np.array(list(known.values()), dtype=np.float64).reshape(-1, 2).T
    picture = svg.bars(list(known), median, p95, "ms")
    if picture:
        pace = number(get(metrics, "real_time_factor"), 1.0, 1)
        yield html.paragraph(f"{pace} times real time, on the machine that it ran on")
        yield html.figure(picture, "Each stage's time a call: median (bar) and 95th percentile")


def _metrics_table(metrics: Mapping[str, object]) -> str:
    return _table("metrics.json; SI units unless the name says otherwise", metrics)


def _table(caption: str, tree: Mapping[str, object]) -> str:
    rows = [(name, _said(value)) for name, value in leaves(tree)]
    return html.table(html.Table(caption, ("name", "value"), rows))


def leaves(tree: Mapping[str, object], above: str = "") -> Iterator[tuple[str, object]]:
    """Dotted names and values; matrices are left to the files."""
    for key, value in tree.items():
        if isinstance(value, Mapping):
            yield from leaves(value, f"{above}{key}.")
        elif not isinstance(value, list):
            yield f"{above}{key}", value


def _said(value: object) -> str:
    if value is None:
        return NONE
    return f"{value:.6g}" if isinstance(value, float) else str(value)
