"""Bounds on the metrics of runs, as a scenario's ``[expect]`` table states them.

``ate_m = "<= 0.04"`` has to hold for every run, ``"mean(ate_m)" = "<= 0.03"`` for their mean. A
number that is null misses its bound, and so does the mean over runs of which one has none.
"""

from __future__ import annotations

import math
import operator
import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import NoReturn

from eval.comparing.values import check_metric, value_of
from eval.metrics import Metrics
from eval.names import refuse

COMPARISONS: Mapping[str, Callable[[float, float], bool]] = {
    "<=": operator.le,
    ">=": operator.ge,
    "==": operator.eq,
    "<": operator.lt,
    ">": operator.gt,
}

_TEXT = re.compile(r"(<=|>=|==|<|>)\s*(\S+)")
_MEAN = re.compile(r"mean\(\s*([^()]*?)\s*\)")


@dataclass(frozen=True)
class Bound:
    """metric: its dotted name; comparison: a key of ``COMPARISONS``; limit; mean: of all runs."""

    metric: str
    comparison: str
    limit: float
    mean: bool = False

    def __str__(self) -> str:
        return f"{self.name} {self.comparison} {self.limit:g}"

    @property
    def name(self) -> str:
        """As the scenario file writes it."""
        return f"mean({self.metric})" if self.mean else self.metric

    def holds(self, value: float | None) -> bool:
        """Is a value within the bound? None never is."""
        return value is not None and COMPARISONS[self.comparison](value, self.limit)


@dataclass(frozen=True)
class Check:
    """A bound held against a value. seed: of the run, None for the mean of all."""

    bound: Bound
    seed: int | None
    value: float | None

    @property
    def held(self) -> bool:
        """Is the value within the bound?"""
        return self.bound.holds(self.value)

    def __str__(self) -> str:
        of = "" if self.seed is None else f" of seed {self.seed}"
        expected = f"expected {self.bound.comparison} {self.bound.limit:g}"
        if self.value is None:
            return f"{self.bound.name}{of} is null, {expected}"
        by = "" if self.held else f": missed by {abs(self.value - self.bound.limit):.3g}"
        return f"{self.bound.name}{of} is {self.value:.6g}, {expected}{by}"


def parse_bound(where: str, key: str, text: object) -> Bound:
    """One entry of an ``[expect]`` table. Raises InputError that begins with ``where``."""
    mean = _MEAN.fullmatch(key)
    metric = mean[1] if mean else key
    check_metric(f"{where}: expect", metric)
    found = _TEXT.fullmatch(text.strip()) if isinstance(text, str) else None
    if found is None:
        _refuse_bound(where, key, text)
    try:
        limit = float(found[2])
    except ValueError:
        _refuse_bound(where, key, text)
    if not math.isfinite(limit):
        _refuse_bound(where, key, text)
    return Bound(metric, found[1], limit, mean is not None)


def _refuse_bound(where: str, key: str, text: object) -> NoReturn:
    signs = ", ".join(COMPARISONS)
    refuse(f'{where}: expect: {key}: expected one of {signs} and a number, as "<= 0.04": {text!r}')


def check_bounds(bounds: Sequence[Bound], runs: Mapping[int, Metrics]) -> tuple[Check, ...]:
    """Every bound against every run (seed -> metrics), or against their mean."""
    return tuple(check for bound in bounds for check in _checks(bound, runs))


def _checks(bound: Bound, runs: Mapping[int, Metrics]) -> list[Check]:
    values = {seed: value_of(metrics, bound.metric) for seed, metrics in runs.items()}
    if bound.mean:
        return [Check(bound, None, mean_of(list(values.values())))]
    return [Check(bound, seed, value) for seed, value in values.items()]


def mean_of(values: Sequence[float | None]) -> float | None:
    """The mean; None if there is no value, or one of them is None."""
    known = [value for value in values if value is not None]
    return math.fsum(known) / len(known) if known and len(known) == len(values) else None
