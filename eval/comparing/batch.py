"""The runs of a scenario, one seed after the other, its table, and its verdict."""

from __future__ import annotations

import csv
import io
import json
from collections.abc import Callable, Iterator, Mapping
from contextlib import AbstractContextManager, contextmanager
from dataclasses import dataclass
from pathlib import Path

from eval.comparing.bounds import Check, check_bounds
from eval.comparing.scenario import Scenario
from eval.comparing.values import metric_names, value_of
from eval.files import write_text
from eval.folder import CONFIG_FILE, check_folder, clear_folder, config_values
from eval.metrics import SCHEMA, Metrics
from eval.outputs import read_metrics
from slam.core import InputError, RunError

Progress = Callable[[float, float], None]
Watch = Callable[[str], AbstractContextManager[Progress]]
"""Gives the progress of the run with that title."""

TABLE_FILE = "table.csv"
VERDICT_FILE = "verdict.json"


@dataclass(frozen=True)
class Outcome:
    """What came of a scenario. runs: seed -> metrics, of those that could be scored; failures:
    seed -> what went wrong; checks: every bound against every value; folder: of the files."""

    scenario: Scenario
    runs: Mapping[int, Metrics]
    failures: Mapping[int, str]
    checks: tuple[Check, ...]
    folder: Path

    @property
    def missed(self) -> tuple[Check, ...]:
        """The bounds that did not hold."""
        return tuple(check for check in self.checks if not check.held)

    @property
    def exit_status(self) -> int:
        """3 if a run failed, 1 if a bound was missed, else 0."""
        if self.failures:
            return RunError.exit_status
        return 1 if self.missed else 0


def run_scenario(scenario: Scenario, watch: Watch) -> Outcome:
    """Runs every seed; one that fails does not stop the others. Raises InputError before anything
    is written, and KeyboardInterrupt when the run that was stopped has been written."""
    from eval.run import run

    for folder in {scenario.folder: None} | {config.folder: None for config in scenario.runs}:
        check_folder(folder)
    runs, failures = {}, {}
    with _claimed(scenario):
        for config in scenario.runs:
            with watch(f"{scenario.name}, seed {config.seed}") as progress:
                try:
                    runs[config.seed] = run(config, progress).metrics
                except RunError as error:
                    failures[config.seed] = str(error)
                    if (file := config.folder / "metrics.json").exists():
                        runs[config.seed] = read_metrics(file)
            if len(scenario.seeds) > 1:
                write_text(scenario.folder / TABLE_FILE, table_csv(runs))
    checks = check_bounds(scenario.bounds, runs)
    outcome = Outcome(scenario, runs, failures, checks, scenario.folder)
    if checks:
        write_text(scenario.folder / VERDICT_FILE, verdict_json(outcome))
    return outcome


@contextmanager
def _claimed(scenario: Scenario) -> Iterator[None]:
    """Marks the folder around the seeds' own as ours, unless the first run is refused."""
    if len(scenario.seeds) == 1:
        yield
        return
    folder, made = scenario.folder, not scenario.folder.exists()
    clear_folder(folder)
    write_text(folder / CONFIG_FILE, batch_text(scenario))
    try:
        yield
    except InputError:
        if made and [path.name for path in folder.iterdir()] == [CONFIG_FILE]:
            (folder / CONFIG_FILE).unlink()
            folder.rmdir()
        raise


def batch_text(scenario: Scenario) -> str:
    """config.json of a folder around the seeds' own."""
    values = config_values(scenario.config)
    del values["seed"]
    expect = {bound.name: f"{bound.comparison} {bound.limit:g}" for bound in scenario.bounds}
    values |= {"seeds": list(scenario.seeds), "expect": expect}
    return json.dumps({"schema": SCHEMA} | values, indent=2) + "\n"


def table_csv(runs: Mapping[int, Metrics]) -> str:
    """One line a seed, one column a number of metrics.json; what does not apply is empty."""
    text = io.StringIO()
    names = [name for name in metric_names() if name != "seed"]
    lines = csv.writer(text, lineterminator="\n")
    lines.writerow(["seed", "status", *names])
    for seed, metrics in runs.items():
        values = (value_of(metrics, name) for name in names)
        lines.writerow([seed, metrics.status, *("" if v is None else repr(v) for v in values)])
    return text.getvalue()


def verdict_json(outcome: Outcome) -> str:
    """Every bound with the values that it was held against, and whether it held."""
    checks = [
        {
            "metric": check.bound.name,
            "expected": f"{check.bound.comparison} {check.bound.limit:g}",
            "seed": check.seed,
            "value": check.value,
            "held": check.held,
        }
        for check in outcome.checks
    ]
    failures = {str(seed): text for seed, text in outcome.failures.items()}
    return json.dumps({"schema": SCHEMA, "bounds": checks, "failures": failures}, indent=2) + "\n"
