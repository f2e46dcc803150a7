"""Hand-made maps for the tests: planes as a perfect mapper would have them."""

from __future__ import annotations

import numpy as np

from slam.core import Array, MapPlane, MapView

Side = tuple[tuple[float, float], tuple[float, float]]
"""A wall face from one end to the other; its normal points to the left of the way."""


def plane(name: int, side: Side, height: float = 2.5, spacing: float = 0.1) -> MapPlane:
    """A mapped plane along a side."""
    start, end = np.array(side)
    run = end - start
    length = float(np.linalg.norm(run))
    direction = run / length
    normal = np.array([-direction[1], direction[0], 0.0])
    along, up = np.meshgrid(np.arange(0.0, length + 1e-9, spacing), np.arange(0.1, height, 0.2))
    place = start + along.ravel()[:, None] * direction
    points = np.column_stack([place, up.ravel()])
    return MapPlane(
        id=name,
        normal=normal,
        d=float(-normal[:2] @ start),
        points=points,
        point_ids=np.arange(len(points)),
        keyframes=np.zeros(1, dtype=np.int64),
    )


def around(x0: float, y0: float, x1: float, y1: float) -> list[Side]:
    """The four sides of a room, facing inwards."""
    return [
        ((x0, y0), (x1, y0)),
        ((x1, y0), (x1, y1)),
        ((x1, y1), (x0, y1)),
        ((x0, y1), (x0, y0)),
    ]


TWO_ROOMS_AND_A_CORRIDOR = [
    *around(0.0, 0.0, 4.0, 5.0),
    *around(4.2, 0.0, 9.0, 5.0),
    *around(0.0, 5.2, 9.0, 7.2),
]
L_ROOM: list[Side] = [
    ((0, 0), (6, 0)),
    ((6, 0), (6, 3)),
    ((6, 3), (3, 3)),
    ((3, 3), (3, 7)),
    ((3, 7), (0, 7)),
    ((0, 7), (0, 0)),
]


def view(sides: list[Side], order: list[int] | None = None) -> MapView:
    """A map of these sides; ``order`` changes their order, not their ids."""
    planes = [plane(name, side) for name, side in enumerate(sides)]
    return MapView(0.0, [planes[i] for i in (order or range(len(planes)))], [])


def moved(sides: list[Side], angle: float, shift: tuple[float, float]) -> list[Side]:
    """The sides turned by an angle and shifted."""
    c, s = np.cos(angle), np.sin(angle)
    R: Array = np.array([[c, -s], [s, c]])
    ends = np.array(sides) @ R.T + np.array(shift)
    return [((a[0], a[1]), (b[0], b[1])) for a, b in ends.tolist()]
