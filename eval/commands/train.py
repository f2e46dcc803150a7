"""``roomloop train``: the training set and the weights that ship; ``--study``: what each choice is
worth."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from eval.commands.paper import plan_files
from eval.names import refuse

if TYPE_CHECKING:
    from rich.console import Console

    from semantics.dataset import Sample
    from semantics.train import TrainConfig

Option = typer.Option


def train(
    preset: Annotated[
        str, Option(help="What to train: ours, or paper (its networks, features and training set).")
    ] = "ours",
    seed: Annotated[int, Option(help="Of the training set and of the weights.")] = 0,
    layouts: Annotated[int | None, Option(help="Buildings in the training set.")] = None,
    epochs: Annotated[int | None, Option(help="Passes over the training set.")] = None,
    out: Annotated[
        Path | None, Option(help="Where the weights go (default: those that the detectors use).")
    ] = None,
    judge: Annotated[
        bool,
        Option("--judge", help="Train nothing: judge the weights that ship on held-out buildings."),
    ] = False,
    plans: Annotated[
        str | None,
        Option(help="For --judge, these instead: plan files or folders of them, as a.json,plans."),
    ] = None,
    study: Annotated[
        bool,
        Option(
            "--study",
            help="Ship nothing: train every combination of features, networks and training set on "
            "few layouts, and write a table of what each is worth.",
        ),
    ] = False,
) -> None:
    """Train the detector, or study it.

    Makes a training set and trains on it; writes weights and a picture of the curves.
    """
    for name, value, least in (("seed", seed, 0), ("layouts", layouts, 10), ("epochs", epochs, 1)):
        if value is not None and value < least:
            raise typer.BadParameter(f"{name}: expected {least} or more, got {value}")
    from rich.console import Console

    console = Console()
    if plans is not None and not judge:
        refuse("plans: expected together with --judge")
    if plans is not None:
        _judge_plans(console, plan_files(plans))
    elif judge:
        _judge(console, out or Path())
    elif study:
        _study(console, seed, layouts, epochs, out or Path())
    else:
        _train(console, _config(preset, seed, layouts, epochs, out), (out or Path()))


def _config(
    preset: str, seed: int, layouts: int | None, epochs: int | None, out: Path | None
) -> TrainConfig:
    from dataclasses import replace

    from semantics.train import preset_named

    config = preset_named(preset)
    dataset = config.dataset
    if layouts is not None:
        dataset = replace(dataset, layouts=layouts)  # type: ignore[type-var]
    return replace(
        config,
        dataset=dataset,
        seed=seed,
        epochs=config.epochs if epochs is None else epochs,
        folder=config.folder if out is None else out,
    )


def _train(console: Console, config: TrainConfig, pictures: Path) -> None:
    from eval.screen import RunProgress
    from eval.studies.curves import curves_png
    from semantics.train import train as train_networks

    with RunProgress("training", _errors(), "%") as progress:
        result = train_networks(config, lambda _, share: progress(100.0 * share, 100.0))
    picture = curves_png(result.curves, pictures / f"training_{config.networks[0][0]}.png")
    for curve in result.curves:
        for place, relation in enumerate(curve.relations):
            console.print(
                f"{curve.name}, {relation}: epoch {curve.best + 1} of {config.epochs}, validation "
                f"precision {curve.precision[curve.best][place]:.3f}, recall "
                f"{curve.recall[curve.best][place]:.3f}, calibration error "
                f"{curve.calibration[place]:.4f}",
                highlight=False,
            )
    for path in (*result.files, picture):
        console.print(str(path), markup=False, highlight=False, soft_wrap=True)


def _study(
    console: Console, seed: int, layouts: int | None, epochs: int | None, folder: Path
) -> None:
    from eval.screen import RunProgress
    from eval.studies.choices import StudyConfig, study, write_study
    from eval.studies.tables import STUDIED, TRAINED, concepts_table, edges_table

    default = StudyConfig()
    config = StudyConfig(layouts or default.layouts, epochs or default.epochs, seed)
    with RunProgress("study", _errors(), "%") as progress:
        rows = study(config, lambda _, share: progress(100.0 * share, 100.0))
    console.print(edges_table(rows, TRAINED))
    console.print()
    console.print(concepts_table(rows, STUDIED))
    path = write_study(rows, folder / "study.csv")
    console.print(str(path), markup=False, highlight=False, soft_wrap=True)


def _judge(console: Console, folder: Path) -> None:
    from eval.studies.choices import held_out, sweep
    from eval.studies.confusion import confusion_png
    from eval.studies.edgelimits import edge_limits
    from eval.studies.tables import limits_table, thresholds_table
    from semantics.detector import CONSERVATIVE

    tests = held_out(processes=2)
    _print_judged(console, tests)
    console.print()
    known = [sample for family, drawn in tests.items() if family != "fanned" for sample in drawn]
    console.print(thresholds_table(sweep(CONSERVATIVE, known)))
    console.print()
    console.print(limits_table(edge_limits(CONSERVATIVE.weights, known)))
    for family, drawn in tests.items():
        path = confusion_png(CONSERVATIVE.weights, drawn, folder / f"confusion_{family}.png")
        console.print(str(path), markup=False, highlight=False, soft_wrap=True)


def _judge_plans(console: Console, files: Sequence[str]) -> None:
    """From true faces: what is seen of them, with the noise of mapped planes."""
    from eval.studies.choices import on_plans
    from worlds.catalogue import load_scene

    _print_judged(console, on_plans({Path(file).stem: load_scene(file) for file in files}))


def _print_judged(console: Console, tests: Mapping[str, Sequence[Sample]]) -> None:
    """Tables of what every detector makes of samples, by where they come from."""
    from eval.studies.choices import Row, judge
    from eval.studies.tables import JUDGED, concepts_table, edges_table
    from semantics.detector import PRESETS

    rows = [
        Row("", name, "", "", family, judge(preset, drawn))
        for family, drawn in tests.items()
        for name, preset in PRESETS.items()
    ]
    first = {preset.weights: name for name, preset in reversed(PRESETS.items())}
    console.print(edges_table([row for row in rows if row.networks in first.values()], JUDGED))
    console.print()
    console.print(concepts_table(rows, JUDGED))


def _errors() -> Console:
    from rich.console import Console

    return Console(stderr=True)
