"""What watching costs: the same run headless, recorded, served and looked at, by turns."""

from __future__ import annotations

import json
import resource
import subprocess
import sys
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager, nullcontext
from dataclasses import dataclass
from pathlib import Path
from statistics import median

from eval.report.photo import browser, open_tab
from slam.core import RunError

WAYS: Mapping[str, tuple[str, ...]] = {
    "headless": (),
    "--save": ("--save",),
    "--serve": ("--serve",),
    "page open": ("--serve",),
}
"""Options of ``roomloop run`` for each; the first is what the others are compared with."""
LOOKED_AT = "page open"
"""Where a browser shows the page, which draws on this machine's processor."""
SAID = "watch at "
"""What stands before the page's address."""


@dataclass(frozen=True)
class RunCost:
    """wall: of the loop alone; processor: of the run with all its processes, start-up too [s];
    recording: size of what it saved [MB]."""

    wall: float
    processor: float
    recording: float


def by_turns(arguments: Sequence[str], rounds: int, folder: Path) -> dict[str, list[RunCost]]:
    """The costs of every way to watch a run, round by round, each run in a process of its own.

    arguments: of ``roomloop run``. Where there is no browser, nobody looks at a page. Raises
    RunError with a run's last words if it failed.
    """
    ways = {way: options for way, options in WAYS.items() if way != LOOKED_AT or browser()}
    costs: dict[str, list[RunCost]] = {way: [] for way in ways}
    for _ in range(rounds):
        for way, options in ways.items():
            out = folder / way.lstrip("-").replace(" ", "-")
            costs[way].append(_cost([*arguments, *options], out, way == LOOKED_AT))
    return costs


def middle(costs: Sequence[RunCost]) -> RunCost:
    """The medians."""
    return RunCost(
        median(cost.wall for cost in costs),
        median(cost.processor for cost in costs),
        median(cost.recording for cost in costs),
    )


def _cost(arguments: Sequence[str], out: Path, looked_at: bool = False) -> RunCost:
    command = [sys.executable, "-m", "eval.cli", "run", *arguments, "--out", str(out)]
    before = _processor()
    with (
        subprocess.Popen(
            command, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True
        ) as run,
        _looking(run) if looked_at else nullcontext(),
    ):
        _, said = run.communicate()
    spent = _processor() - before
    if run.returncode:
        raise RunError(f"{' '.join(arguments)}: {said.strip().splitlines()[-1]}")
    wall = json.loads((out / "metrics.json").read_text())["wall_s"]
    recording = out / "recording.rrd"
    size = recording.stat().st_size / 1e6 if recording.exists() else 0.0
    return RunCost(float(wall), spent, size)


@contextmanager
def _looking(run: subprocess.Popen[str]) -> Iterator[None]:
    """A browser shows the run's page."""
    assert run.stderr is not None
    lines = (line.strip() for line in run.stderr)
    address = next((line.removeprefix(SAID) for line in lines if line.startswith(SAID)), None)
    if address is None:
        raise RunError(f"the run does not say {SAID!r}: no page to look at")
    with open_tab(address, (1600, 900)):
        yield


def _processor() -> float:
    """Seconds of processor of all processes that this one has started and that have ended."""
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return used.ru_utime + used.ru_stime
