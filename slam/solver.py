"""gtsam's ISAM2 as a set of named linear factors: added, replaced and removed at will, solved now
and then.

gtsam copies all variables for each factor that it has to ask in Python, so that an update would
take the longer the larger the map is. It is never asked: it is handed linear factors of vectors,
and who knows of what they are the linear parts has them replaced (``slam.linearised``).
"""

from __future__ import annotations

from collections.abc import Hashable, Iterator
from contextlib import contextmanager

import gtsam
import numpy as np

from slam.core import Array, RunError

Value = Array | float
"""Of a variable: a vector, or a number."""


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

    def __init__(self) -> None:
        parameters = gtsam.ISAM2Params()
        parameters.enableRelinearization = False
        parameters.setFactorization("QR")
        self._isam = gtsam.ISAM2(parameters)
        self._pending: dict[Hashable, gtsam.NonlinearFactor] = {}
        self._values = gtsam.Values()
        self._removals: list[int] = []
        self._index: dict[Hashable, int] = {}
        self._residuals: dict[Hashable, int] = {}

    # --- what it holds ---

    def add(self, name: Hashable, factor: gtsam.NonlinearFactor, residuals: int) -> None:
        """A factor of so many residuals; its name is no other's."""
        self._pending[name] = factor
        self._residuals[name] = residuals

    def remove(self, name: Hashable) -> None:
        """Takes a factor out, whether it has been solved with already or not."""
        if name in self._index:
            self._removals.append(self._index.pop(name))
        self._pending.pop(name, None)
        self._residuals.pop(name, None)

    def insert(self, key: int, value: Value) -> None:
        """A new variable, and where it is thought to be."""
        self._values.insert(key, value)

    def withdraw(self, key: int) -> None:
        """A variable that no factor is about is not wanted any more."""
        if self._values.exists(key):
            self._values.erase(key)

    def holds(self, key: int) -> bool:
        """Is there such a variable?"""
        return bool(self._isam.valueExists(key) or self._values.exists(key))

    # --- solving ---

    def update(self) -> None:
        """Takes in all that is pending. Raises RunError when gtsam cannot solve it."""
        factors = gtsam.NonlinearFactorGraph()
        for factor in self._pending.values():
            factors.add(factor)
        with failures():
            result = self._isam.update(factors, self._values, self._removals)
        for name, index in zip(self._pending, result.getNewFactorsIndices(), strict=True):
            self._index[name] = int(index)
        self._pending, self._removals = {}, []
        self._values = gtsam.Values()

    # --- answers ---

    def vector(self, key: int) -> Array:
        """(N,) of one variable."""
        return np.asarray(self._isam.calculateEstimateVector(key))

    def point3(self, key: int) -> Array:
        """(3,) of one variable."""
        return np.asarray(self._isam.calculateEstimatePoint3(key))

    def values(self) -> gtsam.Values:
        """Of all variables, exactly: answers about single ones leave out what changes by less than
        a thousandth."""
        return self._isam.calculateBestEstimate()

    def covariance(self, key: int) -> Array:
        """Marginal covariance of a variable."""
        return np.asarray(self._isam.marginalCovariance(key))

    def squares(self) -> Iterator[tuple[Hashable, int, float]]:
        """Of every factor that was solved with: its name, how many residuals, and the sum of their
        squares at the last estimate, each over its variance."""
        graph, values = self._isam.getFactorsUnsafe(), self.values()
        for name, index in self._index.items():
            yield name, self._residuals[name], 2.0 * graph.at(index).error(values)
