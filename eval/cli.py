"""The command line. What is heavy is imported inside the commands, so that help comes at once."""

from __future__ import annotations

import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Annotated

import typer

from eval.commands.ablate import ablate
from eval.commands.bench import app as bench
from eval.commands.calibrate import calibrate
from eval.commands.compare import compare
from eval.commands.gallery import gallery
from eval.commands.paper import paper
from eval.commands.record import record
from eval.commands.report import report
from eval.commands.scenes import Unit, Up, scenes
from eval.commands.score import score
from eval.commands.train import train
from eval.commands.view import view as view_run
from eval.commands.view import watchers
from eval.config import FACTORS, LAYERS, LOOPS, RunConfig
from eval.detectors import DETECTORS, ODOMETRIES

LONGEST_LINE = 500
"""Characters of an error; a value that a file holds may be a megabyte."""

app = typer.Typer(
    help="Evaluates indoor semantic LiDAR SLAM in simulation: a floor plan becomes a world, "
    "a robot drives through it, and every step of the SLAM is scored against the truth.",
    add_completion=False,
    rich_markup_mode=None,
    pretty_exceptions_enable=False,
)
app.add_typer(bench, name="bench")

Scene = Annotated[
    str,
    typer.Argument(
        help="A name of the catalogue; a plan, IFC, mesh, occupancy map or recording; "
        "or a scenario (.toml)."
    ),
]
Option = typer.Option
app.command()(scenes)
app.command("view")(view_run)
app.command()(report)
app.command()(gallery)
app.command()(record)
app.command()(calibrate)


def _names(names: Sequence[str]) -> str:
    return ", ".join(names)


@app.command()
def run(
    context: typer.Context,
    scene: Scene,
    seed: Annotated[int, Option(help="Of everything random.")] = RunConfig.seed,
    seeds: Annotated[
        str | None, Option(help="Several, as 0,1,2 or 0-9: OUT/sN for each, and a table.")
    ] = None,
    out: Annotated[
        Path | None, Option(help="The output folder (default: runs/SCENE-DETECTOR-sN).")
    ] = None,
    duration: Annotated[
        float | None, Option(help="Simulated seconds (default: the whole route).")
    ] = None,
    speed: Annotated[float | None, Option(help="Of the base, m/s.")] = None,
    storey: Annotated[int | None, Option(help="Counted from 0.")] = None,
    start: Annotated[str | None, Option(help="The room to start in.")] = None,
    route: Annotated[
        str | None, Option(help="A route that the scene names (default: every room).")
    ] = None,
    closed: Annotated[bool, Option("--closed", help="Return to the start.")] = False,
    sensor: Annotated[str, Option(help="Preset of the LiDAR, or a .toml file.")] = RunConfig.sensor,
    conditions: Annotated[
        str | None,
        Option(
            help="How it is built, and what stands in it: as-built, ideal, office, real-site, "
            "or several joined by +, such as furniture+people (default: as the scene says)."
        ),
    ] = None,
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
    truth: Annotated[
        str | None, Option(help="Of a recording: a .tum file, labels.npz, or a topic of the bag.")
    ] = None,
    topic: Annotated[str | None, Option(help="Of a bag's point clouds, if it has several.")] = None,
    save: Annotated[bool, Option("--save", help="Write recording.rrd too.")] = False,
    cache: Annotated[
        Path | None, Option(help="A folder of recorded front ends: replay, or record there.")
    ] = None,
    unit: Unit = None,
    up: Up = None,
    view: Annotated[bool, Option("--view", help="Watch it in a window; without --cache.")] = False,
    serve: Annotated[bool, Option("--serve", help="Watch it in a browser; as --view.")] = False,
) -> int:
    """Drive through a scene, map it, and score the map."""
    if seeds is not None or scene.endswith(".toml"):
        from eval.commands.scenario import run_command

        if view or serve:
            raise typer.BadParameter("--view and --serve are for single runs")
        return run_command(scene, seeds, _given(context))
    config = RunConfig(
        scene=scene,
        seed=seed,
        out=out,
        duration=duration,
        speed=speed,
        storey=storey,
        start=start,
        route=route,
        closed=closed,
        sensor=sensor,
        conditions=conditions,
        detector=detector,
        odometry=odometry,
        layers=layers,
        factors=factors,
        loops=loops,
        truth=truth,
        topic=topic,
        save=save,
        cache=cache,
        unit=unit,
        up=up,
    )
    from rich.console import Console

    from eval.screen import RunProgress, our_warnings_only, show_result

    screen = Console(stderr=True)
    our_warnings_only(screen)
    with RunProgress(config.scene, screen) as progress:
        from eval.run import run as run_loop

        result = run_loop(config, progress, watchers=watchers(view, serve))
    show_result(Console(), result.metrics, result.folder)
    return 0


def _given(context: typer.Context) -> dict[str, object]:
    """The options that stand on the command line, without those that have their default."""
    return {
        name: value
        for name, value in context.params.items()
        if name not in ("scene", "seeds")
        and getattr(context.get_parameter_source(name), "name", "") == "COMMANDLINE"
    }


app.command()(train)
app.command()(ablate)
app.command()(compare)
app.command()(score)
app.command()(paper)


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
        _say("stopped")
    return status if isinstance(status, int) else 0


def _report_usage(error: typer.TyperException) -> int:
    message = error.format_message() if hasattr(error, "format_message") else str(error)
    context = getattr(error, "ctx", None)
    command = context.command_path if context is not None else "roomloop"
    _say(f"{message} (see '{command} --help')")
    return 2


def _report(error: Exception) -> int:
    """One line for what roomloop itself refuses, and for what the system does with a file; anything
    else is a fault and keeps its trace."""
    from slam.core import RoomloopError

    if isinstance(error, OSError) and error.filename is not None:
        _say(f"{error.filename}: {error.strerror}")
        return 2
    if not isinstance(error, RoomloopError):
        raise error
    _say(str(error))
    return error.exit_status


def _say(text: str) -> None:
    """One line, no longer than people read, its end kept."""
    line = " ".join(text.split())
    if len(line) > LONGEST_LINE:
        line = f"{line[: LONGEST_LINE - 100]} ... {line[-95:]}"
    print(f"roomloop: {line}", file=sys.stderr)


if __name__ == "__main__":
    sys.exit(main())
