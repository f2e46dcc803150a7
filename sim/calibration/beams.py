"""What a sensor's shots at walls say about each of its beams: offset, noise and dropout.

The sensor stands still. Walls are fitted to what it sees; what is left is taken apart into what is
fixed for a beam, what repeats with the direction, and what differs from turn to turn. Recorded and
simulated shots go through the same code. An error common to all beams cannot be seen this way:
offsets are relative to their mean.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from sim.calibration.shots import Mask, Shots
from sim.calibration.walls import Seen, WallConfig, fit_planes, fit_planes_and_offsets
from slam.core import Array, IntArray


@dataclass(frozen=True)
class BeamConfig:
    """walls: how they are found; least_shots: at walls, below which a beam has no numbers;
    widest_gap: firings in a row without a return that still count as dropout and not as a hole;
    cell [rad]: directions that count as the same; least_turns: that must have hit a cell; jump [m]:
    of the range across an edge; clear [m]: how far a mixed pixel is from both sides."""

    walls: WallConfig = WallConfig()
    least_shots: int = 600
    widest_gap: int = 5
    cell: float = np.radians(0.2)
    least_turns: int = 3
    jump: float = 0.3
    clear: float = 0.1


@dataclass(frozen=True)
class Calibration:
    """Tables have one entry a beam, (B,), NaN where a beam saw too little of walls.

    offset [m] from the walls, relative to the beams' mean; spread [m], standard deviation about
    wall plus offset; noise [m], about the mean of one direction, turn by turn; dropout, the share
    of shots at walls without a return; lost, the share of all shots; points: the returns behind all
    that. planes: (P, 4) n and d of the walls; dropout_by_cosine: (5,) by fifths of the cosine of
    incidence, of all beams; mixed: mixed pixels per range edge.
    """

    offset: Array
    spread: Array
    noise: Array
    dropout: Array
    lost: Array
    points: IntArray
    planes: Array
    dropout_by_cosine: Array
    mixed: float


def calibrate(
    shots: Shots, rng: np.random.Generator, config: BeamConfig = BeamConfig()
) -> Calibration:
    """All statistics of a sensor that stood still. Raises InputError when it saw no wall."""
    return calibrate_at(fit_planes(shots.points, rng, config.walls), shots, config)


def calibrate_at(walls: Array, shots: Shots, config: BeamConfig = BeamConfig()) -> Calibration:
    """The same where walls (P, 4) are known about, from another recording of the place."""
    planes, offsets, seen = fit_planes_and_offsets(shots, walls, config.walls)
    residual = np.where(seen.clean, seen.residual, np.nan)
    known = seen.clean.sum(axis=0) >= config.least_shots
    residual[:, ~known] = np.nan
    meant, lost = meant_for_planes(shots, seen, config.widest_gap)
    return Calibration(
        offset=np.where(known, offsets - offsets[known].mean(), np.nan),
        spread=_std(residual),
        noise=noise_within_cells(shots, residual, seen.plane, config),
        dropout=_share(lost.sum(axis=0), np.where(known, (meant >= 0).sum(axis=0), 0)),
        lost=1.0 - shots.returned.mean(axis=0),
        points=seen.clean.sum(axis=0),
        planes=planes,
        dropout_by_cosine=_by_fifths(meant, lost, shots, planes),
        mixed=mixed_pixels(shots, config),
    )


def noise_within_cells(shots: Shots, residual: Array, which: IntArray, config: BeamConfig) -> Array:
    """(B,) standard deviation [m] of what one beam measures in one direction, turn by turn.

    Cells with nine times the usual variance lie on an edge and do not count.
    """
    cell = shots.cells(config.cell) * (which.max() + 2) + which + 1
    beams = zip(residual.T, cell.T, strict=True)
    return np.array([_noise_of_beam(*beam, config.least_turns) for beam in beams])


def _noise_of_beam(residual: Array, cell: IntArray, least: int) -> float:
    known = np.isfinite(residual)
    _, place, count = np.unique(cell[known], return_inverse=True, return_counts=True)
    values = residual[known]
    mean = np.bincount(place, values) / np.maximum(count, 1)
    squares, free = np.bincount(place, (values - mean[place]) ** 2), count - 1
    enough = count >= least
    if enough.sum() < 20:
        return np.nan
    variance = squares[enough] / free[enough]
    calm = variance < 9.0 * np.median(variance)
    return float(np.sqrt(squares[enough][calm].sum() / free[enough][calm].sum()))


# --- shots without a return -----------------------------------------------------------------------


def meant_for_planes(shots: Shots, seen: Seen, widest_gap: int) -> tuple[IntArray, Mask]:
    """(F, B) the plane each shot met or should have met, or -1; and those without a return.

    A lost shot should have met a plane where the same beam met it before and after, with at most
    ``widest_gap`` lost shots in a row: wider holes are windows, dark things and near things.
    """
    row = np.arange(len(seen.plane))[:, None]
    before = np.maximum.accumulate(np.where(shots.returned, row, -1), axis=0)
    after = np.where(shots.returned, row, len(row))[::-1]
    after = np.minimum.accumulate(after, axis=0)[::-1]
    inside = (before >= 0) & (after < len(row)) & (after - before - 1 <= widest_gap)
    left = np.take_along_axis(seen.plane, np.maximum(before, 0), axis=0)
    right = np.take_along_axis(seen.plane, np.minimum(after, len(row) - 1), axis=0)
    lost = ~shots.returned & inside & (left >= 0) & (left == right)
    return np.where(lost, left, seen.plane), lost


def _by_fifths(meant: IntArray, lost: Mask, shots: Shots, planes: Array) -> Array:
    """(5,) dropout where the cosine of incidence is 0 to 0.2, ... 0.8 to 1; NaN under 500 shots."""
    known = meant >= 0
    cosine = -np.einsum("ij,ij->i", shots.directions[known], planes[meant[known], :3])
    fifth = np.clip((cosine * 5.0).astype(np.int64), 0, 4)
    tried = np.bincount(fifth, minlength=5)
    return _share(np.bincount(fifth, lost[known], 5), np.where(tried >= 500, tried, 0))


def mixed_pixels(shots: Shots, config: BeamConfig) -> float:
    """Share of the range edges that beams passed, without a lost shot, which a return from between
    the two surfaces blurs; NaN without edges."""
    ranges, returned = shots.ranges, shots.returned
    before, middle, after = ranges[:-2], ranges[1:-1], ranges[2:]
    whole = returned[:-2] & returned[1:-1] & returned[2:]
    low, high = np.minimum(before, after), np.maximum(before, after)
    between = (middle > low + config.clear) & (middle < high - config.clear)
    mixed = np.zeros(ranges.shape, dtype=bool)
    mixed[1:-1] = whole & between & (high - low > config.jump)
    jumps = returned[1:] & returned[:-1] & (np.abs(np.diff(ranges, axis=0)) > config.jump)
    clean = jumps & ~mixed[1:] & ~mixed[:-1]
    edges = mixed.sum() + clean.sum()
    return float(mixed.sum() / edges) if edges else np.nan


def _std(table: Array) -> Array:
    """(B,) standard deviations over the known entries, NaN for fewer than 50."""
    known = np.isfinite(table)
    count = np.maximum(known.sum(axis=0), 1)
    mean = np.where(known, table, 0.0).sum(axis=0) / count
    square = np.where(known, (table - mean) ** 2, 0.0).sum(axis=0) / count
    return np.where(known.sum(axis=0) >= 50, np.sqrt(square), np.nan)


def _share(part: Array | IntArray, whole: Array | IntArray) -> Array:
    return np.where(whole > 0, part / np.maximum(whole, 1), np.nan)
