"""How the time of an update grows with the map: many rooms as replayed plane observations.

No simulator: generated buildings are laid side by side, and a base goes through all their rooms on
straight lines. From each keyframe it observes the faces of the room it is in and the floor, as the
truth has them plus noise of the measured size, and odometry drifts as tracking does. A block of
buildings comes again and again, so that what is compared are the same rooms in a small map and in a
large one.
"""

from __future__ import annotations

import resource
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import cycle

import numpy as np
import shapely
from shapely.geometry import Polygon

from slam.backend import BackEnd, BackEndConfig
from slam.core import (
    Array,
    Detector,
    Floats,
    Frame,
    KeyframeScan,
    PlaneObservation,
    inverse,
    plane_axes,
    pose,
    so3_exp,
    transform_plane,
    transform_points,
)
from worlds.conditions import AS_BUILT
from worlds.generator import random_plan
from worlds.truth import Face, Room, Truth
from worlds.world import true_world


@dataclass(frozen=True)
class GrowthConfig:
    """step [m]: between keyframes; reach [m]: how far planes are seen; spacing [m]: of the points
    on them; tilt [rad], offset [m]: standard deviations of an observed plane; point_sigma [m];
    turn [rad], slip [m]: of the odometry, per keyframe; gap [m]: between buildings; block: rooms
    after which the same buildings come again; lane [m]: rooms are gone through along y, in lanes so
    wide."""

    step: float = 0.5
    reach: float = 12.0
    spacing: float = 0.15
    tilt: float = np.radians(0.15)
    offset: float = 0.008
    point_sigma: float = 0.012
    turn: float = np.radians(0.05)
    slip: float = 0.005
    gap: float = 5.0
    block: int = 50
    lane: float = 6.0


@dataclass(frozen=True)
class Growth:
    """One entry a keyframe (N,): rooms begun so far, milliseconds (of the processor, so that a busy
    machine does not count) of the back end and of the detector, planes in the map, and memory of
    the process [MB]. block: rooms after which the same ones came again."""

    rooms: Array
    graph_ms: Array
    detector_ms: Array
    planes: Array
    rss_mb: Array
    block: int

    def blocks(self) -> list[Block]:
        """Medians of each block of rooms, and the map's size and memory after it."""
        number = np.maximum(self.rooms - 1, 0).astype(np.int64) // self.block
        found = []
        for place in np.unique(number):
            of = np.flatnonzero(number == place)
            ms = float(np.median(self.graph_ms[of])), float(np.median(self.detector_ms[of]))
            end = of[-1]
            found.append(
                Block(int(self.rooms[end]), int(self.planes[end]), *ms, float(self.rss_mb[end]))
            )
        return found


@dataclass(frozen=True)
class Block:
    """rooms, planes: in the map by its end; graph_ms, detector_ms: of the processor, the median
    update in it; rss_mb: of the process [MB]."""

    rooms: int
    planes: int
    graph_ms: float
    detector_ms: float
    rss_mb: float


def growth(
    rooms: int = 200,
    seed: int = 0,
    backend: BackEndConfig = BackEndConfig(),  # noqa: B008
    detector: Detector | None = None,
    config: GrowthConfig = GrowthConfig(),
    progress: Callable[[float, float], None] | None = None,
) -> Growth:
    """Replays the observations of that many rooms into a back end (and a detector)."""
    rng = np.random.default_rng(seed)
    mapper = BackEnd(backend)
    rows: list[tuple[float, ...]] = []
    for frame, begun in observations(rooms, rng, config):
        started = time.process_time()
        mapper.add(frame)
        graph_s = time.process_time() - started
        detector_s = 0.0
        if detector is not None:
            started = time.process_time()
            proposals = detector.update(mapper.view())
            detector_s = time.process_time() - started
            started = time.process_time()
            mapper.accept(proposals)
            graph_s += time.process_time() - started
        rows.append((begun, 1e3 * graph_s, 1e3 * detector_s, mapper.plane_count, _rss_mb()))
        if progress is not None:
            progress(begun, rooms)
    begun_by, graph_ms, detector_ms, planes, rss_mb = np.array(rows).T
    return Growth(begun_by, graph_ms, detector_ms, planes, rss_mb, config.block)


def observations(
    rooms: int, rng: np.random.Generator, config: GrowthConfig = GrowthConfig()
) -> Iterator[tuple[Frame, int]]:
    """Keyframes, and how many rooms were begun by then."""
    T_last, T_odom_base, index = None, np.eye(4), 0
    begun = 0
    for truth, origin, known in _buildings(rooms, rng, config):
        for room in known:
            begun += 1
            faces = [truth.faces[face] for face in room.faces]
            for place in _way(room, T_last, origin, config):
                T = pose(np.eye(3), np.array([*place, 0.0]))
                if T_last is not None:
                    T_odom_base = T_odom_base @ inverse(T_last) @ T @ _slip(rng, config)
                scan = _seen(faces, origin, T, rng, config)
                yield Frame(index, 0.7 * (index + 1), T_odom_base, T_odom_base, scan), begun
                T_last, index = T, index + 1


def _buildings(
    rooms: int, rng: np.random.Generator, config: GrowthConfig
) -> Iterator[tuple[Truth, Array, Sequence[Room]]]:
    """Truths of generated buildings, where each one stands (2,), and its rooms: a block of them
    again and again, until there are so many rooms."""
    block: list[Truth] = []
    while (left := config.block - sum(len(truth.rooms) for truth in block)) > 0:
        conditions = np.random.SeedSequence(int(rng.integers(1 << 31)))
        truth = true_world(random_plan(rng), conditions, AS_BUILT)
        block.append(replace(truth, rooms=_in_turn(truth.rooms, config)[:left]))
    x = 0.0
    for truth in cycle(block):
        low_x, low_y, high_x, _ = shapely.union_all([r.polygon for r in truth.rooms]).bounds
        yield truth, np.array([x - low_x, -low_y]), truth.rooms[:rooms]
        x += high_x - low_x + config.gap
        rooms -= len(truth.rooms)
        if rooms <= 0:
            return


def _in_turn(rooms: Sequence[Room], config: GrowthConfig) -> tuple[Room, ...]:
    """From the least x to the largest, there and back along y, so that no step is long."""

    def place(room: Room) -> tuple[int, float]:
        x, y = room.polygon.representative_point().coords[0]
        lane = int(x // config.lane)
        return lane, y if lane % 2 else -y

    return tuple(sorted(rooms, key=place))


def _way(room: Room, T_last: Array | None, origin: Array, config: GrowthConfig) -> Array:
    """(N, 2) places of keyframes inside the room, on a line across it."""
    box: Polygon = room.polygon
    middle = np.array(box.representative_point().coords[0])
    x, y = box.exterior.coords.xy
    corners = np.column_stack([x, y])
    far = corners[np.argmax(np.linalg.norm(corners - middle, axis=1))]
    ends = middle + np.array([[0.0], [0.7]]) * (far - middle)
    if T_last is not None and np.linalg.norm(ends[1] + origin - T_last[:2, 3]) < np.linalg.norm(
        ends[0] + origin - T_last[:2, 3]
    ):
        ends = ends[::-1]
    count = max(2, round(float(np.linalg.norm(ends[1] - ends[0])) / config.step))
    return origin + ends[0] + np.linspace(0.0, 1.0, count)[:, None] * (ends[1] - ends[0])


def _slip(rng: np.random.Generator, config: GrowthConfig) -> Array:
    turn, slip = rng.normal(0.0, config.turn, 3), rng.normal(0.0, config.slip, 3)
    return pose(so3_exp(turn), slip)


def _seen(
    faces: Sequence[Face],
    origin: Array,
    T_world_base: Array,
    rng: np.random.Generator,
    config: GrowthConfig,
) -> KeyframeScan:
    """The faces and the floor as observed from a pose."""
    clouds = [_on_face(face, config.spacing) + np.append(origin, 0.0) for face in faces]
    normals = [face.normal for face in faces]
    place = T_world_base[:2, 3]
    steps = np.arange(-2.0, 2.0, 2.0 * config.spacing)
    x, y = (axis.ravel() for axis in np.meshgrid(place[0] + steps, place[1] + steps))
    clouds.append(np.column_stack([x, y, np.zeros(len(x))]))
    normals.append(np.array([0.0, 0.0, 1.0]))
    planes, first = [], 0
    for normal, cloud in zip(normals, clouds, strict=True):
        near = cloud[np.linalg.norm(cloud[:, :2] - place, axis=1) < config.reach]
        if len(near) < 60:
            continue
        planes.append(_observed(normal, near, T_world_base, first, rng, config))
        first += len(near)
    return KeyframeScan(tuple(planes), np.empty((0, 3), np.float32), np.array([0.0, 0.0, 0.5]))


def _on_face(face: Face, spacing: float) -> Array:
    """(N, 3) a grid of points on the real parts of a face."""
    heights = np.arange(face.z_range[0] + 0.1, face.z_range[1], 2.0 * spacing)
    rows = []
    for start, end in face.parts:
        count = max(2, int(np.linalg.norm(end - start) / spacing))
        rows.append(start + np.linspace(0.02, 0.98, count)[:, None] * (end - start))
    ground = np.concatenate(rows)
    tall = np.tile(heights, len(ground))[:, None]
    points = np.hstack([np.repeat(ground, len(heights), axis=0), tall])
    return points - ((points @ face.normal + face.d)[:, None] * face.normal)


def _observed(
    normal: Array,
    points: Array,
    T_world_base: Array,
    first: int,
    rng: np.random.Generator,
    config: GrowthConfig,
) -> PlaneObservation:
    """A plane through points (N, 3), world frame, as a keyframe sees it."""
    T_base_world = inverse(T_world_base)
    n, _ = transform_plane(T_base_world, normal, float(-normal @ points[0]))
    axes = plane_axes(n)
    tilt = rng.normal(0.0, config.tilt, 2)
    seen = n + tilt[0] * axes[0] + tilt[1] * axes[1]
    seen /= np.linalg.norm(seen)
    in_base = transform_points(T_base_world, points)
    centroid = in_base.mean(axis=0) + rng.normal(0.0, config.offset) * n
    flat = in_base - ((in_base - centroid) @ seen)[:, None] * seen
    noisy: Floats = flat + rng.normal(0.0, config.point_sigma, len(flat))[:, None] * seen
    return PlaneObservation(
        normal=seen,
        d=float(-seen @ centroid),
        centroid=centroid,
        covariance=np.diag([config.tilt**2, config.tilt**2, config.offset**2]),
        points=noisy.astype(np.float32),
        point_index=np.arange(first, first + len(noisy)),
    )


def _rss_mb() -> float:
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024.0
