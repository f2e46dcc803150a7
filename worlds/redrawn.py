"""What a site or an office makes of a plan before it is built: partitions left unfinished or
glazed, doors without frames, panes in the windows."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np
import shapely
from shapely.geometry import Polygon

from slam.core import Array
from worlds.conditions import IDEAL, Conditions
from worlds.layout import lay_out
from worlds.plan import Opening, Storey
from worlds.survey import as_built, survey
from worlds.truth import Face, Truth

SHORTEST = 1.6
"""Partitions with less straight wall than this stay as drawn [m]."""
END = 0.2
"""Wall left at both ends of what is taken out of a partition [m]."""
BEYOND = 0.02
"""How far an opening's footprint reaches into the rooms, so that it surely cuts the wall [m]."""
STUD, BAY = 0.05, 0.55
"""Width of a stud, and the space between two of them [m]."""
THICKEST_STUDS = 0.20
"""Thicker partitions are masonry: half-high or with a gap, but without studs [m]."""
GAP = (0.9, 2.3)
"""Widths of what is missing of a partition, so that its rooms stay two rooms [m]."""
PARAPET = (0.8, 1.5)
"""Heights of partitions that are half-high [m]."""
PANE_HEAD = 2.2
"""Height of a glazed partition's panes [m]."""


@dataclass(frozen=True)
class Partition:
    """A straight stretch of wall between two rooms, without openings. start: (2,) on the face of
    one of them; along, across: (2,) unit vectors, the second to the other face."""

    start: Array
    along: Array
    across: Array
    length: float
    thickness: float

    def footprint(self, low: float, high: float) -> Polygon:
        """The plan of an opening between two places along it."""
        near, far = -BEYOND * self.across, (self.thickness + BEYOND) * self.across
        first, last = self.start + low * self.along, self.start + high * self.along
        return Polygon([first + near, last + near, last + far, first + far])


def redrawn(storey: Storey, conditions: Conditions, rng: np.random.Generator) -> Storey:
    """The storey as it will be built."""
    if not conditions.redrawn:
        return storey
    height = storey.z_ceiling - storey.z_floor
    openings = [_finished(opening, height, conditions, rng) for opening in storey.openings]
    for partition in partitions(storey):
        chance = float(rng.random())
        if chance < conditions.unfinished:
            openings += _unfinished(partition, height, rng)
        elif chance < conditions.unfinished + conditions.glass_walls:
            openings.append(_glazed(partition, height, rng))
    return replace(storey, openings=tuple(openings))


def _finished(
    opening: Opening, height: float, conditions: Conditions, rng: np.random.Generator
) -> Opening:
    chance = float(rng.random())
    if opening.kind == "window":
        return replace(opening, glass=opening.glass or chance < conditions.windows)
    return replace(opening, z_max=height) if chance < conditions.bare else opening


def _unfinished(partition: Partition, height: float, rng: np.random.Generator) -> Iterator[Opening]:
    """A gap, a frame of studs without its panels, or a wall that is half-high as yet."""
    low, high = END, partition.length - END
    kind = int(rng.integers(3))
    if kind == 0:
        width = min(float(rng.uniform(*GAP)), high - low)
        start = low + float(rng.random()) * (high - low - width)
        yield Opening("opening", partition.footprint(start, start + width), 0.0, height)
    elif kind == 1 and partition.thickness <= THICKEST_STUDS:
        # Nobody drives between studs: they stand on a rail.
        for bay in np.arange(low, high - BAY, BAY + STUD).tolist():
            yield Opening("window", partition.footprint(bay, bay + BAY), 0.0, height)
    else:
        width = float(rng.uniform(0.5, 1.0)) * (high - low)
        start = low + float(rng.random()) * (high - low - width)
        sill = min(float(rng.uniform(*PARAPET)), 0.8 * height)
        yield Opening("window", partition.footprint(start, start + width), sill, height)


def _glazed(partition: Partition, height: float, rng: np.random.Generator) -> Opening:
    width = float(rng.uniform(0.5, 1.0)) * (partition.length - 2.0 * END)
    start = END + float(rng.random()) * (partition.length - 2.0 * END - width)
    sill = 0.0 if rng.random() < 0.5 else 0.9
    footprint = partition.footprint(start, start + width)
    return Opening("window", footprint, sill, min(PANE_HEAD, height), glass=True)


# --- where there are partitions ------------------------------------------------------------------


def partitions(storey: Storey) -> list[Partition]:
    """All partitions of a storey as drawn that are long enough to be changed."""
    layout = lay_out(storey)
    truth, _ = survey([as_built(0, layout, IDEAL, np.random.default_rng(0))])
    openings = shapely.STRtree([opening.footprint for opening in storey.openings])
    long = [p for p in _all_partitions(truth) if p.length >= SHORTEST]
    inner = [p.footprint(END, p.length - END) for p in long]
    return [
        p
        for p, core in zip(long, inner, strict=True)
        if not len(openings.query(core, "intersects"))
    ]


def _all_partitions(truth: Truth) -> Iterator[Partition]:
    for wall in truth.walls:
        first, second = (truth.faces[k] for k in wall.faces)
        if first.room != second.room:
            yield from _between(first, second)


def _between(first: Face, second: Face) -> Iterator[Partition]:
    """The stretches along which two faces of one wall run beside each other."""
    for start, end in first.parts:
        length = float(np.linalg.norm(end - start))
        along = (end - start) / length
        for part in second.parts:
            places = np.clip(np.sort((part - start) @ along), 0.0, length)
            low, high = (float(place) for place in places)
            across = -first.normal[:2]
            thickness = float((part[0] - start) @ across)
            if high > low and thickness > 0.0:
                yield Partition(start + low * along, along, across, high - low, thickness)
