"""``roomloop scenes``: what there is to drive through, as a table, as pictures, and as truth."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from eval.commands.options import Conditions, Option, Seed, Unit, Up
from eval.config import RunConfig

if TYPE_CHECKING:
    from matplotlib.figure import Figure
    from rich.console import Console

    from worlds.world import World


def scenes(
    show: Annotated[str | None, Option(help="Draw this scene (or file).")] = None,
    truth: Annotated[str | None, Option(help="Write this scene's truth as JSON.")] = None,
    sheet: Annotated[Path | None, Option(help="Draw all scenes into this PNG file.")] = None,
    out: Annotated[
        Path | None, Option(help="The file written (default: SCENE.png, SCENE.truth.json).")
    ] = None,
    conditions: Conditions = None,
    seed: Seed = RunConfig.seed,
    storey: Annotated[int | None, Option(help="Only this one, counted from 0.")] = None,
    route: Annotated[bool, Option("--route", help="Draw the route of a run, too.")] = False,
    unit: Unit = None,
    up: Up = None,
) -> None:
    """Show the scenes: counts, pictures, truth."""
    from rich.console import Console

    options = {"--show": show, "--truth": truth, "--sheet": sheet}
    asked = [name for name, value in options.items() if value is not None]
    if len(asked) > 1:
        raise typer.BadParameter(f"expected one of {', '.join(options)}, got {' and '.join(asked)}")
    from eval.files import make_folder
    from eval.screen import our_warnings_only

    screen = Console(stderr=True)
    our_warnings_only(screen)
    console = Console()
    if (written := out or sheet) is not None:
        make_folder(written.parent)  # before what takes long
    if sheet is not None:
        path = _draw_sheet(out or sheet, conditions, seed)
    elif show is not None or truth is not None:
        config = RunConfig(
            str(show or truth), seed=seed, conditions=conditions, storey=storey, unit=unit, up=up
        )
        world = _world(config)
        if world.plan.notes:
            screen.print(world.plan.notes, markup=False, highlight=False, soft_wrap=True)
        path = _draw(config, world, out, route) if show else _export(config, world, out)
    else:
        _print_table(console)
        return
    console.print(str(path), markup=False, highlight=False, soft_wrap=True)


def _print_table(console: Console) -> None:
    from eval.comparing.runtables import counts_table
    from worlds.catalogue import load_scene, scene_counts, scene_names

    console.print(counts_table([scene_counts(load_scene(name)) for name in scene_names()]))


def _draw(config: RunConfig, world: World, out: Path | None, with_route: bool) -> Path:
    """Draws a scene as a run would meet it into a PNG file."""
    from sim.route import plan_route
    from worlds.picture import Details, scene_figure

    route = plan_route(world, config.storey, config.start) if with_route else None
    details = Details(route=None if route is None else route.points)
    title = f"{world.plan.name}, {_conditions(config, world)}, seed {config.seed}"
    storeys = None if route is None or world.ramps else [config.storey or 0]
    figure = scene_figure(world, storeys, details, title)
    return _save(figure, out or Path(f"{Path(config.scene).stem}.png"))


def _draw_sheet(path: Path, conditions: str | None, seed: int) -> Path:
    from worlds.catalogue import scene_names
    from worlds.picture import sheet_figure

    names = scene_names()
    worlds = [_world(RunConfig(name, seed=seed, conditions=conditions)) for name in names]
    return _save(sheet_figure(worlds), path)


def _export(config: RunConfig, world: World, out: Path | None) -> Path:
    """Writes the truth that a run of the same scene, seed and conditions is scored against."""
    from worlds.truthfile import TruthFile, write_truth

    path = out or Path(f"{Path(config.scene).stem}.truth.json")
    conditions = _conditions(config, world)
    write_truth(TruthFile(world.truth, config.scene, config.seed, conditions), path)
    return path


def _world(config: RunConfig) -> World:
    """All storeys of a building, or the one asked for."""
    from eval.source import plan_of, seeds
    from worlds.conditions import conditions_named
    from worlds.world import build_world

    plan = plan_of(config)
    conditions = conditions_named(config.conditions or plan.conditions)
    return build_world(plan, seeds(config)[0], conditions, config.storey)


def _conditions(config: RunConfig, world: World) -> str:
    return config.conditions or world.plan.conditions


def _save(figure: Figure, path: Path) -> Path:
    from eval.files import whole_file

    with whole_file(path) as part:
        figure.savefig(part, format="png", dpi=150)
    return path
