"""Differences: the text's relative figures, ours less the baselines, fresh buildings less known."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from eval.comparing.ablation import BOOTSTRAP_SEED, Result
from eval.comparing.stats import Interval, bootstrap_difference
from eval.comparing.tables import Sheet, comparisons_csv, number, signed
from eval.paper.published import Claim
from eval.paper.sheets import NONE, ROOM_RULES, drawn, samples_of, shown, spread_of
from eval.paper.study import AGAINST_BASELINES, Measured


def _interval(interval: Interval | None, scale: float = 1.0, digits: int = 3) -> str:
    """Its ends; * if it is clear of zero."""
    if interval is None:
        return NONE
    ends = (signed(end, scale, digits) for end in (interval.low, interval.high))
    return " to ".join(ends) + (" *" if interval.clear_of_zero else "")


def claims_sheet(title: str, measured: Measured, claims: Sequence[Claim]) -> Sheet:
    """Relative differences, ours beside the text's; the interval is that of the paired mean."""
    head = ("what", "variant", "against", "change %", "95 % interval", "pairs", "the paper says")
    rows = [_claim_row(measured, claim) for claim in claims]
    return Sheet(title, head, tuple(row for row in rows if row is not None))


def _claim_row(measured: Measured, claim: Claim) -> tuple[str, ...] | None:
    scenes = measured.of(claim.scenes)
    if not scenes:
        return None
    pair = (claim.variant, claim.against)
    found = measured.result(scenes, [pair], [claim.metric]).comparisons[0].difference
    names = (claim.what, claim.variant, claim.against)
    if found is None or not found.base:
        return (*names, NONE, NONE, "0", claim.says)
    scale = 100.0 / abs(found.base)
    interval = _interval(found.interval, scale, 1)
    return (*names, signed(found.percent, 1.0, 1), interval, str(found.count), claim.says)


def baselines_sheet(title: str, worlds: Sequence[tuple[str, Result]]) -> Sheet:
    """Ours less each baseline in the precision and the recall of rooms: as they are, not in
    percent. The means are over the pairs that both have a value for."""
    head = ("world", "against", "measure", "ours", "theirs", "difference", "95 % interval", "pairs")
    rows: list[tuple[str, ...]] = []
    rules: list[int] = []
    for world, result in worlds:
        found = {(c.variant, c.against, c.metric): c.difference for c in result.comparisons}
        for pair in AGAINST_BASELINES:
            rules.append(len(rows))
            for name, metric in ROOM_RULES:
                d = found.get((*pair, metric))
                if d is not None:
                    means = (number(value, 1.0, 3) for value in (d.base + d.mean, d.base))
                    gap = (signed(d.mean), _interval(d.interval), str(d.count))
                    rows.append((world, pair[1], name, *means, *gap))
    return Sheet(title, head, tuple(rows), frozenset(rules[1:]))


def against_sheet(title: str, a: Result, b: Result, names: tuple[str, str], limit: float) -> Sheet:
    """Two sets of scenes that share nothing but the methods: means, how far they differ, and if
    that is within the limit."""
    rows = []
    for variant in (variant.name for variant in b.ablation.variants):
        for name, metric in ROOM_RULES:
            first, second = (spread_of(result, variant, metric) for result in (a, b))
            if first is None or second is None:
                continue
            gap = second.mean - first.mean
            ends = _interval(_interval_between(a, b, variant, metric))
            within = "yes" if abs(gap) <= limit + 1e-9 else "no"
            cells = (shown(first), shown(second), signed(gap), ends, within)
            rows.append((variant, name, *cells))
    head = ("method", "measure", *names, "difference", "95 % interval", f"within {limit:g}")
    return Sheet(title, head, tuple(rows))


def _interval_between(a: Result, b: Result, variant: str, metric: str) -> Interval | None:
    """Of B less A."""
    first, second = (drawn(samples_of(result.level(variant, metric))) for result in (a, b))
    return bootstrap_difference(second, first, np.random.default_rng(BOOTSTRAP_SEED))


def differences_csv(groups: Sequence[tuple[str, Result]]) -> str:
    """Every comparison of groups of scenes, their names in the first column."""
    lines: list[str] = []
    for name, result in groups:
        head, *rows = comparisons_csv(result).splitlines()
        lines = lines or [f"scenes,{head}"]
        lines += [f"{name},{row}" for row in rows]
    return "\n".join([*lines, ""])
