"""True surfaces: coplanar, same-facing faces are one; so are a storey's floor and ceiling."""

from __future__ import annotations

import numpy as np

from eval.score.votes import LOWEST_LABEL, Labels
from slam.core import Array, IntArray
from worlds.truth import CEILING, FLOOR, Face, Truth

Surface = tuple[int, int]
"""(0, surface id) | (FLOOR or CEILING, storey) | (another negative label, 0)"""


class Surfaces:
    """Looks up the surfaces of a truth: by label, with their faces and directions."""

    _STRIDE = 1 << 32

    def __init__(self, truth: Truth) -> None:
        self._faces: dict[int, list[Face]] = {}
        for face in truth.faces:
            self._faces.setdefault(face.surface, []).append(face)
        others = [label * self._STRIDE for label in range(LOWEST_LABEL, 0)]
        self._codes = np.array(others + [face.surface for face in truth.faces], dtype=np.int64)
        self._heights = np.array([[f.z_floor, f.z_ceiling] for f in truth.floors]).reshape(-1, 2)
        self._storeys = np.array([f.storey for f in truth.floors], dtype=np.int64)

    def faces(self, surface: int) -> list[Face]:
        """The coplanar faces of one surface."""
        return self._faces[surface]

    def codes(self, labels: Labels, points_world: Array) -> IntArray:
        """(M,) one number per surface, of labels (M,) and their true points (M, 3)."""
        codes = self._codes[labels - LOWEST_LABEL]
        for label, column in ((FLOOR, 0), (CEILING, 1)):
            level = labels == label
            off = np.abs(self._heights[:, column] - points_world[level, 2:])
            codes[level] += self._storeys[off.argmin(axis=1)]
        return codes

    def decode(self, code: int) -> Surface:
        """The surface of a code."""
        return code // self._STRIDE, code % self._STRIDE

    def places(self, surface: Surface, points: Array) -> Array:
        """(M, 2) of points (M, 3) world: along a wall and height, or x and y where level."""
        if surface[0] in (FLOOR, CEILING):
            return points[:, :2]
        direction = np.array([1.0, 0.0])
        if surface[0] == 0:
            direction = _direction(self._faces[surface[1]][0])
        return np.column_stack([points[:, :2] @ direction, points[:, 2]])


def _direction(face: Face) -> Array:
    run = face.segment[1] - face.segment[0]
    return run / np.linalg.norm(run)
