"""Solid slices of a storey, one above the other, as walls from floor to ceiling with openings."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import shapely
from shapely.geometry import MultiPolygon
from shapely.geometry.base import BaseGeometry

from worlds.drafting import as_multipolygon
from worlds.plan import Opening
from worlds.readers.outlines import clean_walls, without_slivers

STANDS = 0.10
"""What begins lower than this above the floor begins on it [m]."""
REACHES = 0.15
"""What ends less than this below the ceiling ends there [m]."""
LOWEST = 0.05
"""Bodies and openings less high than this are left out [m]."""
HEADROOM = 1.2
"""What is open from the floor up to less than this is taken for solid: nobody fits through [m]."""
WINDOW = 0.3
"""An opening that begins higher than this above the floor is called a window [m]."""
FILM = 0.04
"""Openings narrower than this are what straightening left [m]."""
LEAST = 0.01
"""Openings smaller than this in plan are left out [m2]."""
ALIKE = 0.02
"""Slices that differ by less are one [m2]."""


@dataclass(frozen=True)
class Slice:
    """What is solid between two heights above the floor [m]."""

    low: float
    high: float
    solid: MultiPolygon


def carve(slices: Sequence[Slice]) -> tuple[MultiPolygon, tuple[Opening, ...]]:
    """The walls, and what is open in them: at each place its highest opening.

    slices: from floor to ceiling, without gaps.
    """
    slices = _merged(slices)
    walls = clean_walls(shapely.union_all([s.solid for s in slices]))
    gaps = [without_slivers(walls.difference(s.solid), FILM) for s in slices]
    remaining: BaseGeometry = walls
    openings: list[Opening] = []
    for low, high, common in _open_spans(slices, gaps):
        found = common.intersection(remaining)
        if found.area < LEAST:
            continue
        parts = [part for part in without_slivers(found, FILM).geoms if part.area > LEAST]
        if parts and worth_opening(low, high, slices[-1].high):
            kind = "window" if low > WINDOW else "opening"
            sill = 0.0 if low <= STANDS else low
            openings += [Opening(kind, part, sill, high) for part in parts]
        rest = as_multipolygon(remaining.difference(shapely.union_all(parts)))
        remaining = MultiPolygon([part for part in rest.geoms if part.area > LEAST])
    return walls, tuple(openings)


def worth_opening(low: float, high: float, height: float) -> bool:
    """Whether what is open between two heights above the floor is an opening of the plan."""
    if low <= STANDS:
        return high >= HEADROOM
    return high - low > LOWEST and low < height - REACHES


def _merged(slices: Sequence[Slice]) -> list[Slice]:
    """Slices of which no neighbours are alike."""
    found = [slices[0]]
    for following in slices[1:]:
        last = found[-1]
        if last.solid.symmetric_difference(following.solid).area < ALIKE:
            found[-1] = Slice(last.low, following.high, last.solid)
        else:
            found.append(following)
    return found


def _open_spans(
    slices: Sequence[Slice], gaps: Sequence[MultiPolygon]
) -> list[tuple[float, float, BaseGeometry]]:
    """What is open throughout each run of slices, with its heights, the highest run first."""
    found = []
    for i in range(len(slices)):
        common: BaseGeometry = gaps[i]
        for j in range(i, len(slices)):
            common = common.intersection(gaps[j]) if j > i else common
            if common.area < LEAST:
                break
            found.append((slices[i].low, slices[j].high, common))
    return sorted(found, key=lambda span: span[0] - span[1])
