"""The layered factor graph in gtsam's ISAM2: keyframes, planes, walls, rooms and the floor."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from typing import cast

import gtsam
import numpy as np

from slam.charts import Chart
from slam.concepts import FLOOR, ROOM, WALL, ConceptConfig, Concepts, RoomNode, WallNode
from slam.core import Array, PlaneObservation, RunError, plane_axes
from slam.estimates import Estimates
from slam.factors import (
    PlaneKey,
    parallel_factor,
    perpendicular_factor,
    plumb_factor,
    thickness_factor,
)
from slam.loops import Loop
from slam.relations import Relation, RelationConfig
from slam.sightings import SIGHTING, Sightings
from slam.solver import Solver, failures

KEYFRAME, PLANE, THICKNESS = "x", "p", "t"


@dataclass(frozen=True)
class GraphConfig:
    """Standard deviations in metres and radians.

    odometry_*: of KISS-ICP per keyframe step of about half a metre; the level directions drift less
    than height and tilt, which 16 beams hardly see. anchor_*: the first keyframe defines the map.
    plumb: of the direction of plumb walls, however many a sweep sees; robust: an observation of a
    plane that is off by more standard deviations counts less (Huber), such as of a sweep whose
    motion was wrong. turned [rad], moved [m]: change of a keyframe or plane from which its factors
    are linearised anew, and robust ones weighed anew, which is why moved is no larger; far [m]: of
    a room, wall or floor, whose factors are all but linear. recent: keyframes whose estimates are
    read after every update; shift [m]: change of the oldest of them that has everything read;
    share: of the keyframes, after which everything is read anyway.
    """

    odometry_rotation: tuple[float, float, float] = (0.012, 0.012, 0.012)
    odometry_translation: tuple[float, float, float] = (0.035, 0.035, 0.035)
    anchor_sigma: float = 1e-4
    plumb: float = np.radians(0.3)
    robust: float = 2.0
    turned: float = 0.005
    moved: float = 0.01
    far: float = 0.05
    recent: int = 12
    shift: float = 0.01
    share: float = 0.1
    concepts: ConceptConfig = field(default_factory=ConceptConfig)


@dataclass(frozen=True)
class ChiSquare:
    """Of all factors of one type: how many residuals, and the sum of their squares, each over its
    variance."""

    residuals: int
    chi2: float


KINDS = {
    "odometry": "odometry",
    SIGHTING: "planes",
    "plumb": "plumb",
    "loop": "loops",
    ROOM: "rooms",
    WALL: "walls",
    FLOOR: "floors",
    "floor": "floors",
}
"""Types of factors, by the first part of their names; relations tell theirs themselves."""


class LayeredGraph:
    """Adds, replaces and removes nodes of all layers; ``optimise`` brings ``estimates`` up to date.

    After an update only what is near is read back, at a cost that does not grow with the map; the
    rest follows when it may have moved.
    """

    def __init__(self, config: GraphConfig = GraphConfig()):
        self._config = config
        self._solver = Solver(_thresholds(config))
        self._concepts = Concepts(self._solver, self._plane, config.concepts)
        self._sightings = Sightings(self._solver, _keyframe_key, self._plane_key, config.robust)
        self._relations: set[Relation] = set()
        self._touched: set[int] = set()
        self._recent: list[set[int]] = []
        self._read_at = 0
        self.estimates = Estimates()

    # --- keyframes and planes ---

    def add_keyframe(self, keyframe: int, T_map_base: Array, T_previous: Array | None) -> None:
        """A keyframe at ``T_map_base``. T_previous: from the last one by odometry (first: None)."""
        key = _keyframe_key(keyframe)
        self._solver.insert(key, gtsam.Pose3(T_map_base))
        if T_previous is None:
            noise = gtsam.noiseModel.Isotropic.Sigma(6, self._config.anchor_sigma)
            factor: gtsam.NonlinearFactor = gtsam.PriorFactorPose3(
                key, gtsam.Pose3(T_map_base), noise
            )
        else:
            factor = gtsam.BetweenFactorPose3(
                _keyframe_key(keyframe - 1), key, gtsam.Pose3(T_previous), self._odometry()
            )
        self._solver.add(("odometry", keyframe), factor)
        self._recent = [*self._recent[1 - self._config.recent :], set()]
        self.estimates.add_keyframe(T_map_base)

    def _odometry(self) -> gtsam.noiseModel.Base:
        config = self._config
        sigmas = np.array([*config.odometry_rotation, *config.odometry_translation])
        return gtsam.noiseModel.Diagonal.Sigmas(sigmas)

    def set_upright(self, keyframe: int, plumb: Array, up: Array) -> None:
        """A keyframe saw which way walls are plumb, (3,) in its frame; up: that in the map."""
        huber = gtsam.noiseModel.mEstimator.Huber.Create(self._config.robust)
        sigma = gtsam.noiseModel.Isotropic.Sigma(2, self._config.plumb)
        noise = gtsam.noiseModel.Robust.Create(huber, sigma)
        factor = plumb_factor(_keyframe_key(keyframe), plumb, up, noise)
        self._solver.add(("plumb", keyframe), factor)

    def add_plane(self, normal: Array, d: float, place: Array) -> int:
        """A new plane near a place (3,), map frame; its id. It needs an observation before the next
        ``optimise``. Raises InputError for a plane without a direction."""
        foot = place - (normal @ place + d) * normal
        plane = self.estimates.add_plane(Chart.at(foot, normal))
        self._solver.insert(gtsam.symbol(PLANE, plane), np.zeros(3))
        return plane

    def _plane(self, plane: int) -> PlaneKey:
        """One that is worth reading after the next update."""
        self._touched.add(plane)
        return self._plane_key(plane)

    def _plane_key(self, plane: int) -> PlaneKey:
        return gtsam.symbol(PLANE, plane), self.estimates.chart(plane)

    def observe(self, keyframe: int, plane: int, observation: PlaneObservation, place: int) -> None:
        """Observation number ``place`` of a keyframe is of a plane, whatever was thought."""
        self._touched.add(plane)
        self._sightings.observe(keyframe, plane, observation, place)

    def forget(self, keyframe: int, place: int) -> None:
        """The observation is of nothing."""
        self._sightings.forget(keyframe, place)

    def close_loop(self, loop: Loop, rotation: float, translation: float) -> None:
        """A later keyframe was found to be where an earlier one was. rotation [rad], translation
        [m]: standard deviations; a closure that nothing else agrees with counts little (Cauchy)."""
        sigmas = np.array([rotation] * 3 + [translation] * 3)
        noise = _cauchy(gtsam.noiseModel.Diagonal.Sigmas(sigmas))
        earlier, later = (_keyframe_key(k) for k in (loop.earlier, loop.later))
        T = gtsam.Pose3(loop.T_earlier_later)
        factor = gtsam.BetweenFactorPose3(earlier, later, T, noise)
        self._solver.add(("loop", loop.earlier, loop.later), factor)

    # --- rooms and walls ---

    def set_concepts(self, rooms: dict[int, RoomNode], walls: dict[int, WallNode]) -> None:
        """Makes the graph hold exactly these rooms and walls: adds, rewires and removes."""
        self._concepts.hold(rooms, walls)

    def concept_planes(self, layer: str) -> dict[int, Sequence[int]]:
        """Plane ids of each room or wall in the graph."""
        return self._concepts.planes(layer)

    def floor(self, storey: int = 0) -> Array | None:
        """The place (2,) of a storey's floor node, once there is a room."""
        return self._concepts.floor(storey)

    # --- relations ---

    def set_relations(self, relations: Iterable[Relation], config: RelationConfig) -> None:
        """Makes the graph hold exactly these relations between planes."""
        wanted = set(relations)
        for relation in self._relations - wanted:
            self._solver.remove(relation)
        for relation in sorted(wanted - self._relations, key=lambda r: (r.kind, r.planes)):
            self._solver.add(relation, self._relation_factor(relation, config))
        self._relations = wanted

    @property
    def relations(self) -> frozenset[Relation]:
        """The relations that the graph holds."""
        return frozenset(self._relations)

    def _forget_relations_of(self, plane: int) -> None:
        gone = {relation for relation in self._relations if plane in relation.planes}
        for relation in gone:
            self._solver.remove(relation)
        self._relations -= gone

    def _relation_factor(self, relation: Relation, config: RelationConfig) -> gtsam.NonlinearFactor:
        first, second = (self._plane(plane) for plane in relation.planes)
        if relation.kind == "thickness":
            key = gtsam.symbol(THICKNESS, relation.group)
            if not self._solver.holds(key):
                self._solver.insert(key, relation.value)
            noise = _robust(1, config.spread)
            return thickness_factor(first, second, key, relation.point, noise)
        if relation.kind == "perpendicular":
            return perpendicular_factor(first, second, _robust(1, config.angle))
        n1, n2 = (self.estimates.normals[plane] for plane in relation.planes)
        axes, same = np.stack(plane_axes(n1)), bool(n1 @ n2 > 0.0)
        return parallel_factor(first, second, axes, same, _robust(2, config.angle))

    # --- estimates ---

    def optimise(self, extra_iterations: int = 0, whole: bool = False) -> None:
        """Takes in everything that is pending.

        Reads the estimates of what is near, or of the ``whole`` map. Raises RunError when gtsam
        cannot solve it; the estimates stay those of the last success.
        """
        self._sightings.settle()
        self._solver.update(extra_iterations)
        with failures():
            self._read(whole or extra_iterations > 0)

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
            self.estimates.poses[keyframe] = self._solver.pose(_keyframe_key(keyframe))
        for plane in set().union(*self._recent):
            if self.estimates.alive[plane]:
                x = self._solver.point3(gtsam.symbol(PLANE, plane))
                self.estimates.set_plane(plane, x)
        after = self.estimates.poses[first, :3, 3]
        if float(np.abs(after - before).max(initial=0.0)) > self._config.shift:
            self._read_all()

    def _read_all(self) -> None:
        values = self._solver.values()
        rows = gtsam.utilities.extractPose3(values)
        rotations = rows[:, :9].reshape(-1, 3, 3)
        if not np.isfinite(rows).all():
            raise RunError("the graph could not be optimised: an estimate is not finite")
        self.estimates.poses[:, :3, :3] = rotations
        self.estimates.poses[:, :3, 3] = rows[:, 9:]
        for plane in np.flatnonzero(self.estimates.alive):
            self.estimates.set_plane(int(plane), values.atPoint3(gtsam.symbol(PLANE, int(plane))))
        self._read_at = self.estimates.keyframe_count

    def drop_plane(self, plane: int) -> None:
        """A plane whose observations have all been removed or reassigned, and the rooms and walls
        that rest on it."""
        self._concepts.forget_those_of({plane})
        self._forget_relations_of(plane)
        self.estimates.alive[plane] = False
        self._solver.withdraw(gtsam.symbol(PLANE, plane))

    # --- how sure it is ---

    def keyframe_covariance(self, keyframe: int) -> Array:
        """(6, 6) of a keyframe's pose, turn [rad] then shift [m], in its own axes."""
        return self._solver.covariance(_keyframe_key(keyframe))

    def plane_covariance(self, plane: int) -> Array:
        """(3, 3) of a plane's coordinates in its chart."""
        return self._solver.covariance(gtsam.symbol(PLANE, plane))

    def chi_squares(self) -> dict[str, ChiSquare]:
        """By type of factor, at the last estimate; what is far off as much as it counts."""
        values = self._solver.values()
        sums: dict[str, list[float]] = {}
        for name, factor in self._solver.factors():
            kind = name.kind if isinstance(name, Relation) else KINDS[cast(tuple, name)[0]]
            total = sums.setdefault(kind, [0, 0.0])
            total[0] += factor.dim()
            total[1] += 2.0 * factor.error(values)
        return {kind: ChiSquare(int(count), chi2) for kind, (count, chi2) in sums.items()}

    def variable_count(self) -> int:
        """How many variables the solver holds."""
        return self._solver.variable_count()


def _keyframe_key(keyframe: int) -> int:
    return int(gtsam.symbol(KEYFRAME, keyframe))


def _thresholds(config: GraphConfig) -> dict[str, list[float]]:
    """Of the coordinates of each kind of variable."""
    turned, moved, far = config.turned, config.moved, config.far
    return {
        KEYFRAME: [turned] * 3 + [moved] * 3,
        PLANE: [turned] * 2 + [moved],
        THICKNESS: [moved],
        WALL: [far] * 3,
        ROOM: [far] * 2,
        FLOOR: [far] * 2,
    }


def _robust(size: int, sigma: float) -> gtsam.noiseModel.Base:
    return _cauchy(gtsam.noiseModel.Isotropic.Sigma(size, sigma))


def _cauchy(noise: gtsam.noiseModel.Base) -> gtsam.noiseModel.Base:
    """Residuals beyond a standard deviation count less and less."""
    return gtsam.noiseModel.Robust.Create(gtsam.noiseModel.mEstimator.Cauchy.Create(1.0), noise)
