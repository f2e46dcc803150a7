"""The layered factor graph in gtsam's ISAM2: keyframes, planes, walls, rooms and the floor."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field
from functools import partial

import gtsam
import numpy as np

from slam.charts import Chart
from slam.chisquares import ChiSquare, chi_squares
from slam.concepts import ConceptConfig, Concepts, RoomNode, WallNode
from slam.core import Array, PlaneObservation, plane_axes
from slam.estimates import Estimates
from slam.factors import (
    PlaneKey,
    parallel_factor,
    perpendicular_factor,
    plumb_factor,
    thickness_factor,
)
from slam.linearised import Robust
from slam.loops import Loop
from slam.optimiser import Optimiser, OptimiserConfig
from slam.relations import Relation, RelationConfig
from slam.variables import THICKNESS, keyframe_key, plane_key


@dataclass(frozen=True)
class GraphConfig:
    """Standard deviations in metres and radians.

    odometry_*: of the step from one keyframe to the next, as the front end has it: the odometry's
    refined against the planes seen lately; however long the step is (0.4 m, more where keyframes
    between them were not kept). anchor_sigma: of the first keyframe, which defines the map. plumb:
    of the direction of plumb walls, however many a sweep sees. recent: keyframes whose estimates
    are read after every update; shift [m]: change of the oldest of them that has everything read;
    share: of the keyframes, after which everything is read anyway.
    """

    odometry_rotation: tuple[float, float, float] = (0.012, 0.012, 0.012)
    odometry_translation: tuple[float, float, float] = (0.035, 0.035, 0.035)
    anchor_sigma: float = 1e-4
    plumb: float = np.radians(0.3)
    recent: int = 12
    shift: float = 0.01
    share: float = 0.1
    concepts: ConceptConfig = field(default_factory=ConceptConfig)
    optimiser: OptimiserConfig = field(default_factory=OptimiserConfig)


class LayeredGraph:
    """Adds, replaces and removes nodes of all layers; ``optimise`` brings ``estimates`` up to date.

    After an update only what is near is read back, at a cost that does not grow with the map; the
    rest follows when it may have moved.
    """

    def __init__(self, config: GraphConfig = GraphConfig()):
        self._config = config
        self.estimates = Estimates()
        self._optimiser = Optimiser(self.estimates, config.optimiser)
        self._factors = self._optimiser.factors
        self._concepts = Concepts(self._optimiser, self._plane, config.concepts)
        self._relations: set[Relation] = set()
        self._touched: set[int] = set()
        self._recent: list[set[int]] = []
        self._read_at = 0

    # --- keyframes and planes ---

    def add_keyframe(self, keyframe: int, T_map_base: Array, T_previous_base: Array | None) -> None:
        """A keyframe at ``T_map_base``. T_previous_base: from the base at the last keyframe, as the
        front end tracked it (first: None)."""
        self.estimates.add_keyframe(T_map_base)
        self._optimiser.add_keyframe(keyframe)
        key = keyframe_key(keyframe)
        if T_previous_base is None:
            noise = gtsam.noiseModel.Isotropic.Sigma(6, self._config.anchor_sigma)
            factor: gtsam.NonlinearFactor = gtsam.PriorFactorPose3(
                key, gtsam.Pose3(T_map_base), noise
            )
        else:
            factor = gtsam.BetweenFactorPose3(
                keyframe_key(keyframe - 1), key, gtsam.Pose3(T_previous_base), self._odometry()
            )
        self._factors.add(("odometry", keyframe), factor)
        self._recent = [*self._recent[1 - self._config.recent :], set()]

    def _odometry(self) -> gtsam.noiseModel.Base:
        config = self._config
        sigmas = np.array([*config.odometry_rotation, *config.odometry_translation])
        return gtsam.noiseModel.Diagonal.Sigmas(sigmas)

    def set_upright(self, keyframe: int, plumb: Array, up: Array) -> None:
        """A keyframe saw which way walls are plumb, (3,) in its frame; up: that in the map."""
        build = partial(plumb_factor, keyframe_key(keyframe), plumb, up)
        loss = gtsam.noiseModel.mEstimator.Huber.Create(self._config.optimiser.robust)
        sigmas = np.full(2, self._config.plumb)
        robust = Robust([keyframe_key(keyframe)], build, sigmas, loss)
        self._factors.add(("plumb", keyframe), robust)

    def add_plane(self, normal: Array, d: float, place: Array) -> int:
        """A new plane near a place (3,), map frame; its id. It needs an observation before the next
        ``optimise``. Raises InputError for a plane without a direction."""
        foot = place - (normal @ place + d) * normal
        plane = self.estimates.add_plane(Chart.at(foot, normal))
        self._optimiser.add_plane(plane)
        return plane

    def _plane(self, plane: int) -> PlaneKey:
        """One that is worth reading after the next update."""
        self._touched.add(plane)
        return plane_key(plane), self.estimates.chart(plane)

    def observe(self, keyframe: int, plane: int, observation: PlaneObservation, place: int) -> None:
        """Observation number ``place`` of a keyframe is of a plane, whatever was thought."""
        self._touched.add(plane)
        self._optimiser.sightings.observe(keyframe, plane, observation, place)

    def forget(self, keyframe: int, place: int) -> None:
        """The observation is of nothing."""
        self._optimiser.sightings.forget(keyframe, place)

    def close_loop(self, loop: Loop, rotation: float, translation: float) -> None:
        """A later keyframe was found to be where an earlier one was. rotation [rad], translation
        [m]: standard deviations; a closure that nothing else agrees with counts little (Cauchy)."""
        earlier, later = (keyframe_key(k) for k in (loop.earlier, loop.later))
        T = gtsam.Pose3(loop.T_earlier_later)
        build = partial(gtsam.BetweenFactorPose3, earlier, later, T)
        sigmas = np.array([rotation] * 3 + [translation] * 3)
        robust = Robust([earlier, later], build, sigmas, _cauchy())
        self._factors.add(("loop", loop.earlier, loop.later), robust)

    # --- rooms and walls ---

    def set_concepts(self, rooms: dict[int, RoomNode], walls: dict[int, WallNode]) -> None:
        """Makes the graph hold exactly these rooms and walls: adds, rewires and removes."""
        self._concepts.hold(rooms, walls)

    # --- relations ---

    def set_relations(self, relations: Iterable[Relation], config: RelationConfig) -> None:
        """Makes the graph hold exactly these relations between planes."""
        wanted = set(relations)
        for relation in self._relations - wanted:
            self._factors.remove(relation)
        for relation in sorted(wanted - self._relations, key=lambda r: (r.kind, r.planes)):
            self._factors.add(relation, self._relation_factor(relation, config))
        self._relations = wanted

    def _forget_relations_of(self, plane: int) -> None:
        gone = {relation for relation in self._relations if plane in relation.planes}
        for relation in gone:
            self._factors.remove(relation)
        self._relations -= gone

    def _relation_factor(self, relation: Relation, config: RelationConfig) -> Robust:
        first, second = (self._plane(plane) for plane in relation.planes)
        keys = [first[0], second[0]]
        if relation.kind == "thickness":
            key = gtsam.symbol(THICKNESS, relation.group)
            if not self._optimiser.solver.holds(key):
                self._optimiser.insert(key, relation.value)
            build = partial(thickness_factor, first, second, key, relation.point)
            return Robust([*keys, key], build, np.full(1, config.spread), _cauchy())
        if relation.kind == "perpendicular":
            build = partial(perpendicular_factor, first, second)
            return Robust(keys, build, np.full(1, config.angle), _cauchy())
        n1, n2 = (self.estimates.normals[plane] for plane in relation.planes)
        axes, same = np.stack(plane_axes(n1)), bool(n1 @ n2 > 0.0)
        build = partial(parallel_factor, first, second, axes, same)
        return Robust(keys, build, np.full(2, config.angle), _cauchy())

    # --- estimates ---

    def optimise(self, extra_iterations: int = 0, whole: bool = False) -> None:
        """Takes in everything that is pending.

        Reads the estimates of what is near, or of the ``whole`` map. Raises RunError when gtsam
        cannot solve it; the estimates stay those of the last success.
        """
        self._optimiser.update()
        self._read(whole or extra_iterations > 0)
        for _ in range(extra_iterations):
            self._optimiser.update()
            self._read(True)

    def _read(self, whole: bool) -> None:
        """Brings the estimates up to date, at least those of what is near."""
        if self._recent:
            self._recent[-1] |= self._touched
        self._touched = set()
        count = self.estimates.keyframe_count
        first = max(0, count - self._config.recent)
        moved = np.inf
        if not whole and count - self._read_at < max(10.0, self._config.share * count):
            near = np.array(sorted(set().union(*self._recent)), dtype=np.int64)
            before = self.estimates.poses[first, :3, 3].copy()
            self._optimiser.read(np.arange(first, count), near[self.estimates.alive[near]])
            moved = float(np.abs(self.estimates.poses[first, :3, 3] - before).max())
        if moved > self._config.shift:
            self._optimiser.read_all()
            self._read_at = count

    def drop_plane(self, plane: int) -> None:
        """A plane whose observations have all been removed or reassigned, and the rooms and walls
        that rest on it."""
        self._concepts.forget_those_of({plane})
        self._forget_relations_of(plane)
        self.estimates.alive[plane] = False
        self._optimiser.withdraw(plane_key(plane))

    # --- how sure it is ---

    def keyframe_covariance(self, keyframe: int) -> Array:
        """(6, 6) of a keyframe's pose, turn [rad] then shift [m], in its own axes."""
        return self._optimiser.solver.covariance(keyframe_key(keyframe))

    def plane_covariance(self, plane: int) -> Array:
        """(3, 3) of a plane's coordinates in its chart."""
        return self._optimiser.solver.covariance(plane_key(plane))

    def chi_squares(self) -> dict[str, ChiSquare]:
        """By type of factor, at the last estimate."""
        return chi_squares(self._optimiser.solver.squares())


def _cauchy() -> gtsam.noiseModel.mEstimator.Cauchy:
    """Residuals beyond a standard deviation count less and less."""
    return gtsam.noiseModel.mEstimator.Cauchy.Create(1.0)
