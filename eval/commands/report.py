"""``roomloop report``: the page of a finished run or ablation, made again from its files."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer


def report(
    folder: Annotated[Path, typer.Argument(help="The folder of a run or of an ablation.")],
) -> None:
    """Make a run's page, report.html, again."""
    from rich.console import Console

    from eval.report.ablation import write_ablation
    from eval.report.run import write_report

    is_ablation = folder.is_dir() and not (folder / "config.json").exists()
    path = (write_ablation if is_ablation else write_report)(folder)
    Console().print(str(path), markup=False, highlight=False, soft_wrap=True)
