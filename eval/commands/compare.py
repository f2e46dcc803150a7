"""``roomloop compare``: did a change make anything worse?"""

from __future__ import annotations

import math
from pathlib import Path
from typing import Annotated

import typer

from eval.names import refuse

Results = Annotated[Path, typer.Argument(help="Folder of an ablation, or of runs.")]


def compare(
    a: Results,
    b: Results,
    metrics: Annotated[
        str | None, typer.Option(help="Numbers of metrics.json, as ate_m,rooms.recall.")
    ] = None,
    tolerance: Annotated[
        float, typer.Option(help="Percent below which a difference does not matter.")
    ] = 1.0,
    markdown: Annotated[Path | None, typer.Option(help="Write the table to this file too.")] = None,
) -> int:
    """Compare two result sets: the CI gate.

    What moved beyond noise from A (say, the main branch) to B (yours)? Exit status 1 if anything is
    worse. Runs pair by scene and seed; noise is judged by a t-test of the mean over scenes,
    Holm-adjusted over all metrics, at 5 %.
    """
    from rich.console import Console

    from eval.comparing.compare import GATE, change_sheet, read_results, regressions
    from eval.comparing.compare import compare as compare_results
    from eval.comparing.tables import markdown as markdown_of
    from eval.comparing.values import check_metric
    from eval.files import write_text
    from eval.screen import line, output, show_sheet

    if not (math.isfinite(tolerance) and tolerance >= 0.0):
        refuse(f"tolerance: expected percent from 0, got {tolerance}")
    names = [check_metric("metrics", n.strip()) for n in metrics.split(",")] if metrics else GATE
    verdict = compare_results(read_results(a), read_results(b), names, tolerance)
    sheet = change_sheet(verdict)
    console, screen = output(), Console(stderr=True)
    show_sheet(console, sheet)
    if verdict.left_out:
        line(console, f"{verdict.left_out} runs have no partner in the other set")
    if markdown is not None:
        write_text(markdown, markdown_of([sheet], note=""))
    for text in regressions(verdict):
        line(screen, f"roomloop: worse: {text}")
    return 1 if verdict.worse else 0
