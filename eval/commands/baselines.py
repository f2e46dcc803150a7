"""``roomloop bench baselines``: the parameters that suit the baselines best."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from eval.names import known

Option = typer.Option


def baselines(
    cache: Annotated[Path, Option(help="Where the drives through the buildings are kept.")],
    only: Annotated[str | None, Option(help="One of them: hydra or sgraphs.")] = None,
) -> None:
    """Search the baselines' parameters for a 16-beam sensor on generated buildings; takes hours.

    Each line is a change that was for the better.
    """
    from eval.studies.baseline_search import METHODS, searches

    if only is not None:
        known("only", only, METHODS)
    for line in searches(METHODS if only is None else (only,), cache):
        typer.echo(line, nl=False)
