"""Tables of the study and of the judgement: a line for each row, on a screen of 80 columns."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from rich.table import Table

    from eval.studies.choices import Operating, Row
    from eval.studies.edgelimits import EdgeLimit

Choices = Mapping[str, Callable[["Row"], str]]
"""Columns that say what a row is of: heading, and what of the row."""
TRAINED: Choices = {
    "buildings": lambda row: row.family,
    "features": lambda row: row.features,
    "networks": lambda row: row.networks,
    "trained on": lambda row: row.training_set,
}
STUDIED: Choices = {**TRAINED, "clustering": lambda row: row.clustering}
JUDGED: Choices = {"buildings": lambda row: row.family, "detector": lambda row: row.networks}
BOTH = "P     R"


def edges_table(rows: Sequence[Row], choices: Choices) -> Table:
    """Precision and recall of the edges and the calibration errors of both relations; rows that
    differ in what no column tells are one, if their numbers are."""
    lines = []
    for row in sorted(rows, key=lambda row: row.family):
        r = row.result
        lines.append(
            (
                *(of(row) for of in choices.values()),
                _both(r.room_edge_precision, r.room_edge_recall),
                _both(r.wall_edge_precision, r.wall_edge_recall),
                _both(r.room_calibration, r.wall_calibration),
            )
        )
    numbers = (f"room edges\n{BOTH}", f"wall edges\n{BOTH}", "calibration\nroom  wall")
    return _table(list(choices), numbers, list(dict.fromkeys(lines)))


def concepts_table(rows: Sequence[Row], choices: Choices) -> Table:
    """Precision and recall of rooms and walls."""
    lines = []
    for row in sorted(rows, key=lambda row: row.family):
        r = row.result
        lines.append(
            (
                *(of(row) for of in choices.values()),
                _both(r.room_precision, r.room_recall),
                _both(r.wall_precision, r.wall_recall),
            )
        )
    return _table(list(choices), (f"rooms\n{BOTH}", f"walls\n{BOTH}"), lines)


def thresholds_table(rows: Sequence[Operating]) -> Table:
    """Precision and recall of rooms and walls by the threshold of both."""
    lines = [
        (
            f"{row.threshold:.2f}",
            _both(row.room_precision, row.room_recall),
            _both(row.wall_precision, row.wall_recall),
        )
        for row in rows
    ]
    return _table(["threshold"], (f"rooms\n{BOTH}", f"walls\n{BOTH}"), lines)


def limits_table(rows: Sequence[EdgeLimit]) -> Table:
    """Room edges told right and wrong, by what was seen of the rooms."""
    lines = [
        (row.of, _both(row.precision, row.recall), str(row.wrong), f"{row.expected:.0f}")
        for row in rows
    ]
    return _table(["pairs of pieces"], (f"room edges\n{BOTH}", "wrong", "expected"), lines)


def _both(first: float, second: float) -> str:
    return f"{first:.3f} {second:.3f}"


def _table(
    choices: Sequence[str], numbers: Sequence[str], lines: Sequence[tuple[str, ...]]
) -> Table:
    from rich.table import Table

    table = Table(box=None, padding=(0, 1, 0, 0))
    for name in choices:
        table.add_column(name, no_wrap=True)
    for name in numbers:
        table.add_column(name, justify="right", no_wrap=True)
    for line in lines:
        table.add_row(*line)
    return table
