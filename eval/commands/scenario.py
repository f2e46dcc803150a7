"""``roomloop run`` with a scenario file, or with several seeds."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from typing import TYPE_CHECKING

from eval.config import RunConfig
from eval.names import refuse

if TYPE_CHECKING:
    from rich.console import Console

    from eval.comparing.batch import Outcome, Progress
    from eval.comparing.scenario import Scenario


def run_command(scene: str, seeds: str | None, flags: Mapping[str, object]) -> int:
    """Runs it all and shows what came of it; the exit status. flags: those that were given."""
    from rich.console import Console

    from eval.comparing.batch import run_scenario
    from eval.screen import RunProgress, our_warnings_only

    screen = Console(stderr=True)
    our_warnings_only(screen)
    scenario = _scenario(scene, seeds, flags)

    @contextmanager
    def watch(title: str) -> Iterator[Progress]:
        with RunProgress(title, screen) as progress:
            yield progress

    outcome = run_scenario(scenario, watch)
    _show(Console(), outcome)
    _say_what_is_wrong(screen, outcome)
    return outcome.exit_status


def _scenario(scene: str, seeds: str | None, flags: Mapping[str, object]) -> Scenario:
    from dataclasses import replace

    from eval.comparing.scenario import is_scenario, of_flags, parse_seeds, read_scenario

    if seeds is not None and "seed" in flags:
        refuse("seeds: expected --seed or --seeds, got both")
    if is_scenario(scene):
        scenario = read_scenario(scene, **flags)
        return scenario if seeds is None else replace(scenario, seeds=parse_seeds(seeds))
    assert seeds is not None
    return of_flags(RunConfig(scene=scene, **flags), parse_seeds(seeds))  # type: ignore[arg-type]


def _show(console: Console, outcome: Outcome) -> None:
    from eval.comparing.runtables import seeds_table, show_result
    from eval.screen import line

    if len(outcome.runs) == 1:
        (metrics,) = outcome.runs.values()
        show_result(console, metrics, outcome.folder)
    else:
        console.print(seeds_table(outcome.scenario, outcome.runs))
        line(console, f"files: {outcome.folder}")
    if outcome.checks:
        held = len(outcome.checks) - len(outcome.missed)
        line(console, f"bounds: {held} of {len(outcome.checks)} hold")


def _say_what_is_wrong(screen: Console, outcome: Outcome) -> None:
    from eval.screen import line

    for seed, error in outcome.failures.items():
        line(screen, f"roomloop: seed {seed} failed: {' '.join(error.split())}")
    for check in outcome.missed:
        line(screen, f"roomloop: missed: {check}")
