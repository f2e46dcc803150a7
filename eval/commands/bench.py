"""``roomloop bench``: measurements that anybody can repeat."""

from __future__ import annotations

import typer

from eval.commands.odometry import odometry

app = typer.Typer(
    help="Measures single parts, so that anybody can repeat it.", no_args_is_help=True
)
app.command("odometry")(odometry)


@app.callback()
def bench() -> None:
    """Keeps the names of subcommands even while there is one only."""
