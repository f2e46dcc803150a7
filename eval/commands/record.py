"""``roomloop record``: a simulated drive as a ROS 2 bag."""

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
)
from eval.config import RunConfig


def record(
    scene: Annotated[str, typer.Argument(help="A name of the catalogue, or a building's file.")],
    seed: Seed = RunConfig.seed,
    out: Annotated[
        Path | None, Option(help="The bag's folder, a new one (default: bags/SCENE-sN).")
    ] = None,
    duration: Duration = None,
    speed: Speed = None,
    storey: Storey = None,
    start: Start = None,
    sensor: Sensor = RunConfig.sensor,
    conditions: Conditions = None,
    labels: Annotated[
        bool, Option("--labels", help="Write labels.npz, the truth of every point, beside it.")
    ] = False,
) -> None:
    """Record a drive as a ROS 2 bag.

    It holds the scans, the wheel odometry, transforms and the true poses.
    """
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
