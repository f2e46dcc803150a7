"""The layered factor graph in gtsam's ISAM2: keyframes, planes, walls, rooms and the floor."""

from __future__ import annotations

from collections.abc import Hashable, Iterable, Sequence
from dataclasses import dataclass

import gtsam
import numpy as np

from slam.charts import Chart
from slam.core import Array, PlaneObservation, RunError, plane_axes
from slam.estimates import Estimates
from slam.factors import (
    PlaneKey,
    keyframe_plane_factor,
    parallel_factor,
    perpendicular_factor,
    room_factor,
    thickness_factor,
    wall_factor,
)
from slam.loops import Loop
from slam.relations import Relation, RelationConfig

KEYFRAME, PLANE, WALL, ROOM, FLOOR, THICKNESS = "x", "p", "w", "r", "f", "t"


@dataclass(frozen=True)
class GraphConfig:
    """Standard deviations in metres and radians.

    odometry_*: of KISS-ICP per keyframe step of about half a metre; the level directions drift less
    than height and tilt, which 16 beams hardly see. anchor_*: the first keyframe defines the map.
    room_sigma, wall_sigma, floor_sigma: of the published concept factors, whose information the
    paper's code sets by hand (0.1, 10 and 1e-4). recent: keyframes whose estimates are read after
    every update; shift [m]: change of the oldest of them that has everything read; share: of the
    keyframes, after which everything is read anyway. batch: the solver's bookkeeping takes time in
    proportion to the map, so beyond this many variables it is asked every second keyframe, beyond
    twice as many every third: what a keyframe costs on average stays the same.
    """

    odometry_rotation: tuple[float, float, float] = (0.012, 0.012, 0.012)
    odometry_translation: tuple[float, float, float] = (0.035, 0.035, 0.035)
    anchor_sigma: float = 1e-4
    relinearize: float = 0.005
    room_sigma: float = 3.16
    wall_sigma: float = 0.316
    floor_sigma: float = 100.0
    recent: int = 12
    shift: float = 0.01
    share: float = 0.1
    batch: int = 500


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
    """Adds, replaces and removes nodes of all layers; ``optimise`` brings ``estimates`` up to date.

    After an update only what is near is read back, at a cost that does not grow with the map; the
    rest follows when it may have moved.
    """

    def __init__(self, config: GraphConfig = GraphConfig()):
        parameters = gtsam.ISAM2Params()
        parameters.setRelinearizeThreshold(config.relinearize)
        parameters.relinearizeSkip = 1
        parameters.setFactorization("QR")
        self._config = config
        self._isam = gtsam.ISAM2(parameters)
        self._pending: list[tuple[Hashable, gtsam.NonlinearFactor]] = []
        self._values = gtsam.Values()
        self._removals: list[int] = []
        self._index: dict[Hashable, int] = {}
        self._concepts: dict[str, dict[int, RoomNode | WallNode]] = {ROOM: {}, WALL: {}}
        self._variables: dict[tuple[str, int], int] = {}
        self._next_variable = 0
        self._relations: set[Relation] = set()
        self._touched: set[int] = set()
        self._recent: list[set[int]] = []
        self._read_at = 0
        self._waiting = 0
        self.estimates = Estimates()

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
        self._recent = [*self._recent[1 - self._config.recent :], set()]
        self.estimates.add_keyframe(T_map_base)

    def _odometry(self) -> gtsam.noiseModel.Base:
        config = self._config
        sigmas = np.array([*config.odometry_rotation, *config.odometry_translation])
        return gtsam.noiseModel.Diagonal.Sigmas(sigmas)

    def add_plane(self, normal: Array, d: float, place: Array) -> int:
        """A new plane near a place (3,), map frame; its id. It needs an observation before the next
        ``optimise``. Raises InputError for a plane without a direction."""
        foot = place - (normal @ place + d) * normal
        plane = self.estimates.add_plane(Chart.at(foot, normal))
        self._values.insert(gtsam.symbol(PLANE, plane), np.zeros(3))
        return plane

    def _plane(self, plane: int) -> PlaneKey:
        self._touched.add(plane)
        return gtsam.symbol(PLANE, plane), self.estimates.chart(plane)

    def observe(self, keyframe: int, plane: int, observation: PlaneObservation, place: int) -> None:
        """Observation number ``place`` of a keyframe is of ``plane``."""
        key = gtsam.symbol(KEYFRAME, keyframe)
        factor = keyframe_plane_factor(key, self._plane(plane), observation)
        self._pending.append((("plane", keyframe, place), factor))

    def reassign(
        self, keyframe: int, plane: int, observation: PlaneObservation, place: int
    ) -> None:
        """The observation is of another plane than was thought."""
        self._remove(("plane", keyframe, place))
        self.observe(keyframe, plane, observation, place)

    def forget(self, keyframe: int, place: int) -> None:
        """The observation is of nothing."""
        self._remove(("plane", keyframe, place))

    def _remove(self, name: Hashable) -> None:
        """Takes a factor out, whether the solver has it already or not."""
        if name in self._index:
            self._removals.append(self._index.pop(name))
        else:
            self._pending = [(other, factor) for other, factor in self._pending if other != name]

    def close_loop(self, loop: Loop, rotation: float, translation: float) -> None:
        """A later keyframe was found to be where an earlier one was. rotation [rad], translation
        [m]: standard deviations; a closure that nothing else agrees with counts little (Cauchy)."""
        sigmas = np.array([rotation] * 3 + [translation] * 3)
        noise = _cauchy(gtsam.noiseModel.Diagonal.Sigmas(sigmas))
        earlier, later = (gtsam.symbol(KEYFRAME, k) for k in (loop.earlier, loop.later))
        T = gtsam.Pose3(loop.T_earlier_later)
        factor = gtsam.BetweenFactorPose3(earlier, later, T, noise)
        self._pending.append((("loop", loop.earlier, loop.later), factor))

    # --- concepts ---

    def set_concepts(self, rooms: dict[int, RoomNode], walls: dict[int, WallNode]) -> None:
        """Makes the graph hold exactly these rooms and walls: adds, rewires and removes."""
        self._replace(ROOM, dict(rooms))
        self._replace(WALL, dict(walls))

    def forget_concepts_of(self, planes: set[int]) -> None:
        """Removes the rooms and walls that rest on any of these planes."""
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
                self._remove((layer, name))
            self._add_concept(layer, name, node, known)

    def _remove_concept(self, layer: str, name: int) -> None:
        self._remove((layer, name))
        if layer == ROOM:
            self._remove((FLOOR, name))
        key = self._variables.pop((layer, name))
        if self._values.exists(key):
            self._values.erase(key)
        del self._concepts[layer][name]

    def _add_concept(self, layer: str, name: int, node: RoomNode | WallNode, known: bool) -> None:
        if not known:  # a new variable: one that is given up stays in the solver until its update
            self._variables[layer, name] = gtsam.symbol(layer, self._next_variable)
            self._next_variable += 1
        key = self._variables[layer, name]
        planes = [self._plane(plane) for plane in node.planes]
        if isinstance(node, RoomNode):
            noise = gtsam.noiseModel.Isotropic.Sigma(2, self._config.room_sigma)
            factor = room_factor(key, planes, node.pairs, node.centre, noise)
            if not known:
                self._values.insert(key, node.centre[:2])
                self._join_floor(name, key, node.centre)
        else:
            noise = gtsam.noiseModel.Isotropic.Sigma(3, self._config.wall_sigma)
            factor = wall_factor(key, planes, node.centre, noise)
            if not known:
                self._values.insert(key, node.centre)
        self._pending.append(((layer, name), factor))
        self._concepts[layer][name] = node

    def _join_floor(self, room: int, key: int, centre: Array) -> None:
        """The floor node is tied to its rooms by their relative position when found (S-Graphs+)."""
        floor_key = gtsam.symbol(FLOOR, 0)
        floor = self.floor()
        if floor is None:
            floor = centre[:2]
            self._values.insert(floor_key, floor)
            weak = gtsam.noiseModel.Isotropic.Sigma(2, self._config.floor_sigma)
            self._pending.append((("floor", 0), gtsam.PriorFactorPoint2(floor_key, floor, weak)))
        noise = gtsam.noiseModel.Isotropic.Sigma(2, self._config.floor_sigma)
        factor = gtsam.BetweenFactorPoint2(floor_key, key, centre[:2] - floor, noise)
        self._pending.append(((FLOOR, room), factor))

    # --- relations ---

    def set_relations(self, relations: Iterable[Relation], config: RelationConfig) -> None:
        """Makes the graph hold exactly these relations between planes."""
        wanted = set(relations)
        for relation in self._relations - wanted:
            self._remove(relation)
        for relation in sorted(wanted - self._relations, key=lambda r: (r.kind, r.planes)):
            self._pending.append((relation, self._relation_factor(relation, config)))
        self._relations = wanted

    @property
    def relations(self) -> frozenset[Relation]:
        """The relations that the graph holds."""
        return frozenset(self._relations)

    def _forget_relations_of(self, plane: int) -> None:
        gone = {relation for relation in self._relations if plane in relation.planes}
        for relation in gone:
            self._remove(relation)
        self._relations -= gone

    def _relation_factor(self, relation: Relation, config: RelationConfig) -> gtsam.NonlinearFactor:
        first, second = (self._plane(plane) for plane in relation.planes)
        if relation.kind == "thickness":
            key = gtsam.symbol(THICKNESS, relation.group)
            if not (self._isam.valueExists(key) or self._values.exists(key)):
                self._values.insert(key, relation.value)
            noise = _robust(1, config.spread)
            return thickness_factor(first, second, key, relation.point, noise)
        if relation.kind == "perpendicular":
            return perpendicular_factor(first, second, _robust(1, config.angle))
        n1, n2 = (self.estimates.normals[plane] for plane in relation.planes)
        axes, same = np.stack(plane_axes(n1)), bool(n1 @ n2 > 0.0)
        return parallel_factor(first, second, axes, same, _robust(2, config.angle))

    # --- estimates ---

    def optimise(self, extra_iterations: int = 0, whole: bool = False) -> None:
        """Takes in everything that is pending, now or, in a large map, with the next keyframes.

        Reads the estimates of what is near, or of the ``whole`` map. Raises RunError when gtsam
        cannot solve it; the estimates stay those of the last success.
        """
        whole = whole or extra_iterations > 0
        self._waiting += 1
        variables = self.estimates.keyframe_count + self.estimates.plane_count
        if not whole and self._waiting <= variables // self._config.batch:
            return
        self._waiting = 0
        factors = gtsam.NonlinearFactorGraph()
        for _, factor in self._pending:
            factors.add(factor)
        try:
            result = self._isam.update(factors, self._values, self._removals)
            for _ in range(extra_iterations):
                self._isam.update()
            self._read(whole)
        except (RuntimeError, IndexError) as error:
            reason = str(error).strip().splitlines()[0]
            raise RunError(f"the graph could not be optimised: {reason}") from error
        for (name, _), index in zip(self._pending, result.getNewFactorsIndices(), strict=True):
            self._index[name] = int(index)
        self._pending, self._removals = [], []
        self._values = gtsam.Values()

    def _read(self, whole: bool) -> None:
        """Brings the estimates up to date, at least those of what is near."""
        if self._recent:
            self._recent[-1] |= self._touched
        self._touched = set()
        count = self.estimates.keyframe_count
        first = max(0, count - self._config.recent)
        if whole or count - self._read_at >= max(10.0, self._config.share * count):
            self._read_all()
            return
        before = self.estimates.poses[first, :3, 3].copy()
        for keyframe in range(first, count):
            pose = self._isam.calculateEstimatePose3(gtsam.symbol(KEYFRAME, keyframe))
            self.estimates.poses[keyframe] = pose.matrix()
        for plane in set().union(*self._recent):
            if self.estimates.alive[plane]:
                x = self._isam.calculateEstimatePoint3(gtsam.symbol(PLANE, plane))
                self.estimates.set_plane(plane, x)
        after = self.estimates.poses[first, :3, 3]
        if float(np.abs(after - before).max(initial=0.0)) > self._config.shift:
            self._read_all()

    def _read_all(self) -> None:
        values = self._isam.calculateEstimate()
        rows = gtsam.utilities.extractPose3(values)
        rotations = rows[:, :9].reshape(-1, 3, 3)
        if not np.isfinite(rows).all():
            raise RuntimeError("an estimate is not finite")
        self.estimates.poses[:, :3, :3] = rotations
        self.estimates.poses[:, :3, 3] = rows[:, 9:]
        for plane in np.flatnonzero(self.estimates.alive):
            self.estimates.set_plane(int(plane), values.atPoint3(gtsam.symbol(PLANE, int(plane))))
        self._read_at = self.estimates.keyframe_count

    def drop_plane(self, plane: int) -> None:
        """A plane whose observations have all been removed or reassigned, and the rooms and walls
        that rest on it."""
        self.forget_concepts_of({plane})
        self._forget_relations_of(plane)
        self.estimates.alive[plane] = False
        key = gtsam.symbol(PLANE, plane)
        if self._values.exists(key):
            self._values.erase(key)

    def floor(self) -> Array | None:
        """The floor node's place (2,), once there is a room."""
        key = gtsam.symbol(FLOOR, 0)
        if self._values.exists(key):
            return np.array(self._values.atPoint2(key))
        if self._isam.valueExists(key):
            return np.array(self._isam.calculateEstimatePoint2(key))
        return None

    def concept_planes(self, layer: str) -> dict[int, Sequence[int]]:
        """Plane ids of each room or wall in the graph."""
        return {name: node.planes for name, node in self._concepts[layer].items()}

    def variable_count(self) -> int:
        """How many variables the solver holds."""
        return int(self._isam.getLinearizationPoint().size())


def _robust(size: int, sigma: float) -> gtsam.noiseModel.Base:
    return _cauchy(gtsam.noiseModel.Isotropic.Sigma(size, sigma))


def _cauchy(noise: gtsam.noiseModel.Base) -> gtsam.noiseModel.Base:
    """Residuals beyond a standard deviation count less and less."""
    return gtsam.noiseModel.Robust.Create(gtsam.noiseModel.mEstimator.Cauchy.Create(1.0), noise)
