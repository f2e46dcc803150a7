"""A path that grows: drawn in parts, so that a long one costs no more than a short one."""

from __future__ import annotations

from typing import Any

import numpy as np

from eval.view import shapes
from slam.core import Array

PART = 64
"""Points of one part."""


class Trail:
    """The last part of a path."""

    def __init__(self, colour: shapes.Colour) -> None:
        self._colour = colour
        self._points: list[Array] = []
        self.part = 0

    def add(self, point: Array) -> None:
        """One position (3,); a full part is left, and the next begins at its end."""
        if len(self._points) == PART:
            self._points = self._points[-1:]
            self.part += 1
        self._points.append(np.array(point))

    def strip(self) -> Any:
        """The part as it is now."""
        return shapes.lines([np.array(self._points)], self._colour, 0.02)
