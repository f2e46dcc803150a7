"""The back end: takes frames, keeps the plane map and the layered graph, answers with the map."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from slam.concepts import RoomNode, WallNode
from slam.core import (
    Array,
    Frame,
    InputError,
    Keyframe,
    KeyframeScan,
    MapView,
    Proposals,
    RoomProposal,
    RunError,
    WallProposal,
    inverse,
    transform_plane,
    transform_points,
)
from slam.graph import GraphConfig, LayeredGraph
from slam.keyframes import Keyframes, usable_planes
from slam.loops import Loop, LoopCloser, LoopConfig
from slam.nodes import Nodes, one_in_a_room, room_node, wall_node
from slam.path import Anchor, Path
from slam.planemap import PlaneMap, PlaneMapConfig
from slam.plumb import Up
from slam.relations import RelationConfig, Relations
from slam.storeys import Storeys
from slam.support import Observed

LAYERS = ("planes", "rooms", "rooms+walls")
"""What enters the graph: keyframes and planes alone, and what beside them."""


@dataclass(frozen=True)
class BackEndConfig:
    """Raises InputError for unknown layers.

    layers: one of ``LAYERS``; relations: what rooms and walls say of planes beside the published
    factors (None: nothing); loops: None closes none; merge_every: keyframes between two searches
    for planes that are one; near [m], often: a keyframe so near an earlier one adds nothing if all
    planes that it sees have been seen so often.
    """

    layers: str = "rooms+walls"
    relations: RelationConfig | None = None
    loops: LoopConfig | None = field(default_factory=LoopConfig)
    merge_every: int = 5
    near: float = 0.25
    often: int = 10
    graph: GraphConfig = field(default_factory=GraphConfig)
    planes: PlaneMapConfig = field(default_factory=PlaneMapConfig)

    def __post_init__(self) -> None:
        if self.layers not in LAYERS:
            expected = ", ".join(LAYERS)
            raise InputError(f"layers: {self.layers!r} is unknown, expected one of {expected}")


class BackEnd:
    """One run's map. Feed it every frame in order; after a keyframe ask for the ``view`` and hand
    the detector's proposals to ``accept``; at the end, ``finish``."""

    def __init__(self, config: BackEndConfig = BackEndConfig()):
        self._config = config
        self._graph = LayeredGraph(config.graph)
        self._estimates = self._graph.estimates
        self._storeys = Storeys()
        self._planes = PlaneMap(self._estimates, config.planes)
        self._rooms = Nodes(self._planes, self._room_node)
        self._walls = Nodes(self._planes, self._wall_node)
        self._path = Path()
        self._keyframes: list[Frame] = []
        self._scans: list[KeyframeScan] = []
        self._way = 0.0
        self._T_map_track = np.eye(4)
        self._failed = False
        self._up = Up()
        self._relations = None if config.relations is None else Relations(config.relations)
        self._closer = LoopCloser() if config.loops is None else LoopCloser(config.loops)

    # --- one frame after the other ---

    def add(self, frame: Frame) -> bool:
        """Takes a frame in; True when it was a keyframe and the map has changed."""
        count, anchor = len(self._keyframes), None
        try:
            if frame.keyframe is not None:
                anchor = self._add_keyframe(frame)
        finally:  # a graph that cannot be solved leaves a trajectory, the last good one
            self._path.add(frame, self._T_map_track @ frame.T_track_base, anchor)
        return len(self._keyframes) > count

    def _add_keyframe(self, frame: Frame) -> Anchor:
        """Adds it to the map, or finds where it is beside a keyframe that has seen as much."""
        assert frame.keyframe is not None
        keyframe = len(self._keyframes)
        T_map_base = self._T_map_track @ frame.T_track_base
        previous = self._keyframes[-1] if self._keyframes else None
        step = None if previous is None else inverse(previous.T_track_base) @ frame.T_track_base
        planes = usable_planes(keyframe, frame.keyframe)
        seen = [observation for _, observation in planes]
        way = self._way + (0.0 if step is None else float(np.linalg.norm(step[:3, 3])))
        storey = self._storeys.at(T_map_base)
        T_map_base, known = self._planes.associate(T_map_base, seen, way, storey)
        nearest = self._that_saw_as_much(T_map_base, known)
        if nearest is not None:
            self._T_map_track = T_map_base @ inverse(frame.T_track_base)
            return nearest, inverse(self._estimates.poses[nearest]) @ T_map_base
        self._way = way
        self._graph.add_keyframe(keyframe, T_map_base, step)
        self._storeys.add(storey, T_map_base)
        self._set_upright(keyframe, T_map_base, frame.keyframe.plumb)
        self._keyframes.append(frame)
        self._scans.append(frame.keyframe)
        for (place, observation), plane in zip(planes, known, strict=True):
            self._add_observation(T_map_base, Observed(keyframe, place, observation), plane)
        self._drop_doubtful(keyframe)
        self.optimise(whole=self._close_loop())
        if keyframe % self._config.merge_every == 0:
            self._merge()
        return keyframe, np.eye(4)

    def _set_upright(self, keyframe: int, T_map_base: Array, plumb: Array | None) -> None:
        """Ramps, and storeys above them, have nothing but plumb walls in common with the first
        storey; on that its floor says better which way is up."""
        if plumb is None:
            return
        up = self._up.compared(T_map_base, plumb)
        if up is None or (self._storeys.of(keyframe) == 0 and self._storeys.level(T_map_base)):
            return
        self._graph.set_upright(keyframe, plumb, up)

    def _that_saw_as_much(self, T_map_base: Array, known: Sequence[int | None]) -> int | None:
        """The keyframe beside which another one adds nothing, if there is one: as many keyframes
        as the building has places are enough, however long the base goes about in it."""
        config = self._config
        places = self._estimates.poses[:, :3, 3]
        if len(known) < 3 or len(places) == 0:
            return None
        often = (
            plane is not None and self._planes.times_seen(plane) >= config.often for plane in known
        )
        distance = np.linalg.norm(places - T_map_base[:3, 3], axis=1)
        return int(distance.argmin()) if distance.min() < config.near and all(often) else None

    def _add_observation(self, T_map_base: Array, observed: Observed, plane: int | None) -> None:
        """An observation of a plane, or of one that is new."""
        observation = observed.observation
        if plane is None:
            normal, d = transform_plane(T_map_base, observation.normal, observation.d)
            place = transform_points(T_map_base, observation.centroid)
            plane = self._graph.add_plane(normal, d, place)
            self._planes.new_plane(plane, self._storeys.of(observed.keyframe))
        self._graph.observe(observed.keyframe, plane, observation, observed.place)
        scan_index = self._keyframes[observed.keyframe].index
        self._planes.support(plane, observed, scan_index, T_map_base, self._way)

    def _merge(self) -> None:
        self._merge_pairs(self._planes.duplicates())

    def _merge_pairs(self, pairs: list[tuple[int, int]]) -> None:
        """Makes one plane of two: its observations move, what rested on the other is removed."""
        for kept, gone in pairs:
            for moved in self._planes.merge(kept, gone):
                self._graph.observe(moved.keyframe, kept, moved.observation, moved.place)
        if pairs:
            merged = {gone for _, gone in pairs}
            for plane in merged:
                self._graph.drop_plane(plane)
            self.optimise(whole=True)

    def _close_loop(self) -> bool:
        """Looks for a loop that the last keyframe closes; True if it moves the map."""
        config = self._config.loops
        if config is None:
            return False
        loop = self._closer.find(self._estimates.poses, self._scans, self._way)
        if loop is None:
            return False
        self._graph.close_loop(loop, config.rotation, config.translation)
        return True

    @property
    def loops(self) -> tuple[Loop, ...]:
        """The loops that were closed."""
        return tuple(self._closer.loops)

    def finish(self) -> None:
        """The last word: planes that are one or were hardly seen, and the whole map solved."""
        if self._failed or not self._keyframes:
            return
        self.optimise(whole=True)
        self._merge_pairs(self._planes.duplicates(last=True))
        self._drop_doubtful(len(self._keyframes) - 1, last=True)
        self.optimise(extra_iterations=3)

    def _drop_doubtful(self, keyframe: int, last: bool = False) -> None:
        for plane in self._planes.doubtful(keyframe, last):
            observed = self._planes.drop(plane)
            self._graph.forget(observed.keyframe, observed.place)
            self._graph.drop_plane(plane)

    def accept(self, proposals: Proposals) -> None:
        """The rooms and walls that the graph holds from now on; the next keyframe, or ``finish``,
        solves with them."""
        if self._config.layers == "planes":
            return
        rooms = self._rooms.of(proposals.rooms)
        with_walls = self._config.layers == "rooms+walls"
        walls = self._walls.of(proposals.walls) if with_walls else {}
        self._graph.set_concepts(rooms, walls)
        relations = self._config.relations
        if relations is not None and relations.merging:
            self._merge_pairs(one_in_a_room(rooms.values(), self._planes, relations.apart))
        if self._relations is not None:
            self._relate(self._relations, rooms, walls)

    def _room_node(self, room: RoomProposal) -> RoomNode | None:
        return room_node(room, self._planes, self._estimates.normals)

    def _wall_node(self, wall: WallProposal) -> WallNode | None:
        return wall_node(wall, self._planes)

    def _relate(
        self, relations: Relations, rooms: dict[int, RoomNode], walls: dict[int, WallNode]
    ) -> None:
        """Makes the graph hold what rooms and walls say about planes."""
        estimates = self._estimates
        bounded = [[p for p in room.planes if estimates.alive[p]] for room in rooms.values()]
        held = [(w.planes, w.centre) for w in walls.values() if estimates.alive[[*w.planes]].all()]
        found = relations.of(bounded, held, estimates.normals, estimates.offsets)
        self._graph.set_relations(found, relations.config)

    def optimise(self, extra_iterations: int = 0, whole: bool = False) -> None:
        """Solves the graph and brings poses, planes and the map's points up to date.

        Raises RunError when it cannot be solved; from then on the last good estimate is kept.
        """
        if self._failed:
            return
        try:
            self._graph.optimise(extra_iterations, whole)
        except RunError:
            self._failed = True
            raise
        self._planes.refresh()
        poses = self._estimates.poses
        self._T_map_track = poses[-1] @ inverse(self._keyframes[-1].T_track_base)

    # --- answers ---

    def view(self) -> MapView:
        """The map as estimated now."""
        return MapView(self._path.stamp, self._planes.views(), self.keyframes())

    def dense_view(self) -> MapView:
        """The same with every point that was kept of the planes, for the map that is written."""
        return MapView(self._path.stamp, self._planes.dense(), self.keyframes())

    def keyframes(self) -> Sequence[Keyframe]:
        """All keyframes with their poses as estimated now."""
        return Keyframes(self._keyframes, self._estimates.poses.copy(), self._storeys)

    @property
    def plane_count(self) -> int:
        """How many planes there are in the map."""
        return len(self._planes)

    def latest(self) -> Array:
        """T_map_base (4, 4) of the last scan as it was known when the scan had been processed."""
        return self._path.latest()

    def stamps(self) -> Array:
        """(N,) the end of every sweep [s]."""
        return self._path.stamps()

    def odometry(self) -> Array:
        """(N, 4, 4) T_map_base of every scan by the odometry alone (map = odom at the start)."""
        return self._path.odometry()

    def online(self) -> Array:
        """(N, 4, 4) T_map_base of every scan as it was known when the scan had been processed."""
        return self._path.online()

    def trajectory(self) -> Array:
        """(N, 4, 4) T_map_base of every scan as estimated now."""
        return self._path.trajectory(self._estimates.poses)

    def graph(self) -> LayeredGraph:
        """The factor graph itself: how sure it is, and how well its factors fit. What it holds of
        rooms and walls is the last word that was accepted."""
        return self._graph
