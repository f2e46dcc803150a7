"""A real sensor's recording beside what a preset would have recorded in its place."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from eval.files import whole_file, write_text
from eval.recordings import open_recording
from eval.recordings.packets import PacketRecording
from sim.calibration.beams import Calibration, calibrate, calibrate_at
from sim.calibration.shots import Shots
from sim.calibration.twin import simulated_twin
from sim.sensor import Sensor
from slam.core import Array, InputError

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

RECORDED, SIMULATED = "#1f78b4", "#e08214"
FARTHEST = 8.0
"""Range at which the picture's colours end [m]."""


@dataclass(frozen=True)
class Column:
    """A figure that each beam has: its name with its unit, and the factor to that unit."""

    name: str
    field: str
    factor: float

    def of(self, calibration: Calibration) -> Array:
        """(B,) in its unit."""
        return np.asarray(self.factor * getattr(calibration, self.field))


COLUMNS = (
    Column("offset [mm]", "offset", 1e3),
    Column("spread [mm]", "spread", 1e3),
    Column("noise [mm]", "noise", 1e3),
    Column("wall dropout [%]", "dropout", 100.0),
    Column("no return [%]", "lost", 100.0),
)


@dataclass(frozen=True)
class Comparison:
    """Shots as recorded and as simulated in a twin of the scene, and what both say."""

    sensor: Sensor
    recorded_shots: Shots
    simulated_shots: Shots
    recorded: Calibration
    simulated: Calibration


def compare(path: Path, sensor: Sensor, seed: int = 0) -> Comparison:
    """Calibrates a recording of a sensor at rest. Raises InputError."""
    recording = open_recording(path)
    if not isinstance(recording, PacketRecording):
        raise InputError(
            f"{path}: expected VLP-16 packets (pcap or bin): bags do not tell of lost shots"
        )
    shots = recording.shots()
    try:
        recorded = calibrate(shots, np.random.default_rng(seed))
    except InputError as error:
        raise InputError(f"{path}: {error}") from error
    drawn = np.random.default_rng([seed, 1])
    twin = simulated_twin(shots, recorded.offset, sensor, drawn)
    return Comparison(sensor, shots, twin, recorded, calibrate_at(recorded.planes, twin))


def sensor_text(found: Calibration, sensor: Sensor, source: str) -> str:
    """A sensor file with a recording's errors; beams that met no wall have the median of the others
    and no offset."""
    noise = np.where(np.isfinite(found.noise), found.noise, np.nanmedian(found.noise))
    dropout = float(np.nanmedian(found.dropout))
    return (
        f'source = "{source}, taken apart by roomloop calibrate"\n'
        f'based_on = "{sensor.name}"\n'
        f"range_offsets_mm = {_listed(1e3 * np.nan_to_num(found.offset))}\n"
        f"range_noise_mm = {_listed(1e3 * noise)}\n"
        f"dropout = {dropout:.4f}\n"
    )


def write_sensor(comparison: Comparison, path: Path, recording: Path) -> None:
    """Writes the recorded unit as a sensor file. Raises InputError."""
    text = sensor_text(comparison.recorded, comparison.sensor, recording.name)
    write_text(path, text)


def _listed(values: Array) -> str:
    return "[" + ", ".join(f"{value + 0.0:.1f}" for value in values) + "]"


# --- the picture ----------------------------------------------------------------------------------


def save_picture(comparison: Comparison, path: Path, title: str) -> None:
    """Writes a PNG file, whole or not at all."""
    with whole_file(path) as part:
        _figure(comparison, title).savefig(part, format="png", dpi=110)


def _figure(comparison: Comparison, title: str) -> Figure:
    from matplotlib.figure import Figure

    figure = Figure(figsize=(14.0, 10.0), layout="constrained")
    figure.suptitle(f"{title} and {comparison.sensor.name}")
    grid = figure.add_gridspec(3, len(COLUMNS))
    shots = (comparison.recorded_shots, comparison.simulated_shots)
    for row, (name, table) in enumerate(zip(("recorded", "simulated"), shots, strict=True)):
        _draw_ranges(figure.add_subplot(grid[row, :]), table, name)
    for place, column in enumerate(COLUMNS):
        _draw_column(figure.add_subplot(grid[2, place]), column, comparison)
    return figure


def _draw_ranges(axes: Axes, shots: Shots, name: str) -> None:
    """One pixel a beam and half a degree: the median range, white where less than half returned."""
    image = axes.imshow(
        _range_image(shots)[::-1],
        extent=(-180.0, 180.0, -0.5, shots.ranges.shape[1] - 0.5),
        aspect="auto",
        vmin=0.0,
        vmax=FARTHEST,
        cmap="viridis",
        interpolation="nearest",
    )
    axes.set(title=f"{name}: range [m]", xlabel="azimuth [degrees]", ylabel="beam")
    axes.figure.colorbar(image, ax=axes, pad=0.01)


def _range_image(shots: Shots, cells: int = 720) -> Array:
    cell = np.minimum(shots.cells(2.0 * np.pi / cells), cells - 1)
    image = np.full((shots.ranges.shape[1], cells), np.nan)
    for beam, (ranges, place) in enumerate(zip(shots.ranges.T, cell.T, strict=True)):
        order = np.argsort(place, kind="stable")
        parts = np.split(ranges[order], np.searchsorted(place[order], np.arange(1, cells)))
        middles = [float(np.median(part)) if len(part) else 0.0 for part in parts]
        image[beam] = np.where(np.array(middles) > 0.0, middles, np.nan)
    return image


def _draw_column(axes: Axes, column: Column, comparison: Comparison) -> None:
    beams = np.arange(len(comparison.recorded.offset))
    found: Sequence[tuple[str, Calibration, str, float]] = (
        ("recorded", comparison.recorded, RECORDED, -0.2),
        ("simulated", comparison.simulated, SIMULATED, 0.2),
    )
    for label, calibration, colour, aside in found:
        axes.bar(beams + aside, column.of(calibration), 0.4, color=colour, label=label)
    axes.set(title=column.name, xlabel="beam")
    axes.legend(fontsize=7)
