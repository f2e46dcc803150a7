"""The command line. What is heavy is imported inside the commands, so that help comes at once."""

from __future__ import annotations

import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Annotated

import typer

from eval.commands.gallery import gallery
from eval.commands.report import report
from eval.commands.view import view as view_run
from eval.commands.view import watchers
from eval.config import FACTORS, LAYERS, LOOPS, RunConfig
from eval.detectors import DETECTORS, ODOMETRIES

app = typer.Typer(
    help="Evaluates indoor semantic LiDAR SLAM in simulation: a floor plan becomes a world, "
    "a robot drives through it, and every step of the SLAM is scored against the truth.",
    add_completion=False,
    rich_markup_mode=None,
    pretty_exceptions_enable=False,
)

Scene = Annotated[str, typer.Argument(help="A name of the catalogue, or a plan file.")]
Option = typer.Option
app.command("view")(view_run)
app.command("report")(report)
app.command("gallery")(gallery)


def _names(names: Sequence[str]) -> str:
    return ", ".join(names)


@app.command()
def scenes(
    show: Annotated[str | None, Option(help="Draw this scene (or plan file).")] = None,
    out: Annotated[Path | None, Option(help="The picture's file (default: SCENE.png).")] = None,
) -> None:
    """The catalogue with its counts; a picture of one scene."""
    from rich.console import Console

    console = Console()
    if show is None:
        from eval.screen import counts_table
        from worlds.catalogue import load_scene, scene_counts, scene_names

        console.print(counts_table([scene_counts(load_scene(name)) for name in scene_names()]))
    else:
        path = _draw_scene(show, out or Path(f"{Path(show).stem}.png"))
        console.print(str(path), markup=False, highlight=False, soft_wrap=True)


def _draw_scene(scene: str, path: Path) -> Path:
    """Draws a scene as planned into a PNG file."""
    from numpy.random import SeedSequence

    from eval.files import whole_file
    from worlds.catalogue import load_scene
    from worlds.conditions import IDEAL
    from worlds.picture import scene_figure
    from worlds.world import build_world

    world = build_world(load_scene(scene), SeedSequence(0), IDEAL)
    with whole_file(path) as part:
        scene_figure(world).savefig(part, format="png", dpi=150)
    return path


@app.command()
def run(
    scene: Scene,
    seed: Annotated[int, Option(help="Of everything random.")] = RunConfig.seed,
    out: Annotated[
        Path | None, Option(help="The output folder (default: runs/SCENE-DETECTOR-sN).")
    ] = None,
    duration: Annotated[
        float | None, Option(help="Simulated seconds (default: the whole route).")
    ] = None,
    speed: Annotated[float | None, Option(help="Of the base, m/s.")] = None,
    storey: Annotated[int | None, Option(help="Counted from 0.")] = None,
    start: Annotated[str | None, Option(help="The room to start in.")] = None,
    sensor: Annotated[str, Option(help="Preset of the LiDAR.")] = RunConfig.sensor,
    conditions: Annotated[
        str, Option(help="How the world was built: as-built or ideal.")
    ] = RunConfig.conditions,
    detector: Annotated[
        str, Option(help=f"{_names(tuple(DETECTORS))}, or package.module:Class.")
    ] = RunConfig.detector,
    odometry: Annotated[
        str, Option(help=f"{_names(tuple(ODOMETRIES))}, or package.module:Class.")
    ] = RunConfig.odometry,
    layers: Annotated[
        str, Option(help=f"What enters the graph: {_names(LAYERS)}.")
    ] = RunConfig.layers,
    factors: Annotated[
        str, Option(help=f"How rooms and walls constrain it: {_names(FACTORS)}.")
    ] = RunConfig.factors,
    loops: Annotated[str, Option(help=f"Loop closure: {_names(LOOPS)}.")] = RunConfig.loops,
    save: Annotated[bool, Option("--save", help="Write recording.rrd too.")] = False,
    cache: Annotated[
        Path | None, Option(help="A folder of recorded front ends: replay, or record there.")
    ] = None,
    view: Annotated[bool, Option("--view", help="Watch it in a window; without --cache.")] = False,
    serve: Annotated[bool, Option("--serve", help="Watch it in a browser; as --view.")] = False,
) -> None:
    """Drive through a scene, map it, and score the map."""
    config = RunConfig(
        scene=scene,
        seed=seed,
        out=out,
        duration=duration,
        speed=speed,
        storey=storey,
        start=start,
        sensor=sensor,
        conditions=conditions,
        detector=detector,
        odometry=odometry,
        layers=layers,
        factors=factors,
        loops=loops,
        save=save,
        cache=cache,
    )
    from rich.console import Console

    from eval.screen import RunProgress, our_warnings_only, show_result

    screen = Console(stderr=True)
    our_warnings_only(screen)
    with RunProgress(config.scene, screen) as progress:
        from eval.run import run as run_loop

        result = run_loop(config, progress, watchers=watchers(view, serve))
    show_result(Console(), result.metrics, result.folder)


@app.command()
def train(
    seed: Annotated[int, Option(help="Of the training set and of the weights.")] = 0,
    layouts: Annotated[int, Option(help="Buildings in the training set.")] = 1200,
    epochs: Annotated[int, Option(help="Passes over the training set.")] = 18,
    out: Annotated[
        Path | None, Option(help="Where the weights go (default: those that the detector uses).")
    ] = None,
) -> None:
    """Make the training set and train both networks; writes weights and a picture of the curves."""
    for name, value, least in (("seed", seed, 0), ("layouts", layouts, 10), ("epochs", epochs, 1)):
        if value < least:
            raise typer.BadParameter(f"{name}: expected {least} or more, got {value}")
    from rich.console import Console

    from eval.curves import curves_png
    from eval.screen import RunProgress
    from semantics.dataset import DatasetConfig
    from semantics.detector import WEIGHTS
    from semantics.train import TrainConfig
    from semantics.train import train as train_networks

    folder = out or WEIGHTS
    config = TrainConfig(
        dataset=DatasetConfig(layouts=layouts), seed=seed, epochs=epochs, folder=folder
    )
    with RunProgress("training", Console(stderr=True), "%") as progress:
        result = train_networks(config, lambda _, share: progress(100.0 * share, 100.0))
    picture = curves_png(result.curves, (Path() if out is None else out) / "training.png")
    console = Console()
    for curve in result.curves:
        console.print(
            f"{curve.relation}: epoch {curve.best + 1} of {epochs}, validation precision "
            f"{curve.precision[curve.best]:.3f}, recall {curve.recall[curve.best]:.3f}",
            highlight=False,
        )
    for path in (*result.files, picture):
        console.print(str(path), markup=False, highlight=False, soft_wrap=True)


def main(arguments: Sequence[str] | None = None) -> int:
    """Runs a command; the exit status (see README, "Exit status")."""
    try:
        status = app(args=arguments, prog_name="roomloop", standalone_mode=False)
    except typer.TyperException as error:
        return _report_usage(error)
    except KeyboardInterrupt:
        status = 130
    except Exception as error:
        return _report(error)
    if status == 130:
        print("roomloop: stopped", file=sys.stderr)
    return status if isinstance(status, int) else 0


def _report_usage(error: typer.TyperException) -> int:
    message = error.format_message() if hasattr(error, "format_message") else str(error)
    context = getattr(error, "ctx", None)
    command = context.command_path if context is not None else "roomloop"
    print(f"roomloop: {message} (see '{command} --help')", file=sys.stderr)
    return 2


def _report(error: Exception) -> int:
    """One line for what roomloop itself refuses; anything else is a fault and keeps its trace."""
    from slam.core import RoomloopError

    if not isinstance(error, RoomloopError):
        raise error
    print(f"roomloop: {' '.join(str(error).split())}", file=sys.stderr)
    return error.exit_status


if __name__ == "__main__":
    sys.exit(main())
