"""``roomloop bench``: measurements that anybody can repeat."""

from __future__ import annotations

import typer

from eval.commands.baselines import baselines
from eval.commands.growth import growth, semantics
from eval.commands.odometry import odometry
from eval.commands.pace import pace
from eval.commands.planes import planes
from eval.commands.sensor import sensor
from eval.commands.watching import watching

app = typer.Typer(
    help="Measures single parts, so that anybody can repeat it.", no_args_is_help=True
)
app.command("baselines")(baselines)
app.command("odometry")(odometry)
app.command("pace")(pace)
app.command("planes")(planes)
app.command("sensor")(sensor)
app.command("semantics")(semantics)
app.command("growth")(growth)
app.command("watching")(watching)
