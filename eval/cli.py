"""The command line. What is heavy is imported inside the commands, so that help comes at once."""

from __future__ import annotations

import sys
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from eval.commands.ablate import ablate
from eval.commands.compare import compare
from eval.commands.score import score
from eval.commands.train import train
from eval.config import FACTORS, LAYERS, LOOPS, RunConfig
from eval.detectors import DETECTORS, ODOMETRIES

if TYPE_CHECKING:
    from worlds.plan import Plan

app = typer.Typer(
    help="Evaluates indoor semantic LiDAR SLAM in simulation: a floor plan becomes a world, "
    "a robot drives through it, and every step of the SLAM is scored against the truth.",
    add_completion=False,
    rich_markup_mode=None,
    pretty_exceptions_enable=False,
)

Scene = Annotated[
    str,
    typer.Argument(
        help="A name of the catalogue; a plan, IFC, mesh or occupancy map; a scenario (.toml)."
    ),
]
Option = typer.Option
Unit = Annotated[
    str | None,
    Option(help="Unit of a mesh or IFC file: m, cm, mm, in, ft, or a factor to metres."),
]
Up = Annotated[str | None, Option(help="The axis of a mesh that points up: y or z.")]


def _names(names: Sequence[str]) -> str:
    return ", ".join(names)


@app.command()
def scenes(
    show: Annotated[str | None, Option(help="Draw this scene (or a building's file).")] = None,
    out: Annotated[Path | None, Option(help="The picture's file (default: SCENE.png).")] = None,
    unit: Unit = None,
    up: Up = None,
) -> None:
    """The catalogue with its counts; a picture of one scene."""
    from rich.console import Console

    console = Console()
    if show is None:
        from eval.screen import counts_table
        from worlds.catalogue import load_scene, scene_counts, scene_names

        console.print(counts_table([scene_counts(load_scene(name)) for name in scene_names()]))
    else:
        from eval.screen import our_warnings_only
        from worlds.catalogue import load_scene
        from worlds.readers import ReaderOptions

        our_warnings_only(Console(stderr=True))
        plan = load_scene(show, ReaderOptions(unit, up))
        path = _draw_scene(plan, out or Path(f"{Path(show).stem}.png"))
        for line in filter(None, (plan.notes, str(path))):
            console.print(line, markup=False, highlight=False, soft_wrap=True)


def _draw_scene(plan: Plan, path: Path) -> Path:
    """Draws a scene as planned into a PNG file."""
    from numpy.random import SeedSequence

    from eval.files import whole_file
    from worlds.conditions import IDEAL
    from worlds.picture import scene_figure
    from worlds.world import build_world

    world = build_world(plan, SeedSequence(0), IDEAL)
    with whole_file(path) as part:
        scene_figure(world).savefig(part, format="png", dpi=150)
    return path


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
    sensor: Annotated[str, Option(help="Preset of the LiDAR.")] = RunConfig.sensor,
    conditions: Annotated[
        str | None, Option(help="How the world was built (default: as the scene says).")
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
    save: Annotated[bool, Option("--save", help="Write recording.rrd too.")] = False,
    cache: Annotated[
        Path | None, Option(help="A folder of recorded front ends: replay, or record there.")
    ] = None,
    unit: Unit = None,
    up: Up = None,
) -> int:
    """Drive through a scene, map it, and score the map."""
    if seeds is not None or scene.endswith(".toml"):
        from eval.commands.scenario import run_command

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

        result = run_loop(config, progress)
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
