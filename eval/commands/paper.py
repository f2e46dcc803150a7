"""``roomloop paper``: the paper's tables and figures, ours beside theirs."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from eval.config import RunConfig
from eval.names import refuse

if TYPE_CHECKING:
    from eval.comparing.ablation import Result
    from eval.comparing.tables import Sheet
    from eval.paper.figures import Panel
    from eval.paper.study import Group, Measured

Option = typer.Option

SEEDS = "0-4"
QUICK_SEEDS = "0,1"
CATALOGUE, FRESH, BEYOND, PLANS = "paper", "fresh", "beyond", "plans"
TITLES = {
    CATALOGUE: "The paper's results, measured here",
    FRESH: "Fresh buildings",
    BEYOND: "Beyond the paper",
    PLANS: "Other buildings",
}
FIGURE_SCENES = ("SE3", "RC2F2")


def paper(
    quick: Annotated[
        bool, Option("--quick", help="A trial: few scenes, two seeds, 30 s each.")
    ] = False,
    fresh: Annotated[
        bool,
        Option("--fresh", help="Instead: 20 buildings drawn by the SHA-256 of the weights file."),
    ] = False,
    beyond: Annotated[
        bool,
        Option("--beyond", help="Instead: worlds of other kinds, and each building condition."),
    ] = False,
    plans: Annotated[
        str | None,
        Option(help="For --beyond, these alone: plan files or folders of them, as a.json,plans."),
    ] = None,
    seeds: Annotated[
        str | None, Option(help=f"As 0,1,2 or 0-9 (default: {SEEDS}; quick: {QUICK_SEEDS}).")
    ] = None,
    out: Annotated[Path | None, Option(help="The results (default: runs/paper).")] = None,
    workers: Annotated[int | None, Option(help="Processes (default: one a core).")] = None,
) -> int:
    """The paper's tables and figures, measured here, beside its own numbers.

    Results are kept in OUT: the same command goes on after an interruption. Exit status 3 if a run
    failed; the reports tell of it.
    """
    from rich.console import Console

    from eval.commands.ablate import SweepWatch, check_runs
    from eval.comparing.scenario import parse_seeds
    from eval.paper.keep import RUN_AND_KEEP
    from eval.paper.study import measure
    from eval.screen import line, our_warnings_only, output
    from eval.sweep.engine import SweepConfig

    if fresh and (beyond or plans is not None):
        refuse("fresh: expected --fresh or --beyond, got both")
    if plans is not None and not beyond:
        refuse("plans: expected together with --beyond")
    screen = Console(stderr=True)
    our_warnings_only(screen)
    folder = (out or Path("runs") / ("paper-quick" if quick else "paper")).absolute()
    asked = _Asked(folder, quick, parse_seeds(seeds or (QUICK_SEEDS if quick else SEEDS)))
    kind = FRESH if fresh else PLANS if plans is not None else BEYOND if beyond else CATALOGUE
    groups = asked.groups(kind, plan_files(plans or ""))
    for group in groups:
        check_runs(group.ablation)
    settings = SweepConfig(folder, workers, runner=RUN_AND_KEEP)
    measured = measure(groups, settings, SweepWatch("paper", screen))
    for path in _write(kind, asked, measured):
        line(output(), str(path))
    errors = [error for part in measured for error in part.errors]
    for error in dict.fromkeys(errors):
        line(screen, f"roomloop: failed ({errors.count(error)}): {error}")
    return 3 if errors else 0


def plan_files(text: str) -> list[str]:
    """What is listed; a folder stands for the plans in it. Raises InputError for one without."""
    files: list[str] = []
    for part in (Path(part.strip()) for part in text.split(",") if part.strip()):
        found = sorted(map(str, part.glob("*.json"))) if part.is_dir() else [str(part)]
        if not found:
            refuse(f"plans: {part}: expected plan files (*.json), found none")
        files += found
    return files


@dataclass(frozen=True)
class _Asked:
    """What the flags say of every group."""

    folder: Path
    quick: bool
    seeds: tuple[int, ...]

    def groups(self, kind: str, plans: Sequence[str] = ()) -> list[Group]:
        """The runs of a report. plans: those of the user, if it is about them."""
        from eval.paper import study

        duration = study.QUICK_S if self.quick else None
        base = RunConfig("SE1", duration=duration, cache=self.folder / "front-ends")
        if kind == CATALOGUE:
            return [study.catalogue(self.seeds, base, self.quick)]
        if kind == FRESH:
            return [study.fresh(self._fresh_files(), base)]
        if kind == PLANS:
            return study.of_plans(plans, self.seeds, base)
        return study.beyond(self.seeds, base, self.quick)

    def _fresh_files(self) -> list[Path]:
        from eval.paper import study
        from eval.sweep.store import open_store
        from semantics.detector import CONSERVATIVE

        count = study.QUICK_FRESH if self.quick else study.FRESH
        plans = study.fresh_plans(study.fresh_seed(CONSERVATIVE.weights), count)
        with open_store(self.folder) as store:  # a folder with plans alone would not be a sweep's
            store.plan([])
            return study.write_plans(plans, self.folder / "fresh-plans")


# --- what is written ------------------------------------------------------------------------------


def _write(kind: str, asked: _Asked, measured: Sequence[Measured]) -> list[Path]:
    """The report as Markdown and LaTeX, its pictures, and all comparisons as CSV."""
    from eval.comparing.tables import latex
    from eval.files import write_bytes, write_text
    from eval.paper.differences import differences_csv
    from eval.paper.report import report_text

    sheets, pictures = _contents(kind, asked, measured)
    shown = {f"{kind}-{name}.png": data for name, data in pictures.items()}
    text = report_text(TITLES[kind], sheets, list(shown), _remarks(asked, kind))
    texts = {f"{kind}.md": text, f"{kind}.tex": latex(sheets)}
    if kind in (CATALOGUE, FRESH):
        texts[f"{kind}.csv"] = differences_csv(_compared(kind, measured[0]))
    for name, content in texts.items():
        write_text(asked.folder / name, content)
    for name, data in shown.items():
        write_bytes(asked.folder / name, data)
    return [asked.folder / name for name in (*texts, *shown, "table.csv")]


def _compared(kind: str, measured: Measured) -> list[tuple[str, Result]]:
    """All pairs over all scenes; of the catalogue also over each kind of world."""
    from eval.paper.report import worlds

    kinds = worlds(measured) if kind == CATALOGUE else []
    every = measured.group.ablation.scenes
    return [(name, measured.compared(scenes)) for name, scenes in [("all", every), *kinds]]


def _contents(
    kind: str, asked: _Asked, measured: Sequence[Measured]
) -> tuple[list[Sheet], dict[str, bytes]]:
    from eval.paper import report
    from eval.paper.figures import rooms_png, scenes_png
    from eval.paper.study import DETECTORS, already_measured

    if kind in (BEYOND, PLANS):
        sheets_of = report.beyond_sheets if kind == BEYOND else report.plans_sheets
        return sheets_of(measured), {}
    part = measured[0]
    methods = [variant.name for variant in DETECTORS]
    if kind == FRESH:
        paper = already_measured(asked.groups(CATALOGUE)[0], asked.folder)
        picture = rooms_png([("fresh", part.result())], methods)
        return report.fresh_sheets(part, paper), {"rooms": picture}
    worlds = [(world, part.result(scenes)) for world, scenes in report.worlds(part)]
    pictures = {"rooms": rooms_png(worlds, methods)}
    sheets, panels = report.catalogue_sheets(part), _panels(part)
    if panels:
        sheets.append(report.counts_sheet(panels))
        pictures["scenes"] = scenes_png(panels)
    return sheets, pictures


def _panels(measured: Measured) -> list[Panel]:
    """The qualitative figure's runs, of the first seed; without those that failed."""
    from eval.graphfile import read_graph
    from eval.paper.figures import Panel
    from eval.paper.keep import kept_graph
    from eval.paper.study import DETECTORS
    from eval.source import make_world

    panels = []
    ablation = measured.group.ablation
    for scene in measured.of(FIGURE_SCENES):
        truth = make_world(replace(ablation.base, scene=scene, seed=ablation.seeds[0])).truth
        for variant in DETECTORS:
            config = variant.of(replace(ablation.base, scene=scene, seed=ablation.seeds[0]))
            row, path = measured.rows[config], None
            if row.metrics is not None and row.status == "complete":
                path = kept_graph(config)
            if row.metrics is not None and path is not None:
                panels.append(Panel(scene, variant.name, read_graph(path), row.metrics, truth))
    return panels


def _remarks(asked: _Asked, kind: str) -> list[str]:
    """What was run, by what."""
    from eval.sweep.job import fingerprint

    how = "A trial: 30 s of each drive" if asked.quick else "The whole route of every scene"
    seeds = "one drive each" if kind == FRESH else f"seeds {', '.join(map(str, asked.seeds))}"
    flag = {CATALOGUE: "", PLANS: " --beyond --plans"}.get(kind, f" --{kind}")
    made = f"`roomloop paper{flag}`, code and weights {fingerprint()[:12]}"
    return [f"{how}, {seeds}: {made}. What the rows mean is told at the end."]
