"""Options that several commands have, said once."""

from __future__ import annotations

from typing import Annotated

import typer

Option = typer.Option

Seed = Annotated[int, Option(help="Of everything random.")]
Duration = Annotated[float | None, Option(help="Simulated seconds (default: the whole route).")]
Speed = Annotated[float | None, Option(help="Of the base, m/s.")]
Storey = Annotated[int | None, Option(help="Counted from 0.")]
Start = Annotated[str | None, Option(help="The room to start in.")]
Sensor = Annotated[str, Option(help="Preset of the LiDAR, or a .toml file.")]
Conditions = Annotated[
    str | None,
    Option(
        help="How it is built, and what stands in it: as-built, ideal, office, real-site, "
        "or several joined by +, such as furniture+people (default: as the scene says)."
    ),
]
Unit = Annotated[
    str | None,
    Option(help="Unit of a mesh or IFC file: m, cm, mm, in, ft, or a factor to metres."),
]
Up = Annotated[str | None, Option(help="The axis of a mesh that points up: y or z.")]
