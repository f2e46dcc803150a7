"""Ablations: variants of a run, on the same scenes and seeds, and what each is worth."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import product

import numpy as np

from eval.comparing.stats import Difference, Samples, holm, paired
from eval.comparing.values import check_metric, value_of
from eval.config import RunConfig
from eval.names import known, refuse
from eval.sweep.job import Row

FACETS = ("layers", "factors", "loops", "detector", "odometry", "conditions", "sensor")
"""Fields of RunConfig in which variants may differ."""

METRICS = (
    *("ate_m", "ate_xy_m", "mma_m", "plane_rmse_m"),
    *("rooms.precision", "rooms.recall", "walls.precision", "walls.recall"),
)
"""What is compared where nothing else is asked for."""

BOOTSTRAP_SEED = 20_240_501


@dataclass(frozen=True)
class Variant:
    """name: for the tables; fields: where it differs from the run that all start from."""

    name: str
    fields: tuple[tuple[str, str], ...]

    def of(self, config: RunConfig) -> RunConfig:
        """A run of this variant. Raises InputError for a value that no run can have."""
        return replace(config, **dict(self.fields))  # type: ignore[arg-type]


@dataclass(frozen=True)
class Ablation:
    """variants x scenes x seeds; pairs: (variant, the one that it is compared with), by name;
    base: the run that all start from (its scene and seed count for nothing)."""

    variants: tuple[Variant, ...]
    pairs: tuple[tuple[str, str], ...]
    scenes: tuple[str, ...]
    seeds: tuple[int, ...]
    metrics: tuple[str, ...] = METRICS
    base: RunConfig = RunConfig("SE1")

    def __post_init__(self) -> None:
        for what in ("variants", "scenes", "seeds", "metrics"):
            values = getattr(self, what)
            if not values:
                refuse(f"{what}: expected at least one, got none")
            if len(set(values)) < len(values):
                refuse(f"{what}: expected different ones, got one twice")
        for name in self.metrics:
            check_metric("metrics", name)
        for pair in self.pairs:
            for name in pair:
                known("pairs", name, [variant.name for variant in self.variants])

    @property
    def configs(self) -> tuple[RunConfig, ...]:
        """Every run, seed by seed, so that an early end leaves whole pairs."""
        return tuple(
            variant.of(replace(self.base, scene=scene, seed=seed))
            for seed, scene, variant in product(self.seeds, self.scenes, self.variants)
        )


def variants_of(facets: Mapping[str, Sequence[str]]) -> tuple[Variant, ...]:
    """Every combination of the values of some fields, named by those that differ."""
    for name, values in facets.items():
        known("facet", name, FACETS)
        if not values or len(set(values)) < len(values):
            refuse(f"{name}: expected different values, as a,b, got {','.join(values)!r}")
    varied = [name for name, values in facets.items() if len(values) > 1]
    return tuple(
        Variant(
            ", ".join(value for name, value in zip(facets, values, strict=True) if name in varied)
            or ", ".join(values)
            or "as it is",
            tuple(zip(facets, values, strict=True)),
        )
        for values in product(*facets.values())
    )


def against_first(variants: Sequence[Variant]) -> tuple[tuple[str, str], ...]:
    """Each variant against the first."""
    return tuple((variant.name, variants[0].name) for variant in variants[1:])


# --- presets --------------------------------------------------------------------------------------

PAPER_SCENES = ("SC1F1", "SC1F2", "SE1", "SE2", "SE3")


def make_variant(name: str, detector: str, layers: str, factors: str = "paper") -> Variant:
    """One that detects so, and lets so much into the graph."""
    return Variant(name, (("detector", detector), ("layers", layers), ("factors", factors)))


PAPER_VARIANTS = (
    make_variant("planes only", "gnn", "planes", "paper"),
    make_variant("S-Graphs+", "sgraphs", "rooms", "paper"),
    make_variant("rooms only", "gnn", "rooms", "paper"),
    make_variant("rooms and walls", "gnn", "rooms+walls", "paper"),
    make_variant("rooms only, informative", "gnn", "rooms", "informative"),
    make_variant("rooms and walls, informative", "gnn", "rooms+walls", "informative"),
)
PAPER_PAIRS = (
    ("S-Graphs+", "planes only"),
    ("rooms only", "planes only"),
    ("rooms only", "S-Graphs+"),
    ("rooms and walls", "S-Graphs+"),
    ("rooms and walls", "rooms only"),
    ("rooms only, informative", "planes only"),
    ("rooms and walls, informative", "planes only"),
    ("rooms and walls, informative", "rooms only, informative"),
)
PRESETS = {"paper": (PAPER_VARIANTS, PAPER_PAIRS, PAPER_SCENES, tuple(range(10)))}
"""name -> variants, pairs, scenes, seeds. ``paper``: Tables III and IV, its baseline among them,
and the same with factors that constrain the planes."""


# --- results --------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Level:
    """One variant's values of one metric: scene -> values in the order of the seeds, NaN where a
    run has none; failed: runs that failed."""

    variant: str
    metric: str
    values: Mapping[str, tuple[float, ...]]
    failed: int

    def mean(self, scene: str) -> float | None:
        """Over the seeds that have a value."""
        known = [value for value in self.values[scene] if not np.isnan(value)]
        return float(np.mean(known)) if known else None

    def deviation(self, scene: str) -> float | None:
        """Standard deviation over seeds; None with fewer than two."""
        known = [value for value in self.values[scene] if not np.isnan(value)]
        return float(np.std(known, ddof=1)) if len(known) > 1 else None

    @property
    def overall(self) -> float | None:
        """Over seeds, then over scenes; None if a scene has no value at all."""
        means = [self.mean(scene) for scene in self.values]
        known = [mean for mean in means if mean is not None]
        return float(np.mean(known)) if len(known) == len(means) else None


@dataclass(frozen=True)
class Comparison:
    """One variant less another in one metric. p_holm: p_rank adjusted for all pairs of variants
    that are compared in this metric; lost: pairs without a value on one side."""

    variant: str
    against: str
    metric: str
    difference: Difference | None
    p_holm: float | None
    lost: int


@dataclass(frozen=True)
class Result:
    """An ablation, done."""

    ablation: Ablation
    levels: tuple[Level, ...]
    comparisons: tuple[Comparison, ...]

    def level(self, variant: str, metric: str) -> Level:
        """The values of a variant in a metric."""
        return next(lv for lv in self.levels if lv.variant == variant and lv.metric == metric)


def evaluate(ablation: Ablation, rows: Sequence[Row]) -> Result:
    """Levels and comparisons from the rows of ``ablation.configs``, in that order."""
    by_run = dict(zip(_runs(ablation), rows, strict=True))
    levels = {
        (variant.name, metric): _level(ablation, by_run, variant.name, metric)
        for metric in ablation.metrics
        for variant in ablation.variants
    }
    comparisons = [
        comparison
        for metric in ablation.metrics
        for comparison in _adjusted(
            _compared(levels[a, metric], levels[b, metric]) for a, b in ablation.pairs
        )
    ]
    return Result(ablation, tuple(levels.values()), tuple(comparisons))


def _runs(ablation: Ablation) -> list[tuple[str, str, int]]:
    runs = product(ablation.seeds, ablation.scenes, ablation.variants)
    return [(variant.name, scene, seed) for seed, scene, variant in runs]


def _level(
    ablation: Ablation, rows: Mapping[tuple[str, str, int], Row], variant: str, metric: str
) -> Level:
    own = {(scene, seed): row for (name, scene, seed), row in rows.items() if name == variant}
    values = {
        scene: tuple(_value(own[scene, seed], metric) for seed in ablation.seeds)
        for scene in ablation.scenes
    }
    return Level(variant, metric, values, sum(row.status != "complete" for row in own.values()))


def _value(row: Row, metric: str) -> float:
    """NaN for a run that failed: what was scored of it says nothing of the whole."""
    value = None
    if row.metrics is not None and row.status == "complete":
        value = value_of(row.metrics, metric)
    return np.nan if value is None else value


def _compared(a: Level, b: Level) -> Comparison:
    both, lost = _common(a, b)
    rng = np.random.default_rng(BOOTSTRAP_SEED)
    difference = paired(*both, rng) if both[0] else None
    return Comparison(a.variant, b.variant, a.metric, difference, None, lost)


def _common(a: Level, b: Level) -> tuple[tuple[Samples, Samples], int]:
    """The values of those seeds that both have, scene by scene; and how many pairs there are not.

    A scene without any is left out of both.
    """
    left, right, lost = {}, {}, 0
    for scene in a.values:
        x, y = np.array(a.values[scene]), np.array(b.values[scene])
        good = ~(np.isnan(x) | np.isnan(y))
        lost += int((~good).sum())
        if good.any():
            left[scene], right[scene] = x[good], y[good]
    return (left, right), lost


def _adjusted(comparisons: Iterable[Comparison]) -> list[Comparison]:
    found = list(comparisons)
    raw = [None if c.difference is None else c.difference.p_rank for c in found]
    return [replace(c, p_holm=p) for c, p in zip(found, holm(raw), strict=True)]
