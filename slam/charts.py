"""Planes as three numbers near a place: what the graph estimates of each plane.

A chart sits where the plane was first seen. In its frame (u level, v up, w the normal at first) the
plane is w = h + a u + b v. Away from a plane's place its direction and its distance are one blur;
here they are independent, and every number means the same for a wall in the next building.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from slam.core import Array, InputError, plane_axes


@dataclass(frozen=True)
class Chart:
    """origin: (3,) map frame; frame: (3, 3) rows u, v, w, map frame."""

    origin: Array
    frame: Array

    @staticmethod
    def at(origin: Array, normal: Array) -> Chart:
        """Through a point of the plane, along its normal. Raises InputError for no direction."""
        length = float(np.linalg.norm(normal))
        if not (np.isfinite(origin).all() and abs(length - 1.0) < 1e-6):
            raise InputError("plane: a unit normal and a finite place are needed")
        return Chart(np.array(origin), np.stack([*plane_axes(normal), normal]))

    def plane(self, x: Array) -> tuple[Array, float]:
        """Normal (3,) and d of coordinates a, b, h."""
        a, b, h = x.tolist()
        length = math.sqrt(1.0 + a * a + b * b)
        n = (self.frame[2] - a * self.frame[0] - b * self.frame[1]) / length
        return n, -float(n @ self.origin) - h / length

    def coordinates(self, normal: Array, d: float) -> Array:
        """(3,) a, b, h of a plane that faces the same way."""
        a, b, c = self.frame @ normal
        return np.array([-a, -b, -(normal @ self.origin + d)]) / c

    def derivatives(self, x: Array) -> tuple[Array, float, Array, Array]:
        """Normal (3,), d, and their derivatives (3, 3) and (3,) by a, b, h."""
        a, b, h = x.tolist()
        length = math.sqrt(1.0 + a * a + b * b)
        u, v, w = self.frame
        n = (w - a * u - b * v) / length
        d = -float(n @ self.origin) - h / length
        by_n = np.zeros((3, 3))
        by_n[:, 0] = (u + n * (a / length)) / -length
        by_n[:, 1] = (v + n * (b / length)) / -length
        by_d = np.array([self._along[0], self._along[1], -1.0]) / length
        by_d[0] -= d * a / length**2
        by_d[1] -= d * b / length**2
        return n, d, by_n, by_d

    @cached_property
    def _along(self) -> tuple[float, float]:
        """u and v of the origin, seen from the map's."""
        return float(self.frame[0] @ self.origin), float(self.frame[1] @ self.origin)

    def place(self, points: Array) -> Array:
        """(N, 2) u and v of points (N, 3), map frame."""
        return (points - self.origin) @ self.frame[:2].T
