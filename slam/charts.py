"""Planes as three numbers near a place: what the graph estimates of each plane.

A chart sits where the plane was first seen. In its frame (u level, v up, w the normal at first) the
plane is w = h + a u + b v. Away from a plane's place its direction and its distance are one blur;
here they are independent, and every number means the same for a wall in the next building.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

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

    def coordinates(self, normal: Array, d: float) -> Array:
        """(3,) a, b, h of a plane that faces the same way."""
        a, b, c = self.frame @ normal
        return np.array([-a, -b, -(normal @ self.origin + d)]) / c

    def place(self, points: Array) -> Array:
        """(N, 2) u and v of points (N, 3), map frame."""
        return (points - self.origin) @ self.frame[:2].T


class Charts:
    """Several of them at once: origins (N, 3), frames (N, 3, 3)."""

    def __init__(self, origins: Array, frames: Array):
        self._origin = origins
        self._frame = frames
        # u and v of the origins, seen from the map's
        self._along = np.einsum("nij,nj->ni", frames[:, :2], origins)

    @staticmethod
    def of(charts: Sequence[Chart]) -> Charts:
        """Each of them."""
        return Charts(
            np.array([chart.origin for chart in charts]),
            np.array([chart.frame for chart in charts]),
        )

    def planes(self, x: Array) -> tuple[Array, Array, Array, Array]:
        """Normals (N, 3), d (N,), and their derivatives (N, 3, 3) and (N, 3) by coordinates a, b, h
        (N, 3), each in its chart."""
        tilt, h = x[:, :2], x[:, 2]
        length = np.sqrt(1.0 + tilt[:, 0] ** 2 + tilt[:, 1] ** 2)
        across = self._frame[:, :2]
        n = (self._frame[:, 2] - (tilt[:, None, :] @ across)[:, 0]) / length[:, None]
        d = -(n * self._origin).sum(axis=1) - h / length
        share = tilt / length[:, None]
        by_n = np.zeros((len(x), 3, 3))
        by_n[:, :, :2] = -(across.transpose(0, 2, 1) + n[:, :, None] * share[:, None, :])
        by_n /= length[:, None, None]
        by_d = np.empty((len(x), 3))
        by_d[:, :2] = self._along - d[:, None] * share
        by_d[:, 2] = -1.0
        by_d /= length[:, None]
        return n, d, by_n, by_d
