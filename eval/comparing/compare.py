"""Two sets of results: what moved beyond noise, and whether for the worse."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from eval.comparing.ablation import METRICS
from eval.comparing.stats import Difference, Samples, holm, paired, unpaired
from eval.comparing.tables import Sheet, signed, unit_of
from eval.comparing.values import sense, value_of
from eval.config import RunConfig
from eval.folder import CONFIG_FILE, read_config
from eval.metrics import Metrics
from eval.names import refuse
from eval.outputs import read_metrics
from eval.sweep.job import Row
from eval.sweep.store import MARK_FILE, planned, read_rows

GATE = (*METRICS, "rooms.mean_iou", "rooms.piece_f1", "map_completeness")
"""What is compared where nothing else is asked for: no times, which depend on the machine."""

SIGNIFICANCE = 0.05
"""Of all questions of a comparison together (Holm)."""
TOLERANCE = 1.0
"""Percent below which a difference does not matter, however sure it is."""

SEED = 20_240_502

Group = tuple[object, ...]
Runs = Mapping[Group, Mapping[tuple[str, int], Row]]
"""Rows by what was run, and by scene and seed."""

WHAT = ("detector", "odometry", "layers", "factors", "loops")
WHERE = ("conditions", "sensor", "duration", "speed", "storey", "start")


def read_results(path: Path) -> tuple[Row, ...]:
    """The runs of a sweep's folder; or every run in or below a folder. Raises InputError."""
    if not path.is_dir():
        refuse(f"{path}: expected a folder with results")
    if (path / MARK_FILE).is_file():
        rows = tuple(read_rows(path, planned(path)).values())
    else:
        rows = tuple(_run_row(file) for file in sorted(path.rglob("metrics.json")))
    if not rows:
        refuse(f"{path}: expected the folder of a sweep or of runs, found no results")
    return rows


def _run_row(file: Path) -> Row:
    """A run's folder as a row."""
    metrics = read_metrics(file)
    beside = file.with_name(CONFIG_FILE)
    config = read_config(beside) if beside.is_file() else _config(metrics)
    return Row(config, metrics.status, metrics.error, metrics.wall_s or 0.0, metrics)


def _config(metrics: Metrics) -> RunConfig:
    """What metrics say of their run."""
    names = ("scene", "seed", "sensor", "conditions")
    return RunConfig(**{name: getattr(metrics, name) for name in names})


def grouped(rows: Sequence[Row]) -> Runs:
    """Rows by what was run, then by scene (its file's name) and seed."""
    groups: dict[Group, dict[tuple[str, int], Row]] = {}
    for row in rows:
        group = tuple(getattr(row.config, name) for name in (*WHAT, *WHERE))
        groups.setdefault(group, {})[Path(row.config.scene).stem, row.config.seed] = row
    return groups


@dataclass(frozen=True)
class Change:
    """B less A in one metric of one group. lost: pairs in which A has a value and B has none;
    verdict: better | worse | moved | same | unknown (too few seeds to tell)."""

    group: str
    metric: str
    difference: Difference | None
    is_paired: bool
    lost: int
    p: float | None
    verdict: str


@dataclass(frozen=True)
class Verdict:
    """All changes; left_out: runs of either set that the other has no partner for."""

    changes: tuple[Change, ...]
    left_out: int

    @property
    def worse(self) -> tuple[Change, ...]:
        """The regressions."""
        return tuple(change for change in self.changes if change.verdict == "worse")


def compare(
    a: Sequence[Row],
    b: Sequence[Row],
    metrics: Sequence[str] = GATE,
    tolerance: float = TOLERANCE,
) -> Verdict:
    """B against A. Runs pair by scene and seed; scenes whose seeds differ are compared unpaired.

    Raises InputError where nothing can be compared, or where no metric can be judged.
    """
    pairs = _matched(grouped(a), grouped(b))
    raw = [_change(group, m, left, right) for group, left, right in pairs for m in metrics]
    adjusted = holm([change.p for change in raw])
    changes = [
        replace(change, p=p, verdict=_verdict(change, p, tolerance))
        for change, p in zip(raw, adjusted, strict=True)
    ]
    if all(change.verdict == "unknown" for change in changes):
        refuse("compare: expected at least two seeds of a scene in each set, to know the noise")
    used = sum(len(left) + len(right) for _, left, right in pairs)
    return Verdict(tuple(changes), len(a) + len(b) - used)


Matched = tuple[str, Mapping[tuple[str, int], Row], Mapping[tuple[str, int], Row]]


def _matched(a: Runs, b: Runs) -> list[Matched]:
    """Groups that both have, or the only one of each set, cut to common scenes (and seeds)."""
    groups = [(group, group) for group in a if group in b]
    if not groups and len(a) == len(b) == 1 and _where(next(iter(a))) == _where(next(iter(b))):
        groups = [(next(iter(a)), next(iter(b)))]
    if not groups:
        refuse("compare: the two sets have no variant in common, under the same conditions")
    names = _names([group for group, _ in groups])
    matched = [
        (name, *_common(a[left], b[right]))
        for name, (left, right) in zip(names, groups, strict=True)
    ]
    if not any(left for _, left, _ in matched):
        refuse("compare: the two sets have no scene in common")
    return [part for part in matched if part[1]]


def _where(group: Group) -> Group:
    return group[len(WHAT) :]


def _names(groups: Sequence[Group]) -> list[str]:
    """Each group by the fields in which they differ."""
    varied = [
        place for place, values in enumerate(zip(*groups, strict=True)) if len(set(values)) > 1
    ]
    return [", ".join(str(group[place]) for place in varied) for group in groups]


def _common(
    a: Mapping[tuple[str, int], Row], b: Mapping[tuple[str, int], Row]
) -> tuple[Mapping[tuple[str, int], Row], Mapping[tuple[str, int], Row]]:
    keys = [key for key in a if key in b]
    if keys:
        return {key: a[key] for key in keys}, {key: b[key] for key in keys}
    scenes = {scene for scene, _ in a} & {scene for scene, _ in b}
    left = {key: row for key, row in a.items() if key[0] in scenes}
    right = {key: row for key, row in b.items() if key[0] in scenes}
    return left, right


def _change(
    group: str,
    metric: str,
    a: Mapping[tuple[str, int], Row],
    b: Mapping[tuple[str, int], Row],
) -> Change:
    is_paired = a.keys() == b.keys()
    left, right = _values(a, metric), _values(b, metric)
    lost = len(left.keys() - right.keys()) if is_paired else 0
    if is_paired:
        left = {key: value for key, value in left.items() if key in right}
        right = {key: right[key] for key in left}
    x, y = _samples(left), _samples(right)
    if not x or x.keys() != y.keys():
        return Change(group, metric, None, is_paired, lost, None, "unknown")
    test = paired if is_paired else unpaired
    difference = test(y, x, np.random.default_rng(SEED))
    return Change(group, metric, difference, is_paired, lost, difference.p_mean, "unknown")


def _values(rows: Mapping[tuple[str, int], Row], metric: str) -> Mapping[tuple[str, int], float]:
    """The values that there are; a run that failed has none."""
    found = {
        key: value_of(row.metrics, metric)
        for key, row in rows.items()
        if row.metrics is not None and row.status == "complete"
    }
    return {key: value for key, value in found.items() if value is not None}


def _samples(values: Mapping[tuple[str, int], float]) -> Samples:
    scenes = sorted({scene for scene, _ in values})
    return {s: np.array([v for (scene, _), v in values.items() if scene == s]) for s in scenes}


def _verdict(change: Change, p: float | None, tolerance: float) -> str:
    if change.lost:
        return "worse"
    d = change.difference
    if d is None:
        return "unknown"
    if d.mean == 0.0 and (change.is_paired and d.pairs == (0, 0)):
        return "same"
    if p is None:
        return "unknown"
    small = d.percent is not None and abs(d.percent) < tolerance
    if p >= SIGNIFICANCE or small:
        return "same"
    direction = sense(change.metric) * d.mean
    return "moved" if direction == 0.0 else "better" if direction > 0.0 else "worse"


# --- for people -----------------------------------------------------------------------------------


def change_sheet(verdict: Verdict) -> Sheet:
    """A row a change."""
    head = ("metric", "variant", "A", "B less A", "%", "95 % interval", "p adjusted", "pairs")
    rows = tuple(_row(change) for change in verdict.changes)
    return Sheet("B against A", (*head, "verdict"), rows)


def _row(change: Change) -> tuple[str, ...]:
    scale, unit = unit_of(change.metric)
    names = (f"{change.metric}{f' [{unit}]' if unit else ''}", change.group)
    said = f"{change.verdict}: {change.lost} without a value" if change.lost else change.verdict
    d = change.difference
    if d is None:
        return (*names, *("-",) * 6, said)
    ends = "-"
    if d.interval is not None:
        ends = f"{signed(d.interval.low, scale)} to {signed(d.interval.high, scale)}"
    p = "-" if change.p is None else f"{change.p:.3f}"
    count = str(d.count) if change.is_paired else f"{d.count} (unpaired)"
    base = f"{scale * d.base:.3f}"
    return (*names, base, signed(d.mean, scale), signed(d.percent, 1.0, 1), ends, p, count, said)


def regressions(verdict: Verdict) -> Iterator[str]:
    """One line for each."""
    for change in verdict.worse:
        of = f" ({change.group})" if change.group else ""
        d = change.difference
        if change.lost or d is None:
            yield f"{change.metric}{of}: {change.lost} runs have no value any more"
        else:
            yield f"{change.metric}{of}: {d.base:.6g} became {d.base + d.mean:.6g}"
