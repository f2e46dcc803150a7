"""``roomloop bench odometry``: odometries alone, compared on the same drives."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from eval.detectors import ODOMETRIES

if TYPE_CHECKING:
    from rich.table import Table

    from eval.studies.odometry import Factory, StudyRow

Option = typer.Option
Many = list[str]


def odometry(
    scenes: Annotated[Many, typer.Argument(help="Scenes, plan files, or generated-N.")],
    odometry: Annotated[
        Many | None, Option(help=f"Which: {', '.join(ODOMETRIES)}; again for more (default: kiss).")
    ] = None,
    seed: Annotated[list[int] | None, Option(help="Again for more (default: 0).")] = None,
    sensor: Annotated[Many | None, Option(help="Again for more (default: vlp16).")] = None,
    speed: Annotated[list[float] | None, Option(help="[m/s] (default: 0.6).")] = None,
    turn_rate: Annotated[list[float] | None, Option(help="[rad/s] (default: 0.8).")] = None,
    kiss: Annotated[
        Many | None,
        Option(help="kiss with changed settings, e.g. voxel_size=0.5,threshold=0.2."),
    ] = None,
    duration: Annotated[float | None, Option(help="Simulated seconds of each drive.")] = None,
    out: Annotated[
        Path | None,
        Option(help="Keeps the rows in this JSON file, and goes on with what it lacks."),
    ] = None,
) -> None:
    """Odometries alone on drives of every combination: ATE, RPE, where they lose track."""
    from rich.console import Console

    from eval.screen import RunProgress, our_warnings_only
    from eval.studies.odometry import StudyCase, StudyFile, cases, study

    screen = Console(stderr=True)
    our_warnings_only(screen)
    made = _factories(odometry or ([] if kiss else ["kiss"]), kiss or [])
    drives = cases(
        scenes,
        seed or [StudyCase.seed],
        sensor or [StudyCase.sensor],
        speed or [StudyCase.speed],
        turn_rate or [StudyCase.turn_rate],
        duration,
    )
    kept = StudyFile(out)
    with RunProgress("odometry", screen, "drives") as progress:
        for done, case in enumerate(drives):
            lacking = kept.missing(case, made)
            if lacking:
                kept.add(study(case, {name: made[name] for name in lacking}))
            progress(done + 1, len(drives))
    rows = [row for row in kept.rows if row.case in drives and row.odometry in made]
    console = Console(width=120)
    console.print(_table(rows))
    console.print(_summary(rows))


def _factories(names: Sequence[str], settings: Sequence[str]) -> Mapping[str, Factory]:
    """What makes each odometry, by what it is called in the table. Raises InputError."""
    from functools import partial

    from eval.detectors import check_name, make_odometry

    for name in names:
        check_name("odometry", name, ODOMETRIES)
    made: dict[str, Factory] = {name: partial(make_odometry, name) for name in names}
    return made | {text: _changed_kiss(text) for text in settings}


def _changed_kiss(text: str) -> Factory:
    """KISS-ICP with settings from ``name=value,...``."""
    from eval.names import known, refuse
    from slam.kiss import KissConfig, KissOdometry

    defaults = asdict(KissConfig())
    values: dict[str, float | bool] = {}
    for part in text.split(","):
        name, _, value = part.partition("=")
        known("kiss", name, defaults)
        try:
            values[name] = type(defaults[name])(float(value))
        except (ValueError, OverflowError):
            refuse(f"kiss: {name}: expected a number, got {value!r}")
    config = KissConfig(**values)  # type: ignore[arg-type]
    return lambda: KissOdometry(config)


def _table(rows: Sequence[StudyRow]) -> Table:
    from rich.box import SIMPLE_HEAD
    from rich.table import Table

    table = Table("scene", "sensor", "odometry", box=SIMPLE_HEAD, padding=0)
    for name in ("seed", "m/s", "rad/s", "ATE cm", "xy", "z", "yaw deg", "RPE %", "m", "ms", ""):
        table.add_column(name, justify="right")
    for row in rows:
        case = row.case
        table.add_row(
            Path(case.scene).stem,
            case.sensor,
            row.odometry,
            str(case.seed),
            f"{case.speed:g}",
            f"{case.turn_rate:g}",
            *(_number(value, 100.0) for value in (row.ate, row.ate_xy, row.ate_z)),
            _number(row.yaw_deg),
            _number(row.rpe_percent),
            f"{row.path_m:.0f}",
            f"{row.ms:.1f}",
            "" if row.diverged_s is None else f"lost at {row.diverged_s:.0f} s",
        )
    return table


def _summary(rows: Sequence[StudyRow]) -> Table:
    from rich.box import SIMPLE_HEAD
    from rich.table import Table

    from eval.studies.odometry import summaries

    table = Table("odometry", box=SIMPLE_HEAD, padding=0)
    for name in ("mean ATE cm", "worst", "drives", "lost", "ms a scan"):
        table.add_column(name, justify="right")
    for item in summaries(rows):
        table.add_row(
            item.odometry,
            _number(item.mean, 100.0),
            _number(item.worst, 100.0),
            str(item.drives),
            str(item.diverged),
            f"{item.ms:.1f}",
        )
    return table


def _number(value: float | None, scale: float = 1.0) -> str:
    return "-" if value is None else f"{scale * value:.1f}"
