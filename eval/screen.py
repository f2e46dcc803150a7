"""What a person sees in the terminal: progress, warnings, tables. Only the command line uses it."""

from __future__ import annotations

import logging
import sys
import time
import warnings
from collections.abc import Mapping, Sequence
from dataclasses import fields
from pathlib import Path
from types import TracebackType
from typing import TYPE_CHECKING

from rich.box import SIMPLE_HEAD
from rich.console import Console
from rich.markup import escape
from rich.progress import BarColumn, Progress, TextColumn
from rich.table import Table

if TYPE_CHECKING:
    from eval.metrics import Metrics, StageTime
    from eval.scenario import Scenario
    from eval.tables import Sheet
    from worlds.catalogue import SceneCounts

OUR_PACKAGES = ("worlds", "sim", "slam", "semantics", "eval")
PLAIN_STEPS = 10
WIDE = 400
"""Columns of a table that is not shown on a terminal, at most."""


class RunProgress:
    """Simulated and wall time of a run on standard error: a bar, or lines where no terminal is.

    Call it with (simulated seconds, of how many); use it as a context manager.
    """

    def __init__(self, title: str, console: Console | None = None, unit: str = "s simulated"):
        self._console = console or Console(stderr=True)
        self._title, self._unit = title, unit
        self._start = time.perf_counter()
        self._told = 0
        self._bar: Progress | None = None

    def __enter__(self) -> RunProgress:
        if self._console.is_terminal:
            columns = (
                TextColumn("{task.description}"),
                BarColumn(),
                TextColumn("{task.fields[say]}"),
            )
            self._bar = Progress(*columns, console=self._console, transient=True)
            self._task = self._bar.add_task(self._title, total=None, say="getting ready")
            self._bar.start()
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        if self._bar is not None:
            self._bar.stop()

    def __call__(self, done: float, total: float) -> None:
        """done, total: e.g. simulated seconds."""
        total = max(total, done)
        wall = time.perf_counter() - self._start
        say = f"{done:.1f} of {total:.1f} {self._unit}, {wall:.0f} s wall"
        if self._bar is not None:
            self._bar.update(self._task, completed=done, total=total, say=say)
            return
        step = int(PLAIN_STEPS * done / total) if total > 0.0 else 0
        if step > self._told:
            self._told = step
            self._say(f"{self._title}: {say}")

    def _say(self, text: str) -> None:
        line(self._console, text)


class _WarningLines(logging.Handler):
    """One line a warning, written so that a progress bar is not torn."""

    def __init__(self, console: Console):
        super().__init__(logging.WARNING)
        self._console = console

    def emit(self, record: logging.LogRecord) -> None:
        line(self._console, f"roomloop: {record.levelname.lower()}: {record.getMessage()}")


def our_warnings_only(console: Console) -> None:
    """Shows what our packages warn of through logging, and keeps libraries quiet."""
    if not sys.warnoptions:
        warnings.simplefilter("ignore")
    logging.getLogger().setLevel(logging.ERROR)
    for name in OUR_PACKAGES:
        logger = logging.getLogger(name)
        logger.setLevel(logging.WARNING)
        logger.handlers = [_WarningLines(console)]
        logger.propagate = False


# --- tables ---------------------------------------------------------------------------------------


def counts_table(scenes: Sequence[SceneCounts]) -> Table:
    """The catalogue: what each scene holds."""
    table = Table("scene", "rooms", "of which", box=SIMPLE_HEAD, padding=0)
    for column in ("doors", "storeys", "extent m", "area m2"):
        table.add_column(column, justify="right")
    for scene in scenes:
        table.add_row(
            scene.name,
            str(scene.room_total),
            ", ".join(f"{count} {shape}" for shape, count in scene.rooms),
            str(scene.doors),
            str(scene.storeys),
            "{:.1f} x {:.1f}".format(*scene.size),
            f"{scene.area:.1f}",
        )
    return table


def summary_table(metrics: Metrics) -> Table:
    """What a run scored, in six lines."""
    m, rooms, walls = metrics, metrics.rooms, metrics.walls
    table = Table("", box=SIMPLE_HEAD)
    table.add_column("precision", justify="right")
    table.add_column("recall", justify="right")
    table.add_column("")
    table.add_row(
        "rooms",
        number(rooms.precision, "{:.2f}"),
        number(rooms.recall, "{:.2f}"),
        f"{number(rooms.true_positive, '{:g}')} of {number(rooms.detected, '{:g}')} right, "
        f"{number(rooms.entered)} of {number(rooms.truth)} entered, "
        f"IoU {number(rooms.mean_iou, '{:.2f}')}",
    )
    table.add_row(
        "walls",
        number(walls.precision, "{:.2f}"),
        number(walls.recall, "{:.2f}"),
        f"{number(walls.true_positive)} of {number(walls.detected)} right, "
        f"{number(walls.truth)} to be found",
    )
    for name, text in (
        ("trajectory", f"ATE {_cm(m.ate_m)} (odometry alone {_cm(m.ate_odometry_m)})"),
        ("map", f"MMA {_cm(m.mma_m)} (sensor alone {_cm(m.mma_floor_m)})"),
        ("planes", f"RMSE {_cm(m.plane_rmse_m)}"),
        (
            "covariances",
            f"NEES of keyframes {number(m.consistency.keyframes.mean, '{:.2f}')}, "
            f"of planes {number(m.consistency.planes.mean, '{:.2f}')} (1: honest)",
        ),
        (
            "first room",
            f"after {number(m.first_room_s, '{:.1f} s')}; "
            f"each: median {number(m.room_latency_s.median, '{:.1f} s')}",
        ),
    ):
        table.add_row(name, "", "", text)
    return table


def stages_table(metrics: Metrics) -> Table:
    """Where the time went."""
    table = Table("stage", box=SIMPLE_HEAD)
    for column in ("median ms", "p95 ms", "total s"):
        table.add_column(column, justify="right")
    for item in fields(metrics.stages):
        stage: StageTime = getattr(metrics.stages, item.name)
        times = (stage.median_ms, stage.p95_ms, stage.total_s)
        table.add_row(item.name, *(number(value, "{:.1f}") for value in times))
    return table


SUMMARY = (
    *("rooms.precision", "rooms.recall", "walls.precision", "walls.recall"),
    *("ate_m", "ate_odometry_m", "mma_m", "plane_rmse_m", "first_room_s"),
)
"""What a table of several runs shows where nothing else is asked for."""


def seeds_table(scenario: Scenario, runs: Mapping[int, Metrics]) -> Table:
    """One row a seed, and the mean: of what is bounded, or of ``SUMMARY``."""
    from eval.bounds import mean_of
    from eval.values import value_of

    names = list(dict.fromkeys(bound.metric for bound in scenario.bounds)) or list(SUMMARY)
    table = Table("seed", "status", box=SIMPLE_HEAD, title=scenario.name, title_justify="left")
    for name in names:
        table.add_column(name, justify="right")
    columns = [[value_of(metrics, name) for metrics in runs.values()] for name in names]
    for place, (seed, metrics) in enumerate(runs.items()):
        table.add_row(
            str(seed), metrics.status, *(number(column[place], "{:.4g}") for column in columns)
        )
    table.add_section()
    table.add_row("mean", "", *(number(mean_of(column), "{:.4g}") for column in columns))
    return table


def output() -> Console:
    """Standard output; wide enough for every table where no terminal limits it."""
    console = Console()
    return console if console.is_terminal else Console(width=WIDE)


def show_sheet(console: Console, sheet: Sheet) -> None:
    """A table of texts under its title."""
    from eval.tables import LEFT

    table = Table(box=SIMPLE_HEAD, padding=(0, 1, 0, 0))
    for name in sheet.head:
        table.add_column(escape(name), justify="left" if name in LEFT else "right")
    for place, row in enumerate(sheet.rows):
        if place in sheet.rules:
            table.add_section()
        table.add_row(*map(escape, row))
    line(console, sheet.title)
    console.print(table)


def show_result(console: Console, metrics: Metrics, folder: Path) -> None:
    """The tables of a finished run, and where its files are."""
    m = metrics
    line(console, f"{m.scene}, {m.detector}, seed {m.seed}: {m.status}")
    console.print(summary_table(m))
    line(
        console,
        f"{number(m.simulated_s, '{:.1f}')} s simulated in {number(m.wall_s, '{:.1f}')} s: "
        f"{number(m.real_time_factor, '{:.1f}')} times real time",
    )
    console.print(stages_table(m))
    line(console, f"files: {folder}")


def line(console: Console, text: str) -> None:
    """A line as it is: no markup, no wrapping, so that scripts can read it."""
    console.print(text, markup=False, highlight=False, soft_wrap=True)


def number(value: float | str | None, form: str = "{}") -> str:
    """A value for people; whole numbers stay whole, what does not apply is a dash."""
    if value is None:
        return "-"
    return str(value) if isinstance(value, int | str) else form.format(value)


def _cm(metres: float | None) -> str:
    return "-" if metres is None else f"{100.0 * metres:.1f} cm"
