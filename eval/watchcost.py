"""What watching costs: the same run headless, recorded and served, by turns."""

from __future__ import annotations

import json
import resource
import subprocess
import sys
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from statistics import median

from slam.core import RunError

WAYS: Mapping[str, tuple[str, ...]] = {
    "headless": (),
    "--save": ("--save",),
    "--serve": ("--serve",),
}
"""Options of ``roomloop run`` for each; the first is what the others are compared with."""


@dataclass(frozen=True)
class RunCost:
    """wall: of the loop alone; processor: of the run with all its processes, start-up too [s];
    recording: size of what it saved [MB]."""

    wall: float
    processor: float
    recording: float


def by_turns(arguments: Sequence[str], rounds: int, folder: Path) -> dict[str, list[RunCost]]:
    """The costs of every way to watch a run, round by round, each run in a process of its own.

    arguments: of ``roomloop run``. Raises RunError with a run's last words if it failed.
    """
    costs: dict[str, list[RunCost]] = {way: [] for way in WAYS}
    for _ in range(rounds):
        for way, options in WAYS.items():
            costs[way].append(_cost([*arguments, *options], folder / way.lstrip("-")))
    return costs


def middle(costs: Sequence[RunCost]) -> RunCost:
    """The medians."""
    return RunCost(
        median(cost.wall for cost in costs),
        median(cost.processor for cost in costs),
        median(cost.recording for cost in costs),
    )


def _cost(arguments: Sequence[str], out: Path) -> RunCost:
    command = [sys.executable, "-m", "eval.cli", "run", *arguments, "--out", str(out)]
    before = _processor()
    ended = subprocess.run(command, capture_output=True, text=True, check=False)
    spent = _processor() - before
    if ended.returncode:
        raise RunError(f"{' '.join(arguments)}: {ended.stderr.strip().splitlines()[-1]}")
    wall = json.loads((out / "metrics.json").read_text())["wall_s"]
    recording = out / "recording.rrd"
    size = recording.stat().st_size / 1e6 if recording.exists() else 0.0
    return RunCost(float(wall), spent, size)


def _processor() -> float:
    """Seconds of processor of all processes that this one has started and that have ended."""
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return used.ru_utime + used.ru_stime
