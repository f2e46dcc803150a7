"""Which storey each keyframe is on: told by the height of the base wherever it stands level."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from slam.core import Array


@dataclass(frozen=True)
class StoreyConfig:
    """apart [m]: a base that stands level so far above or below all known storeys is on another
    one; level [rad]: the largest tilt of one that does, less than any ramp's; same [m]: what a
    storey's floor may depart from level, and its height is learned from; learn: by this share."""

    apart: float = 2.0
    level: float = np.radians(2.5)
    same: float = 0.5
    learn: float = 0.1


class Storeys:
    """Numbers the storeys in the order in which the base comes to them; on a ramp it is on the
    nearer one. What was told of a keyframe stays."""

    def __init__(self, config: StoreyConfig = StoreyConfig()):
        self._config = config
        self._heights: list[float] = []
        self._of: list[int] = []

    def at(self, T_map_base: Array) -> int:
        """The storey that a base at a pose (4, 4) is on, the next number if on a new one."""
        off = [abs(float(T_map_base[2, 3]) - known) for known in self._heights]
        if not off or (self.level(T_map_base) and min(off) > self._config.apart):
            return len(off)
        return int(np.argmin(off))

    def add(self, storey: int, T_map_base: Array) -> None:
        """The next keyframe, on a storey (``at``), at a pose (4, 4)."""
        config, height = self._config, float(T_map_base[2, 3])
        self._of.append(storey)
        if storey == len(self._heights):
            self._heights.append(height)
        off = height - self._heights[storey]
        if self.level(T_map_base) and abs(off) < config.same:
            self._heights[storey] += config.learn * off

    def level(self, T_map_base: Array) -> bool:
        """Does a base at a pose (4, 4) stand level, as on no ramp?"""
        return float(T_map_base[2, 2]) > np.cos(self._config.level)

    def of(self, keyframe: int) -> int:
        """The storey of a keyframe."""
        return self._of[keyframe]
