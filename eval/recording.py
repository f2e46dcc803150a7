"""A run as a rerun recording: the scene graph as it grows, over the truth.

The entity tree is the scene graph: ``world/truth/...`` in the world frame, and everything estimated
below ``world/map``, which is placed by the first true pose. Timelines: ``sim_time``, ``keyframe``.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from slam.core import (
    Array,
    Frame,
    MapPlane,
    MapView,
    PlanePiece,
    Proposals,
    Scan,
    inverse,
    transform_points,
)
from worlds.truth import Truth

if TYPE_CHECKING:
    from eval.config import RunConfig


@dataclass(frozen=True)
class RecordingConfig:
    """What of a run is worth its bytes: every n-th scan, and of it every n-th point.

    0.04 MB a scan, so that ten minutes stay below 100 MB. floor_z [m]: where rooms are drawn, in
    the map frame (the base stands on the floor); colours: of rooms, in turn.
    """

    scan_every: int = 3
    point_every: int = 8
    floor_z: float = 0.02
    colours: int = 12


NO_ROOM = 0


class RecordingSink:
    """Writes a rerun recording, which is there once it is complete."""

    def __init__(self, path: Path, config: RecordingConfig = RecordingConfig()):
        self._path = path
        self._part = path.with_name(f".{path.name}.part")
        self._config = config
        self._recording: Any = None
        self._frames = 0

    def started(self, config: RunConfig, truth: Truth | None) -> None:
        """Opens the file, sends the views, and draws the truth."""
        import rerun as rr

        self._recording = rr.RecordingStream("roomloop", recording_id=_recording_id(config))
        self._recording.save(self._part, default_blueprint=_blueprint(truth))
        self._log("world", rr.ViewCoordinates.RIGHT_HAND_Z_UP, static=True)
        self._log("world/map", _palette(self._config.colours), static=True)
        self._log("world/map/robot/body", _body((60, 120, 216)), static=True)
        if truth is not None:
            self._log("world/truth/robot/body", _body((150, 150, 150)), static=True)
            self._log("world/truth/walls", _truth_lines(truth), static=True)
            self._log("world/truth/rooms", _truth_names(truth), static=True)

    def frame(
        self, frame: Frame, scan: Scan, T_map_base: Array, T_world_base: Array | None = None
    ) -> None:
        """The robot where it is thought to be and where it is, and some of what it sees."""
        import rerun as rr

        if self._frames == 0:
            T_world_map = np.eye(4) if T_world_base is None else T_world_base @ inverse(T_map_base)
            self._log("world/map", _transform(T_world_map), static=True)
        self._recording.set_time("sim_time", duration=frame.stamp)
        self._log("world/map/robot", _transform(T_map_base))
        if T_world_base is not None:
            self._log("world/truth/robot", _transform(T_world_base))
        if self._frames % self._config.scan_every == 0:
            points = transform_points(scan.T_base_lidar, scan.points[:: self._config.point_every])
            self._log("world/map/robot/scan", rr.Points3D(points, radii=-1.0))
        self._frames += 1

    def updated(self, view: MapView, proposals: Proposals) -> None:
        """The map as it is now, in whole, so that what was retracted is gone."""
        import rerun as rr

        self._recording.set_time("sim_time", duration=view.stamp)
        self._recording.set_time("keyframe", sequence=len(view.keyframes) - 1)
        planes = {plane.id: plane for plane in view.planes}
        path = np.array([keyframe.T_map_base[:3, 3] for keyframe in view.keyframes])
        self._log("world/map/path", rr.LineStrips3D([path] if len(path) else []))
        upright = [plane for plane in view.planes if not plane.horizontal]
        outlines = [_rectangle(plane, plane.segment) for plane in upright]
        self._log("world/map/planes", _lines(outlines, classes=[NO_ROOM] * len(outlines)))
        self._log_rooms(proposals, planes)
        walls = [
            [_middle(planes[piece.plane_id], piece) for piece in wall.pieces]
            for wall in proposals.walls
            if all(piece.plane_id in planes for piece in wall.pieces)
        ]
        self._log("world/map/walls", _lines(walls, radius=0.06))

    def finished(self) -> None:
        """Completes the file."""
        if self._recording is None:
            return
        self._recording.flush()
        self._recording.disconnect()
        self._recording = None
        self._part.replace(self._path)

    def _log_rooms(self, proposals: Proposals, planes: dict[int, MapPlane]) -> None:
        import rerun as rr

        rooms = proposals.rooms
        classes = {room.id: 1 + room.id % self._config.colours for room in rooms}
        outlined = [(room, room.polygon) for room in rooms if room.polygon is not None]
        polygons = [_at_height(_closed(polygon), self._config.floor_z) for _, polygon in outlined]
        outlines = [classes[room.id] for room, _ in outlined]
        self._log("world/map/rooms/outlines", _lines(polygons, classes=outlines, radius=0.04))
        centres = [np.append(room.centre, self._config.floor_z) for room in rooms]
        labels = [f"room {room.id} ({room.confidence:.2f})" for room in rooms]
        colours = [classes[room.id] for room in rooms]
        self._log("world/map/rooms", rr.Points3D(centres, labels=labels, class_ids=colours))
        pieces = [
            (_rectangle(planes[piece.plane_id], piece.segment), classes[room.id])
            for room in rooms
            for piece in room.pieces
            if piece.plane_id in planes
        ]
        strips, colours = [strip for strip, _ in pieces], [colour for _, colour in pieces]
        self._log("world/map/rooms/pieces", _lines(strips, classes=colours, radius=0.03))

    def _log(self, entity: str, what: Any, static: bool = False) -> None:
        self._recording.log(entity, what, static=static)


# --- shapes ---------------------------------------------------------------------------------------


def _recording_id(config: RunConfig) -> str:
    return f"{config.scene}-{config.detector}-s{config.seed}"


def _rectangle(plane: MapPlane, segment: Array) -> Array:
    """(5, 3) closed outline of an upright plane over a segment in plan view."""
    low, high = plane.z_range
    ends = np.vstack([segment, segment[::-1], segment[:1]])
    return np.column_stack([ends, [low, low, high, high, low]])


def _middle(plane: MapPlane, piece: PlanePiece) -> Array:
    """(3,) the middle of a piece, half way up its plane."""
    return np.append(piece.segment.mean(axis=0), np.mean(plane.z_range))


def _closed(polygon: Array) -> Array:
    return np.vstack([polygon, polygon[:1]])


def _at_height(points: Array, z: float) -> Array:
    return np.column_stack([points[:, :2], np.full(len(points), z)])


def _lines(
    strips: Sequence[Any], classes: Sequence[int] | None = None, radius: float = 0.015
) -> Any:
    import rerun as rr

    return rr.LineStrips3D(strips, class_ids=classes, radii=radius)


def _transform(T_parent_child: Array) -> Any:
    import rerun as rr

    return rr.Transform3D(translation=T_parent_child[:3, 3], mat3x3=T_parent_child[:3, :3])


def _body(colour: tuple[int, int, int]) -> Any:
    import rerun as rr

    return rr.Boxes3D(centers=[[0, 0, 0.25]], half_sizes=[[0.2, 0.2, 0.25]], colors=[colour])


def _palette(colours: int) -> Any:
    """Class 0 is grey (no room), the others go round the colour circle."""
    import colorsys

    import rerun as rr

    hues = [colorsys.hsv_to_rgb(i * 0.618 % 1.0, 0.65, 0.95) for i in range(colours)]
    rgb = [(150, 150, 150)] + [tuple(int(255 * part) for part in hue) for hue in hues]
    return rr.AnnotationContext([rr.AnnotationInfo(id=i, color=c) for i, c in enumerate(rgb)])


def _truth_lines(truth: Truth) -> Any:
    import rerun as rr

    strips = [
        _at_height(part, z) for face in truth.faces for part in face.parts for z in face.z_range
    ]
    return rr.LineStrips3D(strips, colors=[(110, 110, 110)], radii=0.008)


def _truth_names(truth: Truth) -> Any:
    import rerun as rr

    heights = {floor.storey: floor.z_floor for floor in truth.floors}
    inside = [(room, room.polygon.representative_point()) for room in truth.rooms]
    centres = [[point.x, point.y, heights[room.storey]] for room, point in inside]
    names = [room.name for room, _ in inside]
    return rr.Points3D(centres, labels=names, colors=[(110, 110, 110)], radii=0.03)


def _blueprint(truth: Truth | None) -> Any:
    """The scene at an angle, and from above."""
    import rerun.blueprint as rrb

    ends = [face.segment for face in truth.faces] if truth is not None else []
    corners = np.vstack(ends) if ends else np.array([[-10.0, -10.0], [10.0, 10.0]])
    middle = np.append((corners.min(axis=0) + corners.max(axis=0)) / 2.0, 0.0)
    size = float(np.ptp(corners, axis=0).max())
    views = {"Scene graph": (0.0, -0.9, 0.9, (0, 0, 1)), "From above": (0.0, 0.0, 1.2, (0, 1, 0))}
    return rrb.Blueprint(
        rrb.Horizontal(
            *(
                rrb.Spatial3DView(
                    origin="/world",
                    name=name,
                    eye_controls=rrb.EyeControls3D(
                        position=middle + size * np.array([x, y, z]), look_target=middle, eye_up=up
                    ),
                )
                for name, (x, y, z, up) in views.items()
            )
        ),
        collapse_panels=True,
    )
