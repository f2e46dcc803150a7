"""gtsam's ISAM2 as a set of named factors: added, replaced and removed at will, solved now and
then."""

from __future__ import annotations

from collections.abc import Hashable, Iterator, Mapping, Sequence
from contextlib import contextmanager

import gtsam
import numpy as np

from slam.core import Array, RunError

Named = tuple[Hashable, gtsam.NonlinearFactor]


@contextmanager
def failures() -> Iterator[None]:
    """Makes a RunError of what gtsam raises when it cannot solve a graph, or read its solution."""
    try:
        yield
    except (RuntimeError, IndexError) as error:
        reason = str(error).strip().splitlines()[0]
        raise RunError(f"the graph could not be optimised: {reason}") from error


class Solver:
    """What is added or removed counts from the next ``update`` on."""

    def __init__(self, relinearize: Mapping[str, Sequence[float]]):
        """relinearize: by the letter of a kind of variable, the least change of each coordinate at
        which factors are linearised anew."""
        thresholds = gtsam.ISAM2ThresholdMap()
        for letter, change in relinearize.items():
            thresholds.insert((letter, np.array(change)))
        parameters = gtsam.ISAM2Params()
        parameters.setRelinearizeThreshold(thresholds)
        parameters.relinearizeSkip = 1
        parameters.setFactorization("QR")
        self._isam = gtsam.ISAM2(parameters)
        self._pending: list[Named] = []
        self._values = gtsam.Values()
        self._removals: list[int] = []
        self._index: dict[Hashable, int] = {}

    # --- what it holds ---

    def add(self, name: Hashable, factor: gtsam.NonlinearFactor) -> None:
        """A factor; its name is no other's."""
        self._pending.append((name, factor))

    def remove(self, name: Hashable) -> None:
        """Takes a factor out, whether it has been solved with already or not."""
        if name in self._index:
            self._removals.append(self._index.pop(name))
        else:
            self._pending = [(other, factor) for other, factor in self._pending if other != name]

    def insert(self, key: int, value: gtsam.Pose3 | Array | float) -> None:
        """A new variable, and where it is thought to be."""
        self._values.insert(key, value)

    def withdraw(self, key: int) -> None:
        """A variable that no update has seen is not wanted any more."""
        if self._values.exists(key):
            self._values.erase(key)

    def holds(self, key: int) -> bool:
        """Is there such a variable?"""
        return bool(self._isam.valueExists(key) or self._values.exists(key))

    def variable_count(self) -> int:
        """How many variables have been solved for."""
        return int(self._isam.getLinearizationPoint().size())

    # --- solving ---

    def update(self, extra_iterations: int = 0) -> None:
        """Takes in all that is pending. Raises RunError when gtsam cannot solve it."""
        factors = gtsam.NonlinearFactorGraph()
        for _, factor in self._pending:
            factors.add(factor)
        with failures():
            result = self._isam.update(factors, self._values, self._removals)
            for _ in range(extra_iterations):
                self._isam.update()
        for (name, _), index in zip(self._pending, result.getNewFactorsIndices(), strict=True):
            self._index[name] = int(index)
        self._pending, self._removals = [], []
        self._values = gtsam.Values()

    # --- answers ---

    def pose(self, key: int) -> Array:
        """(4, 4) of one variable."""
        return np.asarray(self._isam.calculateEstimatePose3(key).matrix())

    def point3(self, key: int) -> Array:
        """(3,) of one variable."""
        return np.asarray(self._isam.calculateEstimatePoint3(key))

    def point2(self, key: int) -> Array:
        """(2,) of one variable, solved for or only inserted."""
        if self._values.exists(key):
            return np.array(self._values.atPoint2(key))
        return np.array(self._isam.calculateEstimatePoint2(key))

    def values(self) -> gtsam.Values:
        """Of all variables."""
        return self._isam.calculateEstimate()

    def covariance(self, key: int) -> Array:
        """Marginal covariance of a variable, in gtsam's tangent space."""
        return np.asarray(self._isam.marginalCovariance(key))

    def factors(self) -> Iterator[Named]:
        """All that were solved with."""
        graph = self._isam.getFactorsUnsafe()
        for name, index in self._index.items():
            yield name, graph.at(index)
