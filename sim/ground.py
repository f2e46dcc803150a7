"""The ground under the base: floors, and the ramps between them."""

from __future__ import annotations

from collections.abc import Sequence
from math import atan, cos, sin
from typing import TYPE_CHECKING

import numpy as np

from slam.core import Array

if TYPE_CHECKING:
    from worlds.plan import Ramp
    from worlds.world import World

STEP = 0.10
"""What is higher than this above the base is not the ground that it stands on [m]."""
REACH = 0.15
"""From the base's middle to where its wheels touch the ground [m]."""


class Ground:
    """Height and slope of the ground as the base moves over it, from a storey's floor on.

    Where surfaces lie above each other the base stands on that which it came by. height: of the
    ground where the base was last [m].
    """

    def __init__(self, world: World, storey: int) -> None:
        self._floors = {floor.storey: floor.z_floor for floor in world.truth.floors}
        self._ramps = [_Incline(ramp, self._floors) for ramp in world.ramps]
        self.height = self._floors[storey]

    @property
    def level(self) -> bool:
        """Whether there is but one floor, without ramps."""
        return not self._ramps

    def under(self, x: float, y: float, yaw: float) -> tuple[float, float, float]:
        """Height [m], roll and pitch [rad] of the plane through the four wheels at a pose."""
        c, s = REACH * cos(yaw), REACH * sin(yaw)
        ahead, behind = self._at(x + c, y + s), self._at(x - c, y - s)
        left, right = self._at(x - s, y + c), self._at(x + s, y - c)
        self.height = 0.25 * (ahead + behind + left + right)
        width = 2.0 * REACH
        return self.height, atan((left - right) / width), -atan((ahead - behind) / width)

    def _at(self, x: float, y: float) -> float:
        """The highest surface at a place that is not above the base."""
        heights = [ramp.height(x, y) for ramp in self._ramps]
        pierced = {
            ramp.upper for ramp, z in zip(self._ramps, heights, strict=True) if z is not None
        }
        floors = [z for storey, z in self._floors.items() if storey not in pierced]
        known = [z for z in (*heights, *floors) if z is not None and z <= self.height + STEP]
        return max(known, default=self.height)


class _Incline:
    """A ramp's surface; upper: the storey whose floor it passes through."""

    def __init__(self, ramp: Ramp, floors: dict[int, float]) -> None:
        self.upper = ramp.storey + 1
        self._low, self._high = floors[ramp.storey], floors[self.upper]
        self._middle: Sequence[float] = ramp.foot.mean(axis=0).tolist()
        along: Array = ramp.head.mean(axis=0) - ramp.foot.mean(axis=0)
        self._along: Sequence[float] = (along / ramp.run).tolist()
        self._run = ramp.run
        self._half = 0.5 * float(np.linalg.norm(ramp.foot[1] - ramp.foot[0]))

    def height(self, x: float, y: float) -> float | None:
        """Of the surface at a place, None beside it [m]."""
        dx, dy = x - self._middle[0], y - self._middle[1]
        up = dx * self._along[0] + dy * self._along[1]
        aside = dy * self._along[0] - dx * self._along[1]
        if not (0.0 <= up <= self._run and abs(aside) <= self._half):
            return None
        return self._low + (self._high - self._low) * up / self._run
