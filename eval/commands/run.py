"""``roomloop run``: one run, or a scenario's."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from eval.commands.options import (
    Conditions,
    Duration,
    Option,
    Seed,
    Sensor,
    Speed,
    Start,
    Storey,
    Unit,
    Up,
)
from eval.commands.view import watchers
from eval.config import FACTORS, LAYERS, LOOPS, RunConfig
from eval.detectors import DETECTORS, ODOMETRIES

Scene = Annotated[
    str,
    typer.Argument(
        help="A name of the catalogue; a plan, IFC, mesh, occupancy map or recording; "
        "or a scenario (.toml)."
    ),
]


def run(
    context: typer.Context,
    scene: Scene,
    seed: Seed = RunConfig.seed,
    seeds: Annotated[
        str | None, Option(help="Several, as 0,1,2 or 0-9: OUT/sN for each, and a table.")
    ] = None,
    out: Annotated[
        Path | None, Option(help="The output folder (default: runs/SCENE-DETECTOR-sN).")
    ] = None,
    duration: Duration = None,
    speed: Speed = None,
    storey: Storey = None,
    start: Start = None,
    route: Annotated[
        str | None, Option(help="A route that the scene names (default: every room).")
    ] = None,
    closed: Annotated[bool, Option("--closed", help="Return to the start.")] = False,
    sensor: Sensor = RunConfig.sensor,
    conditions: Conditions = None,
    detector: Annotated[
        str, Option(help=f"{', '.join(DETECTORS)}, or package.module:Class.")
    ] = RunConfig.detector,
    odometry: Annotated[
        str, Option(help=f"{', '.join(ODOMETRIES)}, or package.module:Class.")
    ] = RunConfig.odometry,
    layers: Annotated[
        str, Option(help=f"What enters the graph: {', '.join(LAYERS)}.")
    ] = RunConfig.layers,
    factors: Annotated[
        str, Option(help=f"How rooms and walls constrain it: {', '.join(FACTORS)}.")
    ] = RunConfig.factors,
    loops: Annotated[str, Option(help=f"Loop closure: {', '.join(LOOPS)}.")] = RunConfig.loops,
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

    from eval.comparing.runtables import show_result
    from eval.screen import RunProgress, our_warnings_only

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
