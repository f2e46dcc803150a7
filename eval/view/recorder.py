"""A run as a rerun recording: the scene graph as it grows, over the truth.

The entity tree is the scene graph: ``world/truth/...`` in the world frame, and everything estimated
below ``world/map``, which is placed by the first true pose. Timelines: ``sim_time``, ``keyframe``.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np
import rerun as rr

from eval.view import shapes
from eval.view.blueprint import blueprint, bounds
from eval.view.changes import Changes
from eval.view.judge import Judge, Judgement
from eval.view.layers import LayerConfig, Layers
from eval.view.poses import Poses
from eval.view.trail import Trail
from slam.core import (
    Array,
    Frame,
    IntArray,
    MapPlane,
    MapView,
    Proposals,
    RoomProposal,
    Scan,
    inverse,
    transform_points,
)
from worlds.truth import Truth

if TYPE_CHECKING:
    from eval.config import RunConfig

ON_PLANE = 0.08
"""A return is coloured by the nearest plane that its keyframe saw, up to this distance [m]."""

FALSE, MISSED = (215, 48, 39), (253, 174, 97)
TRUE_PATH, ESTIMATE, ODOMETRY = (150, 150, 150), (60, 120, 216), (140, 107, 177)

CURVES = {
    "error": (("ATE", ESTIMATE),),
    "found": (
        ("rooms found", (178, 223, 138)),
        ("rooms right", (51, 160, 44)),
        ("walls found", (253, 191, 111)),
        ("walls right", (255, 127, 0)),
    ),
}
"""Below ``plots``: names and colours. What is found is pale, what of it is right is not."""


class Target(Protocol):
    """Where a stream goes. tick_s: how long what is sent may wait for company [s], by the wall's
    clock as by the robot's."""

    tick_s: float

    def open(self, stream: Any, blueprint: Any) -> None:
        """Connects the stream, with the views that it opens with."""
        ...

    def close(self, stream: Any) -> None:
        """Lets go of the stream; whatever was sent is there afterwards."""
        ...


@dataclass(frozen=True)
class RecorderConfig:
    """What of a run is worth its bytes: every n-th scan, of it every n-th point, and about how many
    points of a keyframe."""

    scan_every: int = 5
    point_every: int = 20
    keyframe_points: int = 2000


class Recorder:
    """A sink that draws into a rerun stream."""

    def __init__(self, target: Target, config: RecorderConfig = RecorderConfig()):
        self._target = target
        self._config = config
        self._stream: Any = None
        self._frames, self._keyframe = 0, 0
        self._sent = -np.inf
        self._marked: dict[str, bytes] = {}
        self._stages: tuple[str, ...] = ()
        self._robot, self._true_robot = Poses("world/map/robot"), Poses("world/truth/robot")
        self._layers = Layers(self._log)
        self._changes = Changes()
        self._judge: Judge | None = None
        self._truth: Truth | None = None
        self._trails = {
            "world/truth/path": Trail(TRUE_PATH),
            "world/map/path": Trail(ESTIMATE),
            "world/map/odometry": Trail(ODOMETRY),
        }

    def started(self, config: RunConfig, truth: Truth | None) -> None:
        """Opens the stream, sends the views, and draws the truth."""
        name = f"{config.scene}-{config.detector}-s{config.seed}"
        batches = rr.ChunkBatcherConfig(flush_tick=self._target.tick_s)
        self._stream = rr.RecordingStream("roomloop", recording_id=name, batcher_config=batches)
        self._layers = Layers(self._log, LayerConfig(scale=_scale(truth)))
        self._target.open(self._stream, blueprint(truth))
        self._static("world", rr.ViewCoordinates.RIGHT_HAND_Z_UP)
        self._static("world/map", shapes.palette())
        self._static("world/map/robot/body", shapes.body(ESTIMATE))
        for plot, curves in CURVES.items():
            names, colours = zip(*curves, strict=True)
            self._name_curves(plot, names, colours)
        if truth is not None:
            self._truth, self._judge = truth, Judge(truth)
            self._draw_truth(truth)

    def _draw_truth(self, truth: Truth) -> None:
        parts = [(part, face.z_range) for face in truth.faces for part in face.parts]
        walls = shapes.upright([part for part, _ in parts], [span for _, span in parts], 16)
        self._static("world/truth/walls", walls)
        feet = [shapes.rectangle(part, (span[0], span[0]))[:2] for part, span in parts]
        self._static("world/truth/plan", shapes.lines(feet, (110, 110, 110), 0.01))
        heights = {floor.storey: floor.z_floor for floor in truth.floors}
        inside = [(room, room.polygon.representative_point()) for room in truth.rooms]
        at = [[point.x, point.y, heights[room.storey]] for room, point in inside]
        names = [room.name for room, _ in inside]
        label = rr.Points3D(at, labels=names, colors=[(110, 110, 110)], radii=0.03)
        self._static("world/truth/rooms", label)
        self._static("world/truth/robot/body", shapes.body(TRUE_PATH))

    def frame(
        self, frame: Frame, scan: Scan, T_map_base: Array, T_world_base: Array | None = None
    ) -> None:
        """The robot where it is thought to be and where it is, and some of what it sees."""
        if self._frames == 0:
            T_world_map = np.eye(4) if T_world_base is None else T_world_base @ inverse(T_map_base)
            self._static("world/map", shapes.transform(T_world_map))
        self._robot.add(frame.stamp, self._keyframe, T_map_base)
        if T_world_base is not None:
            self._true_robot.add(frame.stamp, self._keyframe, T_world_base)
            if self._judge is not None:
                self._judge.see(T_map_base, T_world_base)
        if self._frames % self._config.scan_every == 0:
            if frame.stamp >= self._sent + self._target.tick_s:
                self._send_poses()
                self._sent = frame.stamp
            self._stream.set_time("sim_time", duration=frame.stamp)
            points = transform_points(scan.T_base_lidar, scan.points[:: self._config.point_every])
            self._log(
                "world/map/robot/scan", rr.Points3D(points, radii=-1.0, colors=[(90, 90, 90)])
            )
            self._extend("world/map/odometry", frame.T_odom_base)
            self._extend("world/map/path", T_map_base)
            if T_world_base is not None:
                self._extend("world/truth/path", T_world_base)
        self._frames += 1

    def updated(self, view: MapView, proposals: Proposals) -> None:
        """The map as it is now; what was retracted is cleared."""
        self._stream.set_time("sim_time", duration=view.stamp)
        self._keyframe = len(view.keyframes) - 1
        self._stream.set_time("keyframe", sequence=self._keyframe)
        self._draw_keyframe(view)
        self._layers.draw(view, proposals)
        for event in self._changes.of(proposals):
            self.event(view.stamp, event)
        if self._judge is not None:
            normals = {plane.id: plane.normal for plane in view.planes}
            judgement = self._judge.judge(proposals, normals)
            if judgement is not None:
                self._draw_judgement(judgement, proposals)

    def timed(self, stamp: float, seconds: Mapping[str, float]) -> None:
        """Curves of the milliseconds by stage."""
        self._stream.set_time("sim_time", duration=stamp)
        if self._stages != tuple(seconds):
            self._stages = tuple(seconds)
            self._name_curves("ms", self._stages)
        self._plot("ms", *(1000.0 * value for value in seconds.values()))

    def event(self, stamp: float, text: str) -> None:
        """A line of the log."""
        self._stream.set_time("sim_time", duration=stamp)
        self._log("events", rr.TextLog(text, level=rr.TextLogLevel.INFO))

    def finished(self) -> None:
        """Hands everything over and lets the target go."""
        if self._stream is not None:
            self._send_poses()
            self._target.close(self._stream)
            self._stream = None

    def _draw_keyframe(self, view: MapView) -> None:
        """The last keyframe's returns, coloured by mapped plane, and its edges to those planes."""
        keyframe = view.keyframes[-1] if view.keyframes else None
        if keyframe is None:
            return
        seen = [p for p in view.planes if keyframe.id in p.keyframes]
        stride = 1 + len(keyframe.scan.points) // self._config.keyframe_points
        points = transform_points(keyframe.T_map_base, keyframe.scan.points[::stride])
        cloud = rr.Points3D(points, class_ids=_classes(points, seen), radii=-2.0)
        self._log("world/map/returns", cloud)
        at = keyframe.T_map_base[:3, 3]
        edges = [[at, shapes.plane_middle(plane)] for plane in seen]
        self._log("world/map/observations", shapes.lines(edges, (120, 120, 120), 0.005))

    def _draw_judgement(self, judgement: Judgement, proposals: Proposals) -> None:
        """Curves against the truth, and what is wrong (hide ``judgement`` to see without)."""
        wrong = [
            _closed(_outline(room), 0.05)
            for room in proposals.rooms
            if judgement.rooms.get(room.id) is None
        ]
        self._mark("world/map/judgement/false", wrong, FALSE)
        assert self._truth is not None
        heights = {floor.storey: floor.z_floor for floor in self._truth.floors}
        missed = [
            _closed(np.array(room.polygon.exterior.coords[:-1]), heights[room.storey] + 0.05)
            for room in self._truth.rooms
            if room.id in judgement.missed
        ]
        self._mark("world/truth/judgement/missed", missed, MISSED)
        right = sum(owner is not None for owner in judgement.rooms.values())
        found = len(proposals.rooms), right, len(proposals.walls), judgement.walls_right
        self._plot("found", *found)
        if judgement.ate is not None:
            self._plot("error", 100.0 * judgement.ate)

    def _mark(self, entity: str, outlines: list[Array], colour: shapes.Colour) -> None:
        """Outlines, where they are not what they were."""
        state = b"|".join(np.round(outline, 2).tobytes() for outline in outlines)
        if self._marked.get(entity) != state:
            self._marked[entity] = state
            self._log(entity, shapes.lines(outlines, colour, 0.06))

    def _plot(self, name: str, *values: float) -> None:
        self._log(f"plots/{name}", rr.Scalars([float(value) for value in values]))

    def _name_curves(
        self, plot: str, names: Sequence[str], colours: Sequence[shapes.Colour] | None = None
    ) -> None:
        self._static(f"plots/{plot}", rr.SeriesLines(names=names, colors=colours, widths=2.0))

    def _send_poses(self) -> None:
        self._robot.send(self._stream)
        self._true_robot.send(self._stream)

    def _extend(self, entity: str, pose: Array) -> None:
        trail = self._trails[entity]
        trail.add(pose[:3, 3])
        self._log(f"{entity}/{trail.part}", trail.strip())

    def _log(self, entity: str, what: Any) -> None:
        self._stream.log(entity, what)

    def _static(self, entity: str, what: Any) -> None:
        self._stream.log(entity, what, static=True)


def _classes(points: Array, planes: Sequence[MapPlane]) -> IntArray:
    """The class of each point (N, 3): of the plane it lies on, or of none."""
    if not planes:
        return np.full(len(points), shapes.NO_ROOM)
    normals = np.array([plane.normal for plane in planes])
    off = np.abs(points @ normals.T + [plane.d for plane in planes])
    classes = np.array([shapes.class_of(plane.id) for plane in planes])
    return np.where(off.min(axis=1) < ON_PLANE, classes[off.argmin(axis=1)], shapes.NO_ROOM)


def _scale(truth: Truth | None) -> float:
    """Of heights and nodes: 1 up to 25 m, then as the building grows, up to 3."""
    low, high = bounds(truth)
    return float(np.clip((high - low).max() / 25.0, 1.0, 3.0))


def _outline(room: RoomProposal) -> Array:
    """(K, 2) of a room; a square metre about its centre where it has none."""
    if room.polygon is not None:
        return room.polygon
    return room.centre + 0.5 * np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]])


def _closed(polygon: Array, z: float) -> Array:
    ring = np.vstack([polygon, polygon[:1]])
    return np.column_stack([ring, np.full(len(ring), z)])
