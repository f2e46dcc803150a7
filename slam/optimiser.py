"""The nonlinear least squares behind the graph: linearises what has to be, solves, and makes
estimates of the answers."""

from __future__ import annotations

from dataclasses import dataclass

import gtsam
import numpy as np

from slam.core import Array, IntArray, RunError
from slam.estimates import Estimates
from slam.linearised import Linearised
from slam.linearpoint import LinearPoint, Watch
from slam.sightings import Sightings
from slam.solver import Solver, Value, failures
from slam.variables import KEYFRAME, NO_STEP, PLANE, Variables, keyframe_key, plane_key


@dataclass(frozen=True)
class OptimiserConfig:
    """turned [rad], moved [m]: change of a keyframe or plane from which all factors about it are
    linearised anew; robust: what was observed of a plane, or of plumb walls, counts less if it is
    off by more standard deviations (Huber), as in a sweep whose motion was wrong; stale: change of
    the weight of a robust factor from which that is made anew; stirred_turned [rad], stirred_moved
    [m]: change of a keyframe or plane from which the weights of factors about it are looked at.

    None was fitted to anything. What is left out at turned and moved is 0.25 mm: 0.005 rad times
    5 cm, or 0.005 rad twice at 10 m. The others keep the work small; what they leave is set right
    whenever everything is read.
    """

    turned: float = 0.005
    moved: float = 0.05
    robust: float = 2.0
    stale: float = 0.1
    stirred_turned: float = 0.001
    stirred_moved: float = 0.002


class Optimiser:
    """Keyframes and planes as estimated are ``Estimates``, which ``read`` brings up to date after
    an ``update``.

    factors: all but the observations of planes, which are sightings; solver: what they become. What
    is added or removed counts from the next ``update`` on.
    """

    def __init__(self, estimates: Estimates, config: OptimiserConfig):
        self._estimates = estimates
        self._at = LinearPoint(estimates, config.turned, config.moved)
        self._variables = Variables(estimates, self._at)
        self._stirred = Watch(estimates, config.stirred_turned, config.stirred_moved)
        self._scalars: set[int] = set()
        self.solver = Solver()
        self.factors = Linearised(self.solver, self._variables, config.stale)
        self.sightings = Sightings(self.solver, estimates, self._at, config.robust, config.stale)

    def add_keyframe(self, keyframe: int) -> None:
        """One that the estimates have, the next one."""
        self.solver.insert(keyframe_key(keyframe), NO_STEP)

    def add_plane(self, plane: int) -> None:
        """One that the estimates have."""
        self.solver.insert(plane_key(plane), np.zeros(3))

    def insert(self, key: int, value: Value) -> None:
        """Another variable, which all factors are linear in, and where it is thought to be."""
        self.solver.insert(key, value)
        self._variables.set(key, value)
        if isinstance(value, float):
            self._scalars.add(key)

    def withdraw(self, key: int) -> None:
        """A variable that no factor is about is not wanted any more."""
        self.solver.withdraw(key)
        self._variables.drop(key)
        self._scalars.discard(key)

    def update(self) -> None:
        """Solves once, with all that has moved linearised where it is estimated. Raises RunError
        when gtsam cannot solve it."""
        keyframes, planes = self._at.follow()
        self.factors.settle(_keys(keyframes, planes))
        self.sightings.settle(keyframes.tolist(), planes.tolist())
        self.solver.update()

    def read(self, keyframes: IntArray, planes: IntArray) -> None:
        """Estimates of these (N,), (M,), as the last update left them. Raises RunError for what is
        not finite."""
        with failures():
            steps = [self.solver.vector(keyframe_key(each)) for each in keyframes.tolist()]
            x = [self.solver.point3(plane_key(each)) for each in planes.tolist()]
        self._take(keyframes, np.array(steps), planes, np.array(x))
        self.factors.weigh(_keys(*self._stirred.moved(keyframes, planes)))

    def read_all(self) -> None:
        """Estimates of all that is alive. Raises RunError for what is not finite."""
        keyframes = np.arange(self._estimates.keyframe_count)
        planes = np.flatnonzero(self._estimates.alive)
        with failures():
            values = self.solver.values()
            # One that no factor is about any more has left the solver.
            scalars = [key for key in sorted(self._scalars) if values.exists(key)]
            for key in scalars:
                self._variables.set(key, values.atDouble(key))
            steps = gtsam.utilities.extractVectors(values, KEYFRAME)
            x = gtsam.utilities.extractVectors(values, PLANE)
        if len(steps) != len(keyframes) or len(x) != len(planes):
            raise RunError("the graph could not be optimised: a plane is not observed")
        self._take(keyframes, steps, planes, x)
        self._stirred.moved(keyframes, planes)
        self.factors.weigh([*_keys(keyframes, planes), *scalars])

    def _take(self, keyframes: IntArray, steps: Array, planes: IntArray, x: Array) -> None:
        if not (np.isfinite(steps).all() and np.isfinite(x).all()):
            raise RunError("the graph could not be optimised: an estimate is not finite")
        self._at.take(keyframes, steps.reshape(-1, 6), planes, x.reshape(-1, 3))
        self._stirred.welcome()
        self.sightings.weigh(keyframes.tolist())


def _keys(keyframes: IntArray, planes: IntArray) -> list[int]:
    return [*map(keyframe_key, keyframes.tolist()), *map(plane_key, planes.tolist())]
