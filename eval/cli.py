"""The command line. What is heavy is imported inside the commands, so that help comes at once."""

from __future__ import annotations

import os
import sys
from collections.abc import Sequence

import typer

from eval.commands.ablate import ablate
from eval.commands.bench import app as bench
from eval.commands.calibrate import calibrate
from eval.commands.compare import compare
from eval.commands.gallery import gallery
from eval.commands.paper import paper
from eval.commands.record import record
from eval.commands.report import report
from eval.commands.run import run
from eval.commands.scenes import scenes
from eval.commands.score import score
from eval.commands.train import train
from eval.commands.view import view

LONGEST_LINE = 500
"""Characters of an error; a value that a file holds may be a megabyte."""

app = typer.Typer(
    help="Evaluates indoor semantic LiDAR SLAM in simulation: a floor plan becomes a world, "
    "a robot drives through it, and every step of the SLAM is scored against the truth.",
    add_completion=False,
    rich_markup_mode=None,
    pretty_exceptions_enable=False,
)
app.command()(run)
app.command()(scenes)
app.command()(view)
app.command()(report)
app.command()(gallery)
app.command()(ablate)
app.command()(compare)
app.command()(score)
app.command()(record)
app.command()(calibrate)
app.command()(train)
app.command()(paper)
app.add_typer(bench, name="bench")


def main(arguments: Sequence[str] | None = None) -> int:
    """Runs a command; the exit status (see README, "Exit status")."""
    # numpy's matrices are small here: its threads only take the simulator's core from it.
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    try:
        status = app(args=arguments, prog_name="roomloop", standalone_mode=False)
    except typer.TyperException as error:
        return _report_usage(error)
    except KeyboardInterrupt:
        status = 130
    except Exception as error:
        if not _stopped(error):
            return _report(error)
        status = 130
    if status == 130:
        _say("stopped")
    return status if isinstance(status, int) else 0


def _stopped(error: BaseException | None) -> bool:
    """Whether Ctrl-C is behind an error: a library that was being loaded makes its own of it."""
    while error is not None and not isinstance(error, KeyboardInterrupt):
        error = error.__cause__ or error.__context__
    return error is not None


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
    """One line, no longer than people read, its end kept; what a file holds moves no cursor."""
    line = "".join(c if c.isprintable() else "?" for c in " ".join(text.split()))
    if len(line) > LONGEST_LINE:
        line = f"{line[: LONGEST_LINE - 100]} ... {line[-95:]}"
    print(f"roomloop: {line}", file=sys.stderr)


if __name__ == "__main__":
    sys.exit(main())
