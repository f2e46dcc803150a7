"""The paper's tables: measured here, with spread, and beside each number the paper's own."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from eval.comparing.ablation import BOOTSTRAP_SEED, Level, Result
from eval.comparing.bounds import Bound
from eval.comparing.stats import Interval, Samples, bootstrap, mean_over_scenes
from eval.comparing.tables import Sheet, number, unit_of
from eval.paper.published import NOT_PUBLISHED, REAL, SCENES, WITHOUT_PLANES, Values
from eval.paper.study import BY_PIECES, CENTRE_RULE, DETECTORS, applies
from slam.core import Array
from worlds.catalogue import load_scene, scene_counts

NONE = "-"
ROOM_RULES = (
    ("precision, centre rule", "rooms.centre_precision"),
    ("recall, centre rule", "rooms.centre_recall"),
    ("precision, by pieces", "rooms.precision"),
    ("recall, by pieces", "rooms.recall"),
)
SHARES = ("precision", "recall", "mean_iou", "piece_f1")


# --- spread ---------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Spread:
    """Of a metric over scenes and seeds. mean: over seeds, then over scenes; deviation, low, high:
    over all runs; interval: 95 %, of the mean; count: runs that have a value."""

    mean: float
    deviation: float | None
    low: float
    high: float
    interval: Interval | None
    count: int


def spread(level: Level, scenes: Sequence[str] | None = None) -> Spread | None:
    """None where no run has a value."""
    samples = samples_of(level, scenes)
    if not samples:
        return None
    every = np.concatenate(list(samples.values()))
    rng = np.random.default_rng(BOOTSTRAP_SEED)
    return Spread(
        mean=mean_over_scenes(samples),
        deviation=float(every.std(ddof=1)) if len(every) > 1 else None,
        low=float(every.min()),
        high=float(every.max()),
        interval=_within(bootstrap(drawn(samples), rng), level.metric),
        count=len(every),
    )


def samples_of(level: Level, scenes: Sequence[str] | None = None) -> Samples:
    """The values that there are, of all scenes or of some; without scenes that have none."""
    samples: dict[str, Array] = {}
    for scene in level.values if scenes is None else scenes:
        values = np.array(level.values[scene])
        values = values[~np.isnan(values)]
        if len(values):
            samples[scene] = values
    return samples


def drawn(samples: Samples) -> Samples:
    """What an interval is drawn from: the seeds of each scene; the scenes where each has one run,
    since there is no other spread."""
    single = samples and max(map(len, samples.values())) == 1
    return {"": np.concatenate(list(samples.values()))} if single else samples


def _within(interval: Interval | None, metric: str) -> Interval | None:
    """No metric is negative, and a share is at most 1; a bootstrap of few runs knows neither."""
    if interval is None:
        return None
    most = 1.0 if metric.endswith(SHARES) else np.inf
    low, high = (float(np.clip(end, 0.0, most)) for end in (interval.low, interval.high))
    return Interval(low, high)


def spread_of(result: Result, variant: str, metric: str) -> Spread | None:
    """The same of a variant; None for what does not apply to it."""
    return spread(result.level(variant, metric)) if applies(variant, metric) else None


def shown(found: Spread | None, scale: float = 1.0, digits: int = 2) -> str:
    """The mean and its interval."""
    if found is None:
        return NONE
    text = number(found.mean, scale, digits)
    if found.interval is None:
        return text
    ends = (number(end, scale, digits) for end in (found.interval.low, found.interval.high))
    return f"{text} [{', '.join(ends)}]"


# --- sheets ---------------------------------------------------------------------------------------


def scenes_sheet(names: Sequence[str]) -> Sheet:
    """Table I: what the scenes hold, there and here."""
    rows = []
    for name in names:
        counts = scene_counts(load_scene(name))
        shapes = ", ".join(f"{count} {shape}" for shape, count in counts.rooms)
        world = "real; here simulated as a site" if name in REAL else "simulated"
        rows.append((name, world, SCENES[name], shapes, str(counts.doors), f"{counts.area:.0f}"))
    head = ("scene", "world", "the paper says", "what is built here", "doors", "area m2")
    return Sheet("Scenes (Table I)", head, tuple(rows))


def rooms_sheet(result: Result, world: str) -> Sheet:
    """The precision/recall figure as numbers."""
    head = ("method", "measure", "mean [95 %]", "deviation", "min", "max", "runs")
    rows: list[tuple[str, ...]] = []
    rules: list[int] = []
    for variant in DETECTORS:
        rules.append(len(rows))
        for name, metric in ROOM_RULES:
            found = spread_of(result, variant.name, metric)
            if found is None:
                continue
            numbers = (number(v, 1.0, 2) for v in (found.deviation, found.low, found.high))
            count = f"{found.count} of {len(result.ablation.scenes) * len(result.ablation.seeds)}"
            rows.append((variant.name, name, shown(found), *numbers, count))
    title = f"Rooms, {world} scenes (the paper's values stand in a picture only)"
    return Sheet(title, head, tuple(rows), frozenset(rules[1:]))


@dataclass(frozen=True)
class Column:
    """A variant's metric beside what is published of it, by scene, in the metric's unit."""

    variant: str
    metric: str
    published: Values
    name: str = ""

    @property
    def head(self) -> tuple[str, str]:
        """Over the two columns."""
        return self.name or self.variant, f"{self.name or self.variant} (paper)"


def beside_sheet(title: str, result: Result, columns: Sequence[Column], digits: int = 2) -> Sheet:
    """Scenes down, each column beside the paper's, unless it has nothing at all on these scenes; at
    the end the means over scenes: the paper's over those of these scenes that it has."""
    scenes = result.ablation.scenes
    rows = [(scene, *_cells(result, columns, [scene], digits)) for scene in scenes]
    rows.append(("mean", *_cells(result, columns, scenes, digits)))
    head = ("scene", *(text for column in columns for text in column.head))
    sheet = Sheet(title, head, tuple(rows), frozenset({len(scenes)}))
    unknown = (column for column in columns if not column.published.keys() & set(scenes))
    return sheet.without(*(column.head[1] for column in unknown))


def _cells(
    result: Result, columns: Sequence[Column], scenes: Sequence[str], digits: int
) -> list[str]:
    cells = []
    for column in columns:
        scale, _ = unit_of(column.metric)
        found = spread(result.level(column.variant, column.metric), scenes)
        theirs = [column.published[scene] for scene in scenes if scene in column.published]
        paper = number(float(np.mean(theirs)), scale, digits) if theirs else NOT_PUBLISHED
        cells += [shown(found, scale, digits), paper]
    return cells


SUMMARY = (
    ("rooms P (centre)", "rooms.centre_precision"),
    ("rooms R (centre)", "rooms.centre_recall"),
    ("rooms P", "rooms.precision"),
    ("rooms R", "rooms.recall"),
    ("walls P", "walls.precision"),
    ("walls R", "walls.recall"),
    ("first room s", "first_room_s"),
    ("ATE cm", "ate_m"),
    ("MMA cm", "mma_m"),
)


def summary_sheet(title: str, result: Result) -> Sheet:
    """A group in short: methods down, the means of everything across."""
    rows = []
    for variant in result.ablation.variants:
        cells = [
            shown(spread_of(result, variant.name, metric), unit_of(metric)[0])
            for _, metric in SUMMARY
        ]
        failed = result.level(variant.name, SUMMARY[0][1]).failed
        rows.append((variant.name, *cells, str(failed)))
    head = ("method", *(name for name, _ in SUMMARY), "failed runs")
    return Sheet(title, head, tuple(rows))


def per_scene_sheet(title: str, result: Result, names: Mapping[str, str]) -> Sheet:
    """Rooms of each scene: precision/recall, by pieces, or by centres of Hydra."""
    variants = [variant.name for variant in result.ablation.variants]
    rows = [
        (names[scene], *(_precision_recall(result, variant, scene) for variant in variants))
        for scene in result.ablation.scenes
    ]
    return Sheet(title, ("scene", *variants), tuple(rows))


def groups_sheet(title: str, groups: Sequence[tuple[str, Result]]) -> Sheet:
    """Rooms of groups of runs, which share their methods: means, by centres."""
    variants = [variant.name for variant in groups[0][1].ablation.variants]
    rows = [
        (
            name,
            *(
                _pair(_mean(result, variant, metric) for metric in CENTRE_RULE)
                for variant in variants
            ),
        )
        for name, result in groups
    ]
    return Sheet(title, ("what", *variants), tuple(rows))


def _mean(result: Result, variant: str, metric: str) -> float | None:
    found = spread_of(result, variant, metric)
    return None if found is None else found.mean


def _pair(values: Iterable[float | None]) -> str:
    return " / ".join(number(value, 1.0, 2) for value in values)


def _precision_recall(result: Result, variant: str, scene: str) -> str:
    metrics = CENTRE_RULE if variant in WITHOUT_PLANES else BY_PIECES
    return _pair(result.level(variant, metric).mean(scene) for metric in metrics)


OVER = " / "


def bars_sheet(title: str, results: Sequence[Result], variant: str, bars: Sequence[Bound]) -> Sheet:
    """What is aimed at, and what came of it over the scenes of all results. A bar's metric may be
    one over another, run by run: "mma_m / mma_floor_m"."""
    rows = []
    for bar in bars:
        found = spread(_level(results, variant, bar.metric))
        scale, unit = (1.0, "") if OVER in bar.metric else unit_of(bar.metric)
        rows.append(
            (
                f"{bar.metric}{f' [{unit}]' if unit else ''}",
                f"{bar.comparison} {scale * bar.limit:g}",
                shown(found, scale, 3),
                "yes" if found is not None and bar.holds(found.mean) else "no",
            )
        )
    return Sheet(title, ("what", "aim", "mean [95 %]", "reached"), tuple(rows))


def _level(results: Sequence[Result], variant: str, name: str) -> Level:
    """Of the scenes of all results."""
    metric, _, below = name.partition(OVER)
    values: dict[str, tuple[float, ...]] = {}
    for result in results:
        for scene, of_seeds in result.level(variant, metric).values.items():
            under = result.level(variant, below).values[scene] if below else [1.0] * len(of_seeds)
            ratios = zip(of_seeds, under, strict=True)
            values[scene] = tuple(a / b if b else np.nan for a, b in ratios)
    return Level(variant, name, values, 0)
