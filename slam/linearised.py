"""Factors that are not linear, as the solver holds them: by their linear parts."""

from __future__ import annotations

import math
from collections.abc import Callable, Hashable, Iterable, Sequence
from dataclasses import dataclass

import gtsam

from slam.core import Array
from slam.solver import Solver, failures
from slam.variables import Variables


@dataclass(frozen=True)
class Robust:
    """A factor whose weight falls with its error. keys: of its variables; build: makes it of its
    noise; sigmas: (M,) standard deviations of its residuals; loss: how it weighs an error in
    standard deviations."""

    keys: Sequence[int]
    build: Callable[[gtsam.noiseModel.Base], gtsam.NonlinearFactor]
    sigmas: Array
    loss: gtsam.noiseModel.mEstimator.Huber | gtsam.noiseModel.mEstimator.Cauchy

    def weighed(self, weight: float) -> gtsam.NonlinearFactor:
        """The factor, as if its variance were so much smaller."""
        return self.build(gtsam.noiseModel.Diagonal.Sigmas(self.sigmas / math.sqrt(weight)))

    def weight(self, values: gtsam.Values) -> float:
        """What it counts where its variables are."""
        return float(self.loss.weight(math.sqrt(2.0 * self.weighed(1.0).error(values))))


class Linearised:
    """Named factors. All that are about a variable are linearised at one place, or the graph would
    know more of it than has been observed; how much robust ones count is told by where the
    variables are now."""

    def __init__(self, solver: Solver, variables: Variables, stale: float):
        """stale: change of a weight from which its factor is made anew."""
        self._solver = solver
        self._variables = variables
        self._stale = stale
        self._held: dict[Hashable, gtsam.NonlinearFactor | Robust] = {}
        self._keys: dict[Hashable, list[int]] = {}
        self._about: dict[int, dict[Hashable, None]] = {}
        self._weights: dict[Hashable, float] = {}
        self._changed: dict[Hashable, None] = {}

    def add(self, name: Hashable, factor: gtsam.NonlinearFactor | Robust) -> None:
        """A factor; its name is no other's. It counts from the next ``settle`` on."""
        self._held[name] = factor
        self._keys[name] = list(factor.keys if isinstance(factor, Robust) else factor.keys())
        for key in self._keys[name]:
            self._about.setdefault(key, {})[name] = None
        self._changed[name] = None

    def remove(self, name: Hashable) -> None:
        """Takes a factor out."""
        del self._held[name]
        for key in self._keys.pop(name):
            del self._about[key][name]
            if not self._about[key]:
                del self._about[key]
        self._weights.pop(name, None)
        self._changed.pop(name, None)
        self._solver.remove(name)

    def weigh(self, keys: Iterable[int]) -> None:
        """These variables are elsewhere now: do robust factors about them count as before?"""
        for name in self._names(keys):
            factor, known = self._held[name], self._weights.get(name)
            if isinstance(factor, Robust) and known is not None:
                weight = factor.weight(self._variables.now(self._keys[name]))
                if abs(weight - known) > self._stale:
                    self._changed[name] = None

    def settle(self, moved: Iterable[int]) -> None:
        """Gives the solver what has changed, and anew what is about variables that are linearised
        elsewhere now."""
        for name in self._changed | self._names(moved):
            self._solver.remove(name)
            factor, keys = self._held[name], self._keys[name]
            if isinstance(factor, Robust):
                self._weights[name] = factor.weight(self._variables.now(keys))
                factor = factor.weighed(self._weights[name])
            at, vectors = self._variables.linear_point(keys), self._variables.vectors(keys)
            with failures():
                linear = gtsam.LinearContainerFactor(factor.linearize(at), vectors)
            self._solver.add(name, linear, factor.dim())
        self._changed = {}

    def _names(self, keys: Iterable[int]) -> dict[Hashable, None]:
        """Of factors about any of them."""
        return {name: None for key in keys for name in self._about.get(key, ())}
