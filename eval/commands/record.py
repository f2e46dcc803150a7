"""``roomloop record``: a simulated drive as a ROS 2 bag."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from eval.config import RunConfig

Option = typer.Option


def record(
    scene: Annotated[str, typer.Argument(help="A name of the catalogue, or a building's file.")],
    seed: Annotated[int, Option(help="Of everything random.")] = RunConfig.seed,
    out: Annotated[
        Path | None, Option(help="The bag's folder, a new one (default: bags/SCENE-sN).")
    ] = None,
    duration: Annotated[
        float | None, Option(help="Simulated seconds (default: the whole route).")
    ] = None,
    speed: Annotated[float | None, Option(help="Of the base, m/s.")] = None,
    storey: Annotated[int | None, Option(help="Counted from 0.")] = None,
    start: Annotated[str | None, Option(help="The room to start in.")] = None,
    sensor: Annotated[str, Option(help="Preset of the LiDAR, or a .toml file.")] = RunConfig.sensor,
    conditions: Annotated[
        str | None,
        Option(help="How it is built, and what stands in it (default: as the scene says)."),
    ] = None,
    labels: Annotated[
        bool, Option("--labels", help="Write labels.npz, the truth of every point, beside it.")
    ] = False,
) -> None:
    """Record a drive: scans, wheel odometry, transforms and the true poses as a ROS 2 bag."""
    config = RunConfig(
        scene=scene,
        seed=seed,
        duration=duration,
        speed=speed,
        storey=storey,
        start=start,
        sensor=sensor,
        conditions=conditions,
    )
    from rich.console import Console

    from eval.recordings.record import record as record_drive
    from eval.screen import RunProgress, our_warnings_only

    folder = out or Path("bags") / f"{Path(scene).stem}-s{seed}"
    screen = Console(stderr=True)
    our_warnings_only(screen)
    with RunProgress(scene, screen) as progress:
        count = record_drive(config, folder, labels, progress)
    Console().print(f"{count} scans: {folder}", markup=False, highlight=False, soft_wrap=True)
