"""What a comparison can be trusted for: paired differences over seeds and scenes, with spread.

A mean is over the seeds of a scene, then over scenes. Scenes are taken as they are, seeds as drawn
from all seeds: an interval says how far another set of seeds would have moved the mean, not what
would come of other buildings (``across_scenes`` does that).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.random import Generator

from slam.core import Array, InputError

LEVEL = 0.95
RESAMPLES = 10_000
REPEATABLE = 1e-6
"""To what a run repeats on one machine [m]: pairs that differ by less do not differ."""

Samples = Mapping[str, Array]
"""Of each scene the values of its seeds, (S,)."""


@dataclass(frozen=True)
class Interval:
    """low to high."""

    low: float
    high: float

    @property
    def clear_of_zero(self) -> bool:
        """Does it lie on one side of zero?"""
        return self.low > 0.0 or self.high < 0.0


@dataclass(frozen=True)
class Difference:
    """A minus B, see ``paired`` and ``unpaired``.

    count: pairs (or values of the smaller side); base: the mean of B; mean: of the difference;
    interval: its bootstrap interval over seeds; across_scenes: the same with scenes drawn anew too;
    effect: the mean over the standard deviation of the differences within scenes (Cohen's d_z;
    unpaired: over that of the values, d); pairs: how many are (below, above) zero; scenes: the same
    of scene means; p_rank: Wilcoxon's signed-rank test of the pairs
    (unpaired: Mann-Whitney's); p_sign: the sign test; p_mean: t-test of the mean over scenes with
    Satterthwaite's degrees of freedom. None where the numbers do not allow it.
    """

    count: int
    base: float
    mean: float
    interval: Interval | None
    across_scenes: Interval | None
    effect: float | None
    pairs: tuple[int, int]
    scenes: tuple[int, int]
    p_rank: float | None
    p_sign: float | None
    p_mean: float | None

    @property
    def percent(self) -> float | None:
        """The mean in percent of B's."""
        return 100.0 * self.mean / abs(self.base) if self.base else None


def mean_over_scenes(samples: Samples) -> float:
    """Over seeds, then over scenes."""
    return float(np.mean([values.mean() for values in samples.values()]))


def bootstrap(samples: Samples, rng: Generator, level: float = LEVEL) -> Interval | None:
    """Percentile interval of the mean over scenes, seeds drawn anew within each scene.

    Deviations are widened by sqrt(n / (n - 1)), since a resample of n values has that much too
    little variance. None with a single seed in any scene.
    """
    if not samples or min(len(values) for values in samples.values()) < 2:
        return None
    means = np.mean([_resampled(values, rng) for values in samples.values()], axis=0)
    return _percentiles(means, level)


def bootstrap_across_scenes(
    samples: Samples, rng: Generator, level: float = LEVEL
) -> Interval | None:
    """The same with the scenes drawn anew too; None with a single scene."""
    if len(samples) < 2 or min(len(values) for values in samples.values()) < 2:
        return None
    per_scene = np.array([_resampled(values, rng) for values in samples.values()])
    drawn = rng.integers(len(samples), size=(len(samples), RESAMPLES))
    means = np.take_along_axis(per_scene, drawn, axis=0).mean(axis=0)
    middle = mean_over_scenes(samples)
    wider = np.sqrt(len(samples) / (len(samples) - 1.0))
    return _percentiles(middle + wider * (means - middle), level)


def _resampled(values: Array, rng: Generator) -> Array:
    """(RESAMPLES,) means of values drawn anew."""
    n = len(values)
    means = values[rng.integers(n, size=(RESAMPLES, n))].mean(axis=1)
    return values.mean() + np.sqrt(n / (n - 1.0)) * (means - values.mean())


def _percentiles(means: Array, level: float) -> Interval:
    low, high = np.percentile(means, [50.0 * (1.0 - level), 50.0 * (1.0 + level)])
    return Interval(float(low), float(high))


def paired(a: Samples, b: Samples, rng: Generator) -> Difference:
    """A minus B of two sets with the same scenes and, in the same order, the same seeds.

    Raises InputError where they do not pair.
    """
    if not a or a.keys() != b.keys() or any(len(a[scene]) != len(b[scene]) for scene in a):
        raise InputError("comparison: the two sets have no pairs of scene and seed")
    differences = {scene: _settled(a[scene] - b[scene]) for scene in a}
    all_pairs = np.concatenate(list(differences.values()))
    deviation = _pooled([differences])
    mean = mean_over_scenes(differences)
    return Difference(
        count=len(all_pairs),
        base=mean_over_scenes(b),
        mean=mean,
        interval=bootstrap(differences, rng),
        across_scenes=bootstrap_across_scenes(differences, rng),
        effect=mean / deviation if deviation else None,
        pairs=_signs(all_pairs),
        scenes=_signs(np.array([values.mean() for values in differences.values()])),
        p_rank=_wilcoxon(all_pairs),
        p_sign=_sign_test(all_pairs),
        p_mean=_t_test([differences], mean),
    )


def _settled(differences: Array) -> Array:
    """Without what only rounding makes of equal runs."""
    return np.where(np.abs(differences) < REPEATABLE, 0.0, differences)


def unpaired(a: Samples, b: Samples, rng: Generator) -> Difference:
    """A minus B of two sets with the same scenes and different seeds. Raises InputError."""
    if not a or a.keys() != b.keys():
        raise InputError("comparison: the two sets have no scene in common")
    mean = mean_over_scenes(a) - mean_over_scenes(b)
    deviation = _pooled([a, b])
    return Difference(
        count=min(sum(map(len, a.values())), sum(map(len, b.values()))),
        base=mean_over_scenes(b),
        mean=mean,
        interval=bootstrap_difference(a, b, rng),
        across_scenes=None,
        effect=mean / deviation if deviation else None,
        pairs=(0, 0),
        scenes=_signs(np.array([a[scene].mean() - b[scene].mean() for scene in a])),
        p_rank=_mann_whitney(a, b),
        p_sign=None,
        p_mean=_t_test([a, b], mean),
    )


def bootstrap_difference(a: Samples, b: Samples, rng: Generator) -> Interval | None:
    """Percentile interval of the mean of A less that of B, whose scenes may be others; None with a
    single seed in any scene."""
    if not a or not b or min(len(values) for values in [*a.values(), *b.values()]) < 2:
        return None
    left, right = (
        np.mean([_resampled(values, rng) for values in samples.values()], axis=0)
        for samples in (a, b)
    )
    return _percentiles(left - right, LEVEL)


def _signs(values: Array) -> tuple[int, int]:
    return int((values < 0.0).sum()), int((values > 0.0).sum())


def _pooled(sets: Sequence[Samples]) -> float | None:
    """Standard deviation within scenes, over all sets and scenes."""
    groups = [values for samples in sets for values in samples.values()]
    freedom = sum(len(values) - 1 for values in groups)
    if freedom == 0:
        return None
    return float(np.sqrt(sum(((v - v.mean()) ** 2).sum() for v in groups) / freedom))


# --- tests ----------------------------------------------------------------------------------------


def _wilcoxon(differences: Array) -> float | None:
    """Two-sided; pairs without a difference are left out. None without pairs that differ."""
    from scipy.stats import wilcoxon

    moved = differences[differences != 0.0]
    return float(wilcoxon(moved).pvalue) if len(moved) else None


def _sign_test(differences: Array) -> float | None:
    from scipy.stats import binomtest

    low, high = _signs(differences)
    return float(binomtest(low, low + high).pvalue) if low + high else None


def _mann_whitney(a: Samples, b: Samples) -> float | None:
    """Two-sided, of the values less their scene's mean over both sets."""
    from scipy.stats import mannwhitneyu

    middle = {scene: np.concatenate([a[scene], b[scene]]).mean() for scene in a}
    left = np.concatenate([a[scene] - middle[scene] for scene in a])
    right = np.concatenate([b[scene] - middle[scene] for scene in b])
    return float(mannwhitneyu(left, right).pvalue) if np.ptp([*left, *right]) > 0.0 else None


def _t_test(sets: Sequence[Samples], mean: float) -> float | None:
    """Of a mean over scenes: the variances of all scenes' means add up, each with its own degrees
    of freedom (Satterthwaite, 1946). None with a single seed in any scene."""
    from scipy.stats import t

    groups = [values for samples in sets for values in samples.values()]
    if min(len(values) for values in groups) < 2:
        return None
    scenes = len(groups) / len(sets)
    parts = np.array([values.var(ddof=1) / len(values) for values in groups]) / scenes**2
    variance = parts.sum()
    if variance == 0.0:
        return 1.0 if mean == 0.0 else 0.0
    freedom = variance**2 / (parts**2 / [len(values) - 1 for values in groups]).sum()
    return float(2.0 * t.sf(abs(mean) / np.sqrt(variance), freedom))


def holm(p_values: Sequence[float | None]) -> list[float | None]:
    """p-values of several questions asked at once, adjusted (Holm, 1979); None stays None."""
    known = sorted((p, place) for place, p in enumerate(p_values) if p is not None)
    adjusted: list[float | None] = [None] * len(p_values)
    highest = 0.0
    for rank, (p, place) in enumerate(known):
        highest = max(highest, min(1.0, p * (len(known) - rank)))
        adjusted[place] = highest
    return adjusted
