"""Tables of an ablation: as data once, then for the terminal, Markdown, LaTeX and CSV."""

from __future__ import annotations

import csv
import io
from collections.abc import Sequence
from dataclasses import dataclass

from eval.comparing.ablation import Comparison, Level, Result
from eval.comparing.stats import Interval

LEFT = (
    *("variant", "metric", "against", "verdict", "scene", "method", "measure", "what", "world"),
    *("the paper says", "what is built here"),
)
"""Columns of words: they stand to the left, numbers to the right."""
MINUS = "\N{MINUS SIGN}"


@dataclass(frozen=True)
class Sheet:
    """A table of texts. head: one a column; rows: as many each; rules: rows with a line above."""

    title: str
    head: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]
    rules: frozenset[int] = frozenset()

    def without(self, *names: str) -> Sheet:
        """A narrower table."""
        kept = [place for place, name in enumerate(self.head) if name not in names]
        rows = tuple(tuple(row[place] for place in kept) for row in self.rows)
        return Sheet(self.title, tuple(self.head[place] for place in kept), rows, self.rules)


def level_sheet(result: Result, metric: str) -> Sheet:
    """A metric's mean and standard deviation over seeds: variants down, scenes across."""
    scenes = result.ablation.scenes
    scale, unit = unit_of(metric)
    rows = []
    for variant in result.ablation.variants:
        level = result.level(variant.name, metric)
        cells = [_mean_and_deviation(level, scene, scale) for scene in scenes]
        rows.append((variant.name, *cells, number(level.overall, scale), str(level.failed)))
    seeds = len(result.ablation.seeds)
    of = f"{seeds} seeds" if seeds > 1 else "one seed"
    title = f"{metric}{f' [{unit}]' if unit else ''}: mean and standard deviation of {of}"
    return Sheet(title, ("variant", *scenes, "mean", "failed"), tuple(rows))


def difference_sheet(result: Result) -> Sheet:
    """Every comparison: the difference, its interval, tests and sizes."""
    head = (
        *("metric", "variant", "against", "difference", "95 % interval", "%", "effect"),
        *("below/above", "scenes", "p", "p adjusted", "pairs"),
    )
    rows, rules, last = [], [], ""
    for place, comparison in enumerate(result.comparisons):
        if comparison.metric != last and place:
            rules.append(place)
        last = comparison.metric
        rows.append(_difference_row(comparison))
    return Sheet("Paired differences (variant less against)", head, tuple(rows), frozenset(rules))


def _difference_row(comparison: Comparison) -> tuple[str, ...]:
    c, d = comparison, comparison.difference
    scale, unit = unit_of(c.metric)
    names = (f"{c.metric}{f' [{unit}]' if unit else ''}", c.variant, c.against)
    if d is None:
        return (*names, *("-",) * 8, f"0 ({c.lost} lost)")
    lost = f" ({c.lost} lost)" if c.lost else ""
    return (
        *names,
        signed(d.mean, scale),
        _interval(d.interval, scale),
        signed(d.percent, 1.0, 1),
        signed(d.effect, 1.0, 2),
        f"{d.pairs[0]}/{d.pairs[1]}",
        f"{d.scenes[0]}/{d.scenes[1]}",
        _p(d.p_rank),
        _p(c.p_holm),
        f"{d.count}{lost}",
    )


def unit_of(metric: str) -> tuple[float, str]:
    """Factor and unit in which a metric is shown: lengths in centimetres."""
    return (100.0, "cm") if metric.endswith("_m") else (1.0, "")


def _mean_and_deviation(level: Level, scene: str, scale: float) -> str:
    mean, deviation = level.mean(scene), level.deviation(scene)
    if mean is None:
        return "-"
    return number(mean, scale) + ("" if deviation is None else f" ± {number(deviation, scale)}")


def number(value: float | None, scale: float = 1.0, digits: int = 3) -> str:
    """A number in its unit; "-" where there is none."""
    return "-" if value is None else f"{scale * value:.{digits}f}"


def signed(value: float | None, scale: float = 1.0, digits: int = 3) -> str:
    """A difference: its sign always shows, and nothing is not written as minus zero."""
    if value is None:
        return "-"
    text = f"{scale * value:+.{digits}f}"
    text = text[1:] if float(text) == 0.0 else text
    return text.replace("-", MINUS)


def _interval(interval: Interval | None, scale: float) -> str:
    if interval is None:
        return "-"
    mark = " *" if interval.clear_of_zero else ""
    return f"{signed(interval.low, scale)} to {signed(interval.high, scale)}{mark}"


def _p(p: float | None) -> str:
    if p is None:
        return "-"
    return "<0.001" if p < 0.001 else f"{p:.3f}"


# --- as text --------------------------------------------------------------------------------------

NOTE = (
    "Difference: mean over seeds, then over scenes. Interval: bootstrap over the seeds of each "
    "scene, scenes fixed; * where it is clear of zero. Effect: mean over the standard deviation of "
    "the paired differences within scenes. p: Wilcoxon signed-rank test over all pairs; adjusted: "
    "Holm, over the comparisons in one metric."
)


def markdown(sheets: Sequence[Sheet], note: str = NOTE) -> str:
    """Sheets as Markdown, with what the columns mean."""
    parts = [f"## {s.title}\n\n{_markdown_table(s)}" for s in sheets]
    return "\n".join([*parts, f"{note}\n" if note else ""])


def _markdown_table(sheet: Sheet) -> str:
    align = tuple("---" if name in LEFT else "---:" for name in sheet.head)
    lines = [sheet.head, align, *sheet.rows]
    return "".join("| " + " | ".join(_escaped(c, "|") for c in line) + " |\n" for line in lines)


def _escaped(text: str, signs: str) -> str:
    for sign in signs:
        text = text.replace(sign, "\\" + sign)
    return text


def latex(sheets: Sequence[Sheet]) -> str:
    """Sheets as LaTeX tables (packages booktabs and graphicx)."""
    return "\n".join(_latex_table(sheet) for sheet in sheets)


def _latex_table(sheet: Sheet) -> str:
    columns = "".join("l" if name in LEFT else "r" for name in sheet.head)
    lines = []
    for place, row in enumerate(sheet.rows):
        lines += ["\\midrule"] if place in sheet.rules else []
        lines.append(" & ".join(map(_latex, row)) + r" \\")
    body = "\n".join(lines)
    return (
        "\\begin{table}\n\\centering\n\\resizebox{\\linewidth}{!}{%\n"
        f"\\begin{{tabular}}{{{columns}}}\n\\toprule\n"
        + " & ".join(map(_latex, sheet.head))
        + f" \\\\\n\\midrule\n{body}\n\\bottomrule\n\\end{{tabular}}}}\n"
        f"\\caption{{{_latex(sheet.title)}.}}\n\\end{{table}}\n"
    )


def _latex(text: str) -> str:
    text = _escaped(text, "_%&#$")
    for sign, command in ((MINUS, "$-$"), ("±", r"$\pm$"), ("<", "$<$"), (">", "$>$")):
        text = text.replace(sign, command)
    return text


CSV_COLUMNS = (
    *("metric", "variant", "against", "pairs", "lost", "against_mean", "difference"),
    *("low", "high", "low_across_scenes", "high_across_scenes", "percent", "effect"),
    *("pairs_below", "pairs_above", "scenes_below", "scenes_above"),
    *("p_wilcoxon", "p_holm", "p_sign", "p_t"),
)


def comparisons_csv(result: Result) -> str:
    """Every comparison with all its numbers, in the metrics' own units; what there is not is
    empty."""
    text = io.StringIO()
    lines = csv.writer(text, lineterminator="\n")
    lines.writerow(CSV_COLUMNS)
    lines.writerows([_csv_row(comparison) for comparison in result.comparisons])
    return text.getvalue()


def _csv_row(c: Comparison) -> list[str | float | None]:
    d = c.difference
    names: list[str | float | None] = [c.metric, c.variant, c.against]
    if d is None:
        return [*names, 0, c.lost, *[None] * (len(CSV_COLUMNS) - 5)]
    numbers = (d.count, c.lost, d.base, d.mean, *_ends(d.interval), *_ends(d.across_scenes))
    counts = (*d.pairs, *d.scenes)
    return [*names, *numbers, d.percent, d.effect, *counts, d.p_rank, c.p_holm, d.p_sign, d.p_mean]


def _ends(interval: Interval | None) -> tuple[float | None, float | None]:
    return (None, None) if interval is None else (interval.low, interval.high)
