"""Values laid along the sides of an outline: which room, opening or face is where."""

from __future__ import annotations

import itertools
from collections.abc import Iterable
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from slam.core import Array, IntArray
from worlds.outline import TOUCH

NOTHING = -1
"""Value of what nothing was laid on."""


@dataclass(frozen=True)
class SideMap:
    """Intervals along sides. side: (S,); low, high: (S,) from the side's start [m]; value: (S,)."""

    side: IntArray
    low: Array
    high: Array
    value: IntArray

    @cached_property
    def _rows(self) -> dict[int, list[tuple[float, float, int]]]:
        rows: dict[int, list[tuple[float, float, int]]] = {}
        columns = (self.side.tolist(), self.low.tolist(), self.high.tolist(), self.value.tolist())
        for side, low, high, value in sorted(zip(*columns, strict=True)):
            rows.setdefault(side, []).append((low, high, value))
        return rows

    def on(self, side: int) -> list[tuple[float, float, int]]:
        """(low, high, value) on one side, in order."""
        return self._rows.get(side, [])

    def at(self, side: int, along: float) -> int:
        """The value at one place, NOTHING where there is none."""
        for low, high, value in self.on(side):
            if low - TOUCH <= along <= high + TOUCH:
                return value
        return NOTHING

    def split(self, side: int, low: float, high: float) -> list[tuple[float, float, int]]:
        """The stretch from low to high, cut where the value changes; NOTHING fills the rest."""
        ends = sorted(end for a, b, _ in self.on(side) for end in (a, b))
        inner = [end for end in ends if low + TOUCH < end < high - TOUCH]
        cuts = [low, *inner, high]
        found: list[tuple[float, float, int]] = []
        for a, b in itertools.pairwise(cuts):
            value = self.at(side, (a + b) / 2.0)
            if found and (found[-1][2] == value or b - a < TOUCH):
                found[-1] = (found[-1][0], b, found[-1][2])
            else:
                found.append((a, b, value))
        return found

    def relabelled(self, values: IntArray) -> SideMap:
        """The same intervals with other values (S,)."""
        return SideMap(self.side, self.low, self.high, values)


def side_map(rows: Iterable[tuple[int, float, float, int]]) -> SideMap:
    """From (side, low, high, value) rows."""
    table = np.array(list(rows), dtype=np.float64).reshape(-1, 4)
    whole = table[:, [0, 3]].astype(np.int64)
    return SideMap(whole[:, 0], table[:, 1], table[:, 2], whole[:, 1])
