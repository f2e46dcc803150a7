"""How long one answer of the learned detector takes, by the size of the map.

A map of rooms of 5 x 4 m side by side, as a perfect mapper would have it. Three cases: everything
is new; one keyframe, which has touched what it saw and changed a few pieces of it (in simulated
runs it is 1 in the median and 4 in the ninth decile); and every plane has moved, as after a loop
closure.
"""

from __future__ import annotations

import time
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from semantics.detector import make_detector
from slam.core import Array, Detector, MapPlane, MapView

ROOM = (5.0, 4.0)
"""Inner size of the rooms [m]."""
WALL = 0.2
"""Thickness of the walls between them [m]."""
SEEN, CHANGED = 20, 4
"""Planes that one keyframe sees, and those of them that it changes by more than noise."""
NOISE, CHANGE = 0.005, 0.1
"""How far planes move that were seen again, and those that have changed [m]."""


@dataclass(frozen=True)
class SemanticsTime:
    """Milliseconds of one update, the median of several: wall time, and of the processor."""

    planes: int
    case: str
    wall_ms: float
    cpu_ms: float


def bench_semantics(
    sizes: Sequence[int] = (150, 2000, 10_000), detector: str = "gnn", repeats: int = 9
) -> list[SemanticsTime]:
    """Times of all cases for maps of these sizes."""
    return [row for size in sizes for row in _bench(size, detector, repeats)]


def room_map(count: int, spacing: float = 0.1) -> list[MapPlane]:
    """``count`` planes of rooms in a square grid, each plane with its points."""
    side = int(np.ceil(np.sqrt(count / 4)))
    corners = np.array([[0.0, 0.0], [ROOM[0], 0.0], list(ROOM), [0.0, ROOM[1]]])
    step = np.array(ROOM) + WALL
    rooms = [corners + step * [a, b] for a in range(side) for b in range(side)]
    ends = [(room[k], room[(k + 1) % 4]) for room in rooms for k in range(4)]
    return [_plane(name, start, end, spacing) for name, (start, end) in enumerate(ends[:count])]


def _plane(name: int, start: Array, end: Array, spacing: float) -> MapPlane:
    length = float(np.linalg.norm(end - start))
    direction = (end - start) / length
    normal = np.array([-direction[1], direction[0], 0.0])
    along, up = np.meshgrid(np.arange(0.0, length + 1e-9, spacing), np.arange(0.1, 2.5, 0.2))
    points = np.column_stack([start + along.ravel()[:, None] * direction, up.ravel()])
    ids = np.arange(len(points))
    return MapPlane(name, normal, float(-normal[:2] @ start), points, ids, np.zeros(1, np.int64))


def _bench(size: int, detector: str, repeats: int) -> Iterator[SemanticsTime]:
    rng = np.random.default_rng(size)
    planes = room_map(size)
    centres = np.array([plane.points[:, :2].mean(axis=0) for plane in planes])
    make_detector(detector).update(MapView(0.0, planes[:8], ()))  # reads the weights
    fresh = [_timed(make_detector(detector), planes) for _ in range(3)]
    yield _median(size, "everything new", fresh)
    asked = make_detector(detector)
    asked.update(MapView(0.0, planes, ()))
    some, every = [], []
    for _ in range(repeats):
        spot = centres[int(rng.integers(size))]
        near = np.argsort(np.linalg.norm(centres - spot, axis=1))[:SEEN].tolist()
        changed = dict.fromkeys(near[CHANGED:], NOISE) | dict.fromkeys(near[:CHANGED], CHANGE)
        planes = _moved(planes, changed, rng)
        some.append(_timed(asked, planes))
    for _ in range(3):
        planes = _moved(planes, dict.fromkeys(range(size), CHANGE), rng)
        every.append(_timed(asked, planes))
    yield _median(size, "one keyframe", some)
    yield _median(size, "everything moved", every)


def _moved(
    planes: Sequence[MapPlane], by: Mapping[int, float], rng: np.random.Generator
) -> list[MapPlane]:
    """The planes, some of them (by id) shifted along their normals by so much [m], to and fro."""
    return [
        _shifted(plane, by[plane.id] * rng.choice([-1.0, 1.0])) if plane.id in by else plane
        for plane in planes
    ]


def _shifted(plane: MapPlane, by: float) -> MapPlane:
    points = plane.points + by * plane.normal
    return replace(plane, points=points, d=plane.d - by, revision=plane.revision + 1)


def _timed(detector: Detector, planes: Sequence[MapPlane]) -> tuple[float, float]:
    """Wall time and processor time of one update [ms]."""
    wall, cpu = time.perf_counter(), time.process_time()
    detector.update(MapView(0.0, planes, ()))
    return 1e3 * (time.perf_counter() - wall), 1e3 * (time.process_time() - cpu)


def _median(size: int, case: str, times: Sequence[tuple[float, float]]) -> SemanticsTime:
    wall, cpu = np.median(np.array(times), axis=0)
    return SemanticsTime(size, case, float(wall), float(cpu))
