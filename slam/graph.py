"""The layered factor graph in gtsam's ISAM2: keyframes, planes, walls, rooms and the floor."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import gtsam
import numpy as np

from slam.core import Array, InputError, PlaneObservation, RunError
from slam.factors import keyframe_plane_factor, room_factor, wall_factor

KEYFRAME, PLANE, WALL, ROOM, FLOOR = "x", "p", "w", "r", "f"


@dataclass(frozen=True)
class GraphConfig:
    """Standard deviations in metres and radians.

    odometry_*: of KISS-ICP per keyframe step of about half a metre; the level directions drift less
    than height and tilt, which 16 beams hardly see. anchor_*: the first keyframe defines the map.
    room_sigma, wall_sigma, floor_sigma: of the published concept factors, whose information the
    paper's code sets by hand (0.1, 10 and 1e-4).
    """

    odometry_rotation: tuple[float, float, float] = (0.012, 0.012, 0.012)
    odometry_translation: tuple[float, float, float] = (0.035, 0.035, 0.035)
    anchor_sigma: float = 1e-4
    relinearize: float = 0.005
    room_sigma: float = 3.16
    wall_sigma: float = 0.316
    floor_sigma: float = 100.0


@dataclass(frozen=True)
class RoomNode:
    """A room to enter the graph: plane ids, the opposed pairs among them, and its centre (3,)."""

    planes: tuple[int, ...]
    pairs: tuple[tuple[int, int], ...]
    centre: Array


@dataclass(frozen=True)
class WallNode:
    """A wall to enter the graph: its two plane ids and its middle (3,)."""

    planes: tuple[int, int]
    centre: Array


class LayeredGraph:
    """Adds, replaces and removes nodes of all layers; estimates are refreshed by ``optimise``."""

    def __init__(self, config: GraphConfig = GraphConfig()):
        parameters = gtsam.ISAM2Params()
        parameters.setRelinearizeThreshold(config.relinearize)
        parameters.relinearizeSkip = 1
        self._config = config
        self._isam = gtsam.ISAM2(parameters)
        self._pending: list[tuple[object, gtsam.NonlinearFactor]] = []
        self._values = gtsam.Values()
        self._removals: list[int] = []
        self._index: dict[object, int] = {}
        self._concepts: dict[str, dict[int, RoomNode | WallNode]] = {ROOM: {}, WALL: {}}
        self.estimate = gtsam.Values()

    # --- keyframes and planes ---

    def add_keyframe(self, keyframe: int, T_map_base: Array, T_previous: Array | None) -> None:
        """A keyframe at ``T_map_base``. T_previous: from the last one by odometry (first: None)."""
        key = gtsam.symbol(KEYFRAME, keyframe)
        self._values.insert(key, gtsam.Pose3(T_map_base))
        if T_previous is None:
            noise = gtsam.noiseModel.Isotropic.Sigma(6, self._config.anchor_sigma)
            factor: gtsam.NonlinearFactor = gtsam.PriorFactorPose3(
                key, gtsam.Pose3(T_map_base), noise
            )
        else:
            factor = gtsam.BetweenFactorPose3(
                gtsam.symbol(KEYFRAME, keyframe - 1), key, gtsam.Pose3(T_previous), self._odometry()
            )
        self._pending.append((("odometry", keyframe), factor))

    def _odometry(self) -> gtsam.noiseModel.Base:
        config = self._config
        sigmas = np.array([*config.odometry_rotation, *config.odometry_translation])
        return gtsam.noiseModel.Diagonal.Sigmas(sigmas)

    def add_plane(self, plane: int, normal: Array, d: float) -> None:
        """A new plane variable, map frame. It needs an observation before the next ``optimise``."""
        coefficients = np.append(normal, d)
        if not np.isfinite(coefficients).all() or abs(np.linalg.norm(normal) - 1.0) > 1e-6:
            raise InputError(f"plane {plane}: a unit normal and a finite distance are needed")
        self._values.insert(gtsam.symbol(PLANE, plane), gtsam.OrientedPlane3(coefficients))

    def observe(self, keyframe: int, plane: int, observation: PlaneObservation, place: int) -> None:
        """Observation number ``place`` of a keyframe is of ``plane``."""
        factor = keyframe_plane_factor(
            gtsam.symbol(KEYFRAME, keyframe), gtsam.symbol(PLANE, plane), observation
        )
        self._pending.append((("plane", keyframe, place), factor))

    def reassign(
        self, keyframe: int, plane: int, observation: PlaneObservation, place: int
    ) -> None:
        """The observation is of another plane than was thought."""
        self._removals.append(self._index.pop(("plane", keyframe, place)))
        self.observe(keyframe, plane, observation, place)

    # --- concepts ---

    def set_concepts(self, rooms: dict[int, RoomNode], walls: dict[int, WallNode]) -> None:
        """Makes the graph hold exactly these rooms and walls: adds, rewires and removes."""
        self._replace(ROOM, dict(rooms))
        self._replace(WALL, dict(walls))

    def forget_concepts_of(self, planes: set[int]) -> None:
        """Removes rooms and walls that rest on any of these planes."""
        for layer, held in self._concepts.items():
            for name in [name for name, node in held.items() if planes & set(node.planes)]:
                self._remove_concept(layer, name)

    def _replace(self, layer: str, nodes: dict[int, RoomNode | WallNode]) -> None:
        held = self._concepts[layer]
        for name in [name for name in held if name not in nodes]:
            self._remove_concept(layer, name)
        for name, node in nodes.items():
            if name in held and held[name].planes == node.planes:
                continue
            known = name in held
            if known:
                self._removals.append(self._index.pop((layer, name)))
            self._add_concept(layer, name, node, known)

    def _remove_concept(self, layer: str, name: int) -> None:
        self._removals.append(self._index.pop((layer, name)))
        if layer == ROOM:
            self._removals.append(self._index.pop((FLOOR, name)))
        del self._concepts[layer][name]

    def _add_concept(self, layer: str, name: int, node: RoomNode | WallNode, known: bool) -> None:
        key = gtsam.symbol(layer, name)
        plane_keys = [gtsam.symbol(PLANE, plane) for plane in node.planes]
        if isinstance(node, RoomNode):
            noise = gtsam.noiseModel.Isotropic.Sigma(2, self._config.room_sigma)
            factor = room_factor(key, plane_keys, node.pairs, node.centre, noise)
            if not known:
                self._values.insert(key, node.centre[:2])
                self._join_floor(name, key, node.centre)
        else:
            noise = gtsam.noiseModel.Isotropic.Sigma(3, self._config.wall_sigma)
            factor = wall_factor(key, plane_keys, node.centre, noise)
            if not known:
                self._values.insert(key, node.centre)
        self._pending.append(((layer, name), factor))
        self._concepts[layer][name] = node

    def _join_floor(self, room: int, key: int, centre: Array) -> None:
        """The floor node is tied to its rooms by their relative position when found (S-Graphs+)."""
        floor_key = gtsam.symbol(FLOOR, 0)
        if not self.estimate.exists(floor_key) and not self._values.exists(floor_key):
            self._values.insert(floor_key, centre[:2])
            weak = gtsam.noiseModel.Isotropic.Sigma(2, self._config.floor_sigma)
            self._pending.append(
                (("floor", 0), gtsam.PriorFactorPoint2(floor_key, centre[:2], weak))
            )
            floor = centre[:2]
        elif self._values.exists(floor_key):
            floor = self._values.atPoint2(floor_key)
        else:
            floor = self.estimate.atPoint2(floor_key)
        noise = gtsam.noiseModel.Isotropic.Sigma(2, self._config.floor_sigma)
        factor = gtsam.BetweenFactorPoint2(floor_key, key, centre[:2] - floor, noise)
        self._pending.append(((FLOOR, room), factor))

    # --- estimates ---

    def optimise(self, extra_iterations: int = 0) -> None:
        """Takes in everything that is pending. Raises RunError when gtsam cannot solve it."""
        factors = gtsam.NonlinearFactorGraph()
        for _, factor in self._pending:
            factors.add(factor)
        try:
            result = self._isam.update(factors, self._values, self._removals)
            for (name, _), index in zip(self._pending, result.getNewFactorsIndices(), strict=True):
                self._index[name] = int(index)
            for _ in range(extra_iterations):
                self._isam.update()
            self.estimate = self._isam.calculateEstimate()
        except (RuntimeError, IndexError) as error:
            reason = str(error).strip().splitlines()[0]
            raise RunError(f"the graph could not be optimised: {reason}") from error
        self._pending, self._removals = [], []
        self._values = gtsam.Values()

    def keyframe(self, keyframe: int) -> Array:
        """T_map_base (4, 4) as estimated now."""
        return self.estimate.atPose3(gtsam.symbol(KEYFRAME, keyframe)).matrix()

    def plane(self, plane: int) -> tuple[Array, float]:
        """Normal (3,) and d of a plane as estimated now."""
        coefficients = self.estimate.atOrientedPlane3(
            gtsam.symbol(PLANE, plane)
        ).planeCoefficients()
        return coefficients[:3], float(coefficients[3])

    def floor(self) -> Array | None:
        """The floor node's place (2,), once there is a room."""
        key = gtsam.symbol(FLOOR, 0)
        return self.estimate.atPoint2(key) if self.estimate.exists(key) else None

    def concept_planes(self, layer: str) -> dict[int, Sequence[int]]:
        """Plane ids of each room or wall in the graph."""
        return {name: node.planes for name, node in self._concepts[layer].items()}
