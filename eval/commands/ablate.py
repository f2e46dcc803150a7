"""``roomloop ablate``: variants x scenes x seeds, paired, with intervals."""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from eval.config import FACTORS, LAYERS, LOOPS, RunConfig
from eval.detectors import DETECTORS, ODOMETRIES
from eval.names import known, refuse

if TYPE_CHECKING:
    from rich.console import Console

    from eval.comparing.ablation import Ablation, Result
    from eval.sweep.engine import State

IN_THE_FILES = ("effect", "below/above", "scenes", "p")
"""Columns that a terminal would be too narrow for."""

Option = typer.Option
Listed = str | None


def _several(what: str, names: Sequence[str] = ()) -> str:
    return f"{what}, one or several as a,b" + (f" ({', '.join(names)})." if names else ".")


def ablate(
    preset: Annotated[
        Listed, Option(help="A set of variants, scenes and seeds: paper. Flags override it.")
    ] = None,
    scenes: Annotated[Listed, Option(help=_several("Scenes or plan files"))] = None,
    seeds: Annotated[Listed, Option(help="As 0,1,2 or 0-9.")] = None,
    layers: Annotated[Listed, Option(help=_several("What enters the graph", LAYERS))] = None,
    factors: Annotated[Listed, Option(help=_several("Constraints", FACTORS))] = None,
    loops: Annotated[Listed, Option(help=_several("Loop closure", LOOPS))] = None,
    detector: Annotated[Listed, Option(help=_several("Detectors", tuple(DETECTORS)))] = None,
    odometry: Annotated[Listed, Option(help=_several("Odometries", tuple(ODOMETRIES)))] = None,
    conditions: Annotated[Listed, Option(help=_several("How the world was built"))] = None,
    sensor: Annotated[Listed, Option(help=_several("Presets of the LiDAR"))] = None,
    duration: Annotated[float | None, Option(help="Simulated seconds of each run.")] = None,
    speed: Annotated[float | None, Option(help="Of the base, m/s.")] = None,
    metrics: Annotated[Listed, Option(help=_several("Numbers of metrics.json"))] = None,
    out: Annotated[Path | None, Option(help="The results (default: runs/ablation).")] = None,
    workers: Annotated[int | None, Option(help="Processes (default: one a core).")] = None,
    cluster: Annotated[Listed, Option(help="Address of a Dask scheduler, tcp://...")] = None,
) -> int:
    """Compare variants over scenes and seeds.

    The first value of each option makes the variant that the others are compared with, pair by pair
    of the same scene and seed. Results are kept in OUT: the same command goes on after an
    interruption, and adds what is new.
    """
    from rich.console import Console

    from eval.comparing.ablation import METRICS, evaluate
    from eval.comparing.scenario import parse_seeds
    from eval.screen import our_warnings_only, output
    from eval.sweep.engine import SweepConfig, sweep

    screen = Console(stderr=True)
    our_warnings_only(screen)
    facets = {
        **{"layers": layers, "factors": factors, "loops": loops, "detector": detector},
        **{"odometry": odometry, "conditions": conditions, "sensor": sensor},
    }
    folder = out or Path("runs") / (f"ablation-{preset}" if preset else "ablation")
    ablation = _ablation(preset, {name: _list(text) for name, text in facets.items() if text})
    base = RunConfig("SE1", duration=duration, speed=speed, cache=folder.absolute() / "front-ends")
    ablation = replace(
        ablation,
        scenes=tuple(_list(scenes)) if scenes else ablation.scenes,
        seeds=parse_seeds(seeds) if seeds else ablation.seeds,
        metrics=tuple(_list(metrics)) if metrics else METRICS,
        base=base,
    )
    check_runs(ablation)
    settings = SweepConfig(folder, workers, cluster)
    rows = sweep(ablation.configs, settings, SweepWatch("ablate", screen))
    result = evaluate(ablation, rows)
    files = write_report(result, folder)
    _show(output(), result, [row.error for row in rows if row.error], files)
    return 0


def _list(text: str) -> list[str]:
    return [part.strip() for part in text.split(",")]


def _ablation(preset: str | None, facets: dict[str, list[str]]) -> Ablation:
    """The variants that are asked for; scenes and seeds as long as nothing else is said."""
    from eval.comparing.ablation import PRESETS, Ablation, Variant, against_first, variants_of

    if preset is None:
        variants = variants_of(facets or {"layers": list(LAYERS)})
        return Ablation(variants, against_first(variants), ("SE1",), (0, 1, 2))
    known("preset", preset, PRESETS)
    variants, pairs, scenes, seeds = PRESETS[preset]
    for name, values in facets.items():
        if len(values) > 1:
            refuse(f"{name}: expected one value beside --preset, got {','.join(values)!r}")
    same = tuple((name, value) for name, (value,) in facets.items())
    variants = tuple(Variant(v.name, (*v.fields, *same)) for v in variants)
    return Ablation(variants, pairs, scenes, seeds)


def check_runs(ablation: Ablation) -> None:
    """Refuses, before anything runs, what no run of an ablation could use. Raises InputError."""
    from eval.detectors import make_detector, make_odometry
    from sim.sensorfile import sensor_named
    from worlds.catalogue import load_scene
    from worlds.conditions import conditions_named

    for scene in ablation.scenes:
        load_scene(scene)
    for config in {replace(config, scene="SE1", seed=0) for config in ablation.configs}:
        sensor_named(config.sensor)
        if config.conditions is not None:
            conditions_named(config.conditions)
        # A user's own parts only: ours are there, and slow to make.
        if ":" in config.detector:
            make_detector(config.detector)
        if ":" in config.odometry:
            make_odometry(config.odometry)


class SweepWatch:
    """Says on standard error how far the sweep is, and how long it will take."""

    STEP = 0.05

    def __init__(self, name: str, screen: Console):
        self._name, self._screen = name, screen
        self._told, self._settled = -1.0, False

    def __call__(self, state: State) -> None:
        settled = state.settled and not self._settled
        share = state.done / state.total
        if not settled and share < min(1.0, self._told + self.STEP) and self._told >= 0.0:
            return
        self._told, self._settled = share, self._settled or state.settled
        self._say(state)

    def _say(self, state: State) -> None:
        from eval.screen import line

        failed = f", {state.failed} failed" if state.failed else ""
        ahead = f"about {_duration(state.remaining_s)} more"
        if state.remaining_s and not state.settled:
            ahead += " (a first guess)"
        elif state.remaining_s:
            ahead += time.strftime(", until %H:%M", time.localtime(time.time() + state.remaining_s))
        else:
            ahead = f"{_duration(state.taken_s)} in all"
        line(self._screen, f"{self._name}: {state.done} of {state.total} runs{failed}; {ahead}")


def _duration(seconds: float) -> str:
    minutes, hours = seconds / 60.0, seconds / 3600.0
    if hours >= 1.5:
        return f"{hours:.1f} h"
    return f"{minutes:.0f} min" if minutes >= 2.0 else f"{seconds:.0f} s"


def write_report(result: Result, folder: Path) -> list[Path]:
    """Tables as Markdown, LaTeX and CSV, and the picture."""
    from eval.comparing.forest import forest_png
    from eval.comparing.tables import (
        comparisons_csv,
        difference_sheet,
        latex,
        level_sheet,
        markdown,
    )
    from eval.files import write_bytes, write_text

    sheets = [level_sheet(result, metric) for metric in result.ablation.metrics]
    sheets += [difference_sheet(result)] if result.comparisons else []
    texts = {"ablation.md": markdown(sheets), "ablation.tex": latex(sheets)}
    texts["ablation.csv"] = comparisons_csv(result)
    for name, text in texts.items():
        write_text(folder / name, text)
    write_bytes(folder / "ablation.png", forest_png(result))
    return [folder / name for name in (*texts, "ablation.png", "table.csv")]


def _show(console: Console, result: Result, errors: Sequence[str], files: Sequence[Path]) -> None:
    from eval.comparing.tables import NOTE, difference_sheet, level_sheet
    from eval.screen import line, show_sheet

    for metric in result.ablation.metrics[:1]:
        show_sheet(console, level_sheet(result, metric))
    if result.comparisons:
        show_sheet(console, difference_sheet(result).without(*IN_THE_FILES))
        line(console, NOTE)
    for error in dict.fromkeys(errors):
        line(console, f"failed ({errors.count(error)}): {error}")
    for path in files:
        line(console, str(path))
