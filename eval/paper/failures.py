"""Missed and false rooms, counted by the first stage that had them wrong."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from eval.comparing.ablation import Result
from eval.comparing.tables import Sheet
from eval.paper.published import BASELINES, WITHOUT_PLANES
from eval.paper.sheets import NONE
from eval.paper.study import CAUSES, ENTERED


def _causes(kind: str) -> list[str]:
    return [cause for cause in CAUSES if cause.startswith(f"failures.{kind}_")]


def _names(kind: str) -> list[str]:
    return [f"{kind}: {cause.removeprefix(f'failures.{kind}_')}" for cause in _causes(kind)]


HEAD = ("entered", "missed", *_names("missed"), "false", *_names("false"))


def failures_sheet(title: str, result: Result) -> Sheet:
    """How many of the rooms entered were missed and how many detections false over all runs, and
    why."""
    names = [variant.name for variant in result.ablation.variants]
    rows = tuple((name, *_failures(result, name)) for name in names)
    return Sheet(title, ("method", *HEAD), rows)


def causes_sheet(title: str, groups: Sequence[tuple[str, Result]]) -> Sheet:
    """The same of groups of runs: those of ours, then those of the other methods."""
    names = [variant.name for variant in groups[0][1].ablation.variants]
    names.sort(key=lambda name: name in BASELINES)
    rows = [(name, group, *_failures(result, name)) for name in names for group, result in groups]
    rules = frozenset(range(len(groups), len(rows), len(groups)))
    return Sheet(title, ("method", "what", *HEAD), tuple(rows), rules)


def _failures(result: Result, variant: str) -> list[str]:
    cells = [f"{_entered(result, variant):.0f}"]
    for kind in ("missed", "false"):
        causes = _causes(kind)
        counts = [_total(result, variant, cause) for cause in causes]
        cells.append(f"{sum(counts):.0f}")
        cells += [
            f"{count:.0f}" if _applies(variant, cause) else NONE
            for count, cause in zip(counts, causes, strict=True)
        ]
    return cells


def _entered(result: Result, variant: str) -> float:
    """Rooms of the runs that could be judged."""
    rooms, judged = (result.level(variant, metric).values for metric in (ENTERED, CAUSES[0]))
    known = [~np.isnan(of_scene) for of_scene in judged.values()]
    return float(sum(np.array(r)[k].sum() for r, k in zip(rooms.values(), known, strict=True)))


def _total(result: Result, variant: str, metric: str) -> float:
    """Over all runs that have it."""
    values = result.level(variant, metric).values.values()
    return float(sum(np.nansum(of_scene) for of_scene in values))


def _applies(variant: str, cause: str) -> bool:
    """Can a cause be told of a method? Hydra uses no planes, the baselines have no edges."""
    if cause.endswith("_planes"):
        return variant not in WITHOUT_PLANES
    return variant not in BASELINES or not cause.endswith("_edges")
