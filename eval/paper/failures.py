"""Missed and false rooms, counted by the first stage that had them wrong."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from eval.comparing.ablation import Result
from eval.comparing.tables import Sheet
from eval.paper.published import BASELINES
from eval.paper.sheets import NONE
from eval.paper.study import BY_PIECES, CAUSES, ENTERED, PLANES_ONLY, applies
from slam.core import Array

RECALL = BY_PIECES[1]


def _causes(kind: str) -> list[str]:
    return [cause for cause in CAUSES if cause.startswith(f"failures.{kind}_")]


def _names(kind: str) -> list[str]:
    return [f"{kind}: {cause.removeprefix(f'failures.{kind}_')}" for cause in _causes(kind)]


HEAD = ("entered", "missed", *_names("missed"), "half", "false", *_names("false"))


def failures_sheet(title: str, result: Result) -> Sheet:
    """How many of the rooms entered were missed and how many detections false over all runs, and
    why; half: how many were found with so few faces that they count half by pieces."""
    names = [variant.name for variant in result.ablation.variants]
    rows = tuple((name, *_failures(result, name)) for name in names if name != PLANES_ONLY)
    return Sheet(title, ("method", *HEAD), rows)


def causes_sheet(title: str, groups: Sequence[tuple[str, Result]]) -> Sheet:
    """The same of groups of runs: those of ours, then those of the other methods."""
    names = [variant.name for variant in groups[0][1].ablation.variants]
    names.sort(key=lambda name: name in BASELINES)
    rows = [(name, group, *_failures(result, name)) for name in names for group, result in groups]
    rules = frozenset(range(len(groups), len(rows), len(groups)))
    return Sheet(title, ("method", "what", *HEAD), tuple(rows), rules)


def _failures(result: Result, variant: str) -> list[str]:
    missed, false = (
        {cause: _values(result, variant, cause) for cause in _causes(kind)}
        for kind in ("missed", "false")
    )
    judged = ~np.isnan(_values(result, variant, CAUSES[0]))
    entered = np.where(judged, _values(result, variant, ENTERED), np.nan)
    found = entered - np.sum(list(missed.values()), axis=0)
    half = 2.0 * (found - entered * _values(result, variant, RECALL))
    return [
        _count(entered),
        *_counts(variant, missed),
        _count(half) if applies(variant, RECALL) else NONE,
        *_counts(variant, false),
    ]


def _counts(variant: str, causes: Mapping[str, Array]) -> list[str]:
    """All, then each; "-" for a cause that does not apply, unless it was told of all the same."""
    cells = [_count(np.concatenate(list(causes.values())))]
    for cause, values in causes.items():
        cells.append(_count(values) if applies(variant, cause) or np.nansum(values) else NONE)
    return cells


def _values(result: Result, variant: str, metric: str) -> Array:
    """(R,) of all runs; NaN where there is none."""
    return np.concatenate([*map(np.array, result.level(variant, metric).values.values())])


def _count(values: Array) -> str:
    """The sum over all runs that have it."""
    return str(round(float(np.nansum(values))))
