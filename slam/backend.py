"""The back end: takes frames, keeps the plane map and the layered graph, answers with the map."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from slam.core import (
    Array,
    Frame,
    Keyframe,
    MapView,
    Proposals,
    RoomProposal,
    WallProposal,
    interpolate,
    inverse,
    pose,
)
from slam.graph import GraphConfig, LayeredGraph, RoomNode, WallNode
from slam.planemap import AssociationConfig, Observed, PlaneMap


@dataclass(frozen=True)
class BackEndConfig:
    """layers: what enters the graph beside keyframes and planes; merge_every: keyframes between two
    searches for planes that are one; moved: change of a pose [m, rad] that others are told of."""

    layers: str = "rooms+walls"
    merge_every: int = 5
    moved: float = 0.005
    graph: GraphConfig = field(default_factory=GraphConfig)
    association: AssociationConfig = field(default_factory=AssociationConfig)


class BackEnd:
    """One run's map. Feed it every frame in order; after a keyframe ask for the ``view``, hand the
    detector's proposals to ``accept``, and ``optimise``."""

    def __init__(self, config: BackEndConfig = BackEndConfig()):
        self._config = config
        self._graph = LayeredGraph(config.graph)
        self._planes = PlaneMap(config.association)
        self._frames: list[Frame] = []
        self._online: list[Array] = []
        self._keyframes: list[Frame] = []
        self._places: list[int] = []
        self._poses = np.zeros((0, 4, 4))
        self._told = np.zeros((0, 4, 4))
        self._known: dict[int, tuple[Array, float]] = {}
        self._T_map_track = np.eye(4)

    # --- one frame after the other ---

    def add(self, frame: Frame) -> bool:
        """Takes a frame in; True when it was a keyframe and the map has changed."""
        self._frames.append(replace(frame, keyframe=None))
        if frame.keyframe is not None:
            self._add_keyframe(frame)
        self._online.append(self._T_map_track @ frame.T_track_base)
        return frame.keyframe is not None

    def _add_keyframe(self, frame: Frame) -> None:
        assert frame.keyframe is not None
        keyframe = len(self._keyframes)
        T_map_base = self._T_map_track @ frame.T_track_base
        previous = self._keyframes[-1] if self._keyframes else None
        step = None if previous is None else inverse(previous.T_track_base) @ frame.T_track_base
        self._graph.add_keyframe(keyframe, T_map_base, step)
        self._keyframes.append(frame)
        self._places.append(len(self._frames) - 1)
        for place, observation in enumerate(frame.keyframe.planes):
            self._add_observation(keyframe, T_map_base, Observed(keyframe, place, observation))
        self.optimise()
        if keyframe % self._config.merge_every == 0:
            self._merge()

    def _add_observation(self, keyframe: int, T_map_base: Array, observed: Observed) -> None:
        observation = observed.observation
        plane = self._planes.associate(T_map_base, observation, self._known)
        normal = T_map_base[:3, :3] @ observation.normal
        if plane is None:
            plane = self._planes.new_plane()
            d = observation.d - float(normal @ T_map_base[:3, 3])
            self._graph.add_plane(plane, normal, d)
        else:
            normal = self._known[plane][0]
        self._graph.observe(keyframe, plane, observation, observed.place)
        scan_index = self._keyframes[keyframe].index
        self._planes.support(plane, observed, scan_index, T_map_base, normal)

    def _merge(self) -> None:
        pairs = self._planes.duplicates(self._known)
        for kept, gone in pairs:
            for moved in self._planes.merge(kept, gone):
                self._graph.reassign(moved.keyframe, kept, moved.observation, moved.place)
        if pairs:
            self._graph.forget_concepts_of({gone for _, gone in pairs})
            self.optimise()

    def accept(self, proposals: Proposals) -> None:
        """The rooms and walls that the graph holds from now on."""
        if self._config.layers == "planes":
            return
        rooms = {room.id: node for room in proposals.rooms if (node := self._room_node(room))}
        walls: dict[int, WallNode] = {}
        if self._config.layers == "rooms+walls":
            walls = {wall.id: w for wall in proposals.walls if (w := self._wall_node(wall))}
        self._graph.set_concepts(rooms, walls)

    def _room_node(self, room: RoomProposal) -> RoomNode | None:
        planes = tuple(
            dict.fromkeys(piece.plane_id for piece in room.pieces if piece.plane_id in self._known)
        )
        if not planes:
            return None
        pairs = opposed_pairs([self._known[plane][0] for plane in planes])
        height = float(np.mean([np.mean(self._planes.view(plane).z_range) for plane in planes]))
        return RoomNode(planes, pairs, np.append(room.centre, height))

    def _wall_node(self, wall: WallProposal) -> WallNode | None:
        first, second = (piece.plane_id for piece in wall.pieces)
        if first == second or not {first, second} <= set(self._known):
            return None
        middle = np.mean([piece.segment.mean(axis=0) for piece in wall.pieces], axis=0)
        height = float(np.mean(self._planes.view(first).z_range))
        return WallNode((first, second), np.append(middle, height))

    def optimise(self, extra_iterations: int = 0) -> None:
        """Solves the graph and brings poses, planes and the map's points up to date."""
        self._graph.optimise(extra_iterations)
        poses = np.array([self._graph.keyframe(k) for k in range(len(self._keyframes))])
        moved = np.ones(len(poses), dtype=bool)
        known = len(self._told)
        moved[:known] = np.abs(poses[:known] - self._told).max(axis=(1, 2)) > self._config.moved
        self._told = np.where(moved[:, None, None], poses, np.resize(self._told, poses.shape))
        self._known = {plane: self._graph.plane(plane) for plane in self._planes}
        self._planes.refresh(poses, self._known, moved)
        self._poses = poses
        self._T_map_track = poses[-1] @ inverse(self._keyframes[-1].T_track_base)

    # --- answers ---

    def view(self) -> MapView:
        """The map as estimated now."""
        return MapView(self._frames[-1].stamp, self._planes.views(), self.keyframes())

    def dense_view(self) -> MapView:
        """The same with every point that was kept of the planes, for the map that is written."""
        planes = self._planes.dense(self._poses, self._known)
        return MapView(self._frames[-1].stamp, planes, self.keyframes())

    def keyframes(self) -> list[Keyframe]:
        """All keyframes with their poses as estimated now."""
        return [
            Keyframe(k, frame.index, frame.stamp, self._poses[k], frame.keyframe)
            for k, frame in enumerate(self._keyframes)
            if frame.keyframe is not None
        ]

    def latest(self) -> Array:
        """T_map_base (4, 4) of the last scan as it is known now."""
        return self._online[-1]

    def stamps(self) -> Array:
        """(N,) the end of every sweep [s]."""
        return np.array([frame.stamp for frame in self._frames])

    def odometry(self) -> Array:
        """(N, 4, 4) T_map_base of every scan by the odometry alone (map = odom at the start)."""
        return np.array([frame.T_odom_base for frame in self._frames])

    def online(self) -> Array:
        """(N, 4, 4) T_map_base of every scan as it was known when the scan had been processed."""
        return np.array(self._online)

    def trajectory(self) -> Array:
        """(N, 4, 4) T_map_base of every scan as estimated now.

        Between two keyframes the correction of the tracking goes over from one's to the other's.
        """
        first = np.array(self._places)
        poses = []
        for place, frame in enumerate(self._frames):
            before = int(np.searchsorted(first, place, side="right")) - 1
            after = min(before + 1, len(first) - 1)
            span = first[after] - first[before]
            fraction = (place - first[before]) / span if span else 0.0
            poses.append(self._correction(before, after, fraction) @ frame.T_track_base)
        return np.array(poses)

    def _correction(self, before: int, after: int, fraction: float) -> Array:
        """T_map_track between two keyframes."""
        T_before, T_after = (
            self._poses[k] @ inverse(self._keyframes[k].T_track_base) for k in (before, after)
        )
        rotations, translations = interpolate(T_before, T_after, np.array([fraction]))
        return pose(rotations[0], translations[0])

    def graph(self) -> LayeredGraph:
        """The layered graph itself, for its nodes and edges."""
        return self._graph


def opposed_pairs(
    normals: Sequence[Array], tolerance: float = np.radians(20.0)
) -> tuple[tuple[int, int], ...]:
    """Up to two pairs of opposed planes, the second pair across the first.

    normals: (3,) each. What the paper's factors for rooms of four and of two planes need: the most
    nearly opposed pair, and the most nearly opposed one at right angles to it. No pair: empty.
    """
    candidates = sorted(
        (float(normals[i] @ normals[j]), i, j)
        for i in range(len(normals))
        for j in range(i + 1, len(normals))
    )
    chosen: list[tuple[int, int]] = []
    for dot, i, j in candidates:
        across = not chosen or abs(normals[i] @ normals[chosen[0][0]]) < np.sin(tolerance)
        if dot < -np.cos(tolerance) and across and len(chosen) < 2:
            chosen.append((i, j))
    return tuple(chosen)
