"""The variables of the graph: their names in gtsam, and their values where they are needed."""

from __future__ import annotations

from collections.abc import Callable, Iterable

import gtsam
import numpy as np

from slam.core import Array
from slam.estimates import Estimates
from slam.linearpoint import LinearPoint
from slam.solver import Value

KEYFRAME, PLANE, THICKNESS, WALL, ROOM, FLOOR = "x", "p", "t", "w", "r", "f"

NO_STEP = np.zeros(6)
"""What the solver has for a keyframe where that is linearised."""

_KIND = {ord(letter) << 56: letter for letter in (KEYFRAME, PLANE)}
_NUMBER = (1 << 56) - 1


def keyframe_key(keyframe: int) -> int:
    """The variable of a keyframe."""
    return int(gtsam.symbol(KEYFRAME, keyframe))


def plane_key(plane: int) -> int:
    """The variable of a plane."""
    return int(gtsam.symbol(PLANE, plane))


class Variables:
    """Keyframes and planes are where they are estimated, or where they are linearised; all factors
    are linear in the others, whose values (``set``) may be anywhere."""

    def __init__(self, estimates: Estimates, at: LinearPoint):
        self._estimates = estimates
        self._at = at
        self._others: dict[int, Value] = {}

    def set(self, key: int, value: Value) -> None:
        """The value of one that is neither a keyframe nor a plane."""
        self._others[key] = value

    def drop(self, key: int) -> None:
        """One is not wanted any more."""
        self._others.pop(key, None)

    def now(self, keys: Iterable[int]) -> gtsam.Values:
        """As estimated: poses, planes' coordinates, and the others."""
        return self._values(keys, self._estimates, gtsam.Pose3)

    def linear_point(self, keys: Iterable[int]) -> gtsam.Values:
        """The same where they are linearised."""
        return self._values(keys, self._at, gtsam.Pose3)

    def vectors(self, keys: Iterable[int]) -> gtsam.Values:
        """What the solver has for them where they are linearised."""
        return self._values(keys, self._at, lambda _: NO_STEP)

    def _values(
        self,
        keys: Iterable[int],
        of: Estimates | LinearPoint,
        keyframe: Callable[[Array], gtsam.Pose3 | Array],
    ) -> gtsam.Values:
        """keyframe: the value of one at a pose."""
        values = gtsam.Values()
        for key in keys:
            kind, number = _KIND.get(key & ~_NUMBER), key & _NUMBER
            if kind == KEYFRAME:
                values.insert(key, keyframe(of.poses[number]))
            else:
                values.insert(key, of.coordinates[number] if kind == PLANE else self._others[key])
        return values
