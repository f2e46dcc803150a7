"""``roomloop calibrate``: a real sensor's errors beside a preset's."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

if TYPE_CHECKING:
    from rich.table import Table

    from eval.studies.calibration import Comparison

Option = typer.Option


def calibrate(
    recording: Annotated[Path, typer.Argument(help="VLP-16 packets of a sensor at rest.")],
    sensor: Annotated[str, Option(help="Preset, or a .toml file, to compare with.")] = "vlp16",
    out: Annotated[
        Path | None, Option(help="The picture's file (default: RECORDING-calibration.png).")
    ] = None,
    toml: Annotated[
        Path | None, Option(help="Write the recorded unit's errors as a sensor file, too.")
    ] = None,
    seed: Annotated[int, Option(help="Of the search for walls and of the simulated noise.")] = 0,
) -> None:
    """Take a sensor's errors from a recording.

    And put a preset in its place, to see both side by side.
    """
    from rich.console import Console

    from eval.files import make_folder
    from eval.studies.calibration import compare, save_picture, write_sensor
    from sim.sensorfile import sensor_named

    for path in filter(None, (out, toml)):
        make_folder(path.parent)
    found = compare(recording, sensor_named(sensor), seed)
    console = Console()
    console.print(_table(found))
    picture = out or Path(f"{recording.stem}-calibration.png")
    save_picture(found, picture, recording.name)
    written = [picture]
    if toml is not None:
        write_sensor(found, toml, recording)
        written.append(toml)
    for path in written:
        console.print(str(path), markup=False, highlight=False, soft_wrap=True)


def _table(found: Comparison) -> Table:
    import numpy as np
    from rich.box import SIMPLE_HEAD
    from rich.table import Table

    from eval.studies.calibration import COLUMNS

    table = Table("beam", box=SIMPLE_HEAD, padding=0, caption="recorded / simulated")
    columns = [(c.of(found.recorded), c.of(found.simulated)) for c in COLUMNS]
    for column in COLUMNS:
        table.add_column(column.name, justify="right")
    for beam in range(found.sensor.beams):
        table.add_row(str(beam), *(_pair(ours[beam], theirs[beam]) for ours, theirs in columns))
    medians = (_pair(np.nanmedian(ours), np.nanmedian(theirs)) for ours, theirs in columns[1:])
    table.add_row("median", "", *medians)
    return table


def _pair(ours: float, theirs: float) -> str:
    return " / ".join("-" if value != value else f"{value:.1f}" for value in (ours, theirs))
