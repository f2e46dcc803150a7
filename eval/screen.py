"""What a person sees in the terminal: progress, warnings, lines. Only the command line uses it."""

from __future__ import annotations

import logging
import sys
import time
import warnings
from types import TracebackType
from typing import TYPE_CHECKING

from rich.box import SIMPLE_HEAD
from rich.console import Console
from rich.markup import escape
from rich.progress import BarColumn, Progress, TextColumn
from rich.table import Table

if TYPE_CHECKING:
    from eval.comparing.tables import Sheet

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


def output() -> Console:
    """Standard output; wide enough for every table where no terminal limits it."""
    console = Console()
    return console if console.is_terminal else Console(width=WIDE)


def show_sheet(console: Console, sheet: Sheet) -> None:
    """A table of texts under its title."""
    from eval.comparing.tables import LEFT

    table = Table(box=SIMPLE_HEAD, padding=(0, 1, 0, 0))
    for name in sheet.head:
        table.add_column(escape(name), justify="left" if name in LEFT else "right")
    for place, row in enumerate(sheet.rows):
        if place in sheet.rules:
            table.add_section()
        table.add_row(*map(escape, row))
    line(console, sheet.title)
    console.print(table)


def line(console: Console, text: str) -> None:
    """A line as it is: no markup, no wrapping, so that scripts can read it."""
    console.print(text, markup=False, highlight=False, soft_wrap=True)


def number(value: float | str | None, form: str = "{}") -> str:
    """A value for people; whole numbers stay whole, what does not apply is a dash."""
    if value is None:
        return "-"
    return str(value) if isinstance(value, int | str) else form.format(value)
