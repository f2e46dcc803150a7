"""Which storey each keyframe is on: told by the height of the base wherever it stands level."""

from __future__ import annotations

from collections.abc import Iterable
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

    def add(self, T_map_base: Array) -> None:
        """The next keyframe, at a pose (4, 4)."""
        config, height = self._config, float(T_map_base[2, 3])
        level = float(T_map_base[2, 2]) > np.cos(config.level)
        off = [abs(height - known) for known in self._heights]
        if not off or (level and min(off) > config.apart):
            self._heights.append(height)
            self._of.append(len(self._heights) - 1)
            return
        storey = int(np.argmin(off))
        if level and off[storey] < config.same:
            self._heights[storey] += config.learn * (height - self._heights[storey])
        self._of.append(storey)

    def of(self, keyframe: int) -> int:
        """The storey of a keyframe."""
        return self._of[keyframe]

    def of_most(self, keyframes: Iterable[int]) -> int:
        """The storey of most of some keyframes, the lower number of two."""
        if len(self._heights) < 2:
            return 0
        return int(np.bincount([self._of[keyframe] for keyframe in keyframes]).argmax())
