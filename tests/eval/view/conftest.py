"""A room of 4 m x 3 m, what is known of it, and a stream that keeps what is logged."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import pytest
from shapely.geometry import box

from eval.config import RunConfig
from eval.sinks import Sink
from slam.core import (
    Array,
    Frame,
    Keyframe,
    KeyframeScan,
    MapPlane,
    MapView,
    PlanePiece,
    Proposals,
    RoomProposal,
    Scan,
    WallProposal,
    pose,
)
from worlds.truth import Face, Floor, Room, Truth, Wall

CONFIG = RunConfig("hand-made", save=True)
T_WORLD_BASE = pose(np.eye(3), np.array([2.0, 1.5, 0.0]))
"""The robot in the middle of the room: where the map begins."""


@dataclass
class Log:
    """What was logged, in order."""

    calls: list[tuple[str, Any]] = field(default_factory=list)

    def __call__(self, entity: str, what: Any) -> None:
        self.calls.append((entity, what))

    def take(self) -> dict[str, str]:
        """Entity -> archetype since the last time."""
        taken = {entity: type(what).__name__ for entity, what in self.calls}
        self.calls.clear()
        return taken


def make_truth() -> Truth:
    """One room; its faces 0 and 2 are taken for a wall's."""
    corners = np.array([[0.0, 0.0], [4.0, 0.0], [4.0, 3.0], [0.0, 3.0]])
    inward = [(0.0, 1.0), (-1.0, 0.0), (0.0, -1.0), (1.0, 0.0)]
    faces = []
    for i, (x, y) in enumerate(inward):
        segment = np.array([corners[i], corners[(i + 1) % 4]])
        normal = np.array([x, y, 0.0])
        d = -float(normal[:2] @ segment[0])
        faces.append(Face(i, 0, normal, d, segment, segment[None], (0.0, 2.7), i))
    room = Room(0, "office", "room", 0, box(0, 0, 4, 3), (0, 1, 2, 3))
    return Truth(tuple(faces), (Wall(0, (0, 2), 3.0),), (room,), (), (Floor(0, 0.0, 2.7),))


def make_plane(identity: int, normal: tuple[float, float, float], d: float, at: Array) -> MapPlane:
    return MapPlane(identity, np.array(normal), d, at, np.arange(len(at)), np.array([0]), 1)


def make_view(stamp: float = 0.1) -> MapView:
    """South wall 0, north wall 1 and floor 2, seen from the middle."""
    rng = np.random.default_rng(0)
    along, up = rng.uniform(-2, 2, 200), rng.uniform(0, 2, 200)
    south = np.column_stack([along, np.full(200, -1.5), up])
    north = np.column_stack([along, np.full(200, 1.5), up])
    floor = np.column_stack([along, up - 1.0, np.zeros(200)])
    planes = (
        make_plane(0, (0.0, 1.0, 0.0), 1.5, south),
        make_plane(1, (0.0, -1.0, 0.0), 1.5, north),
        make_plane(2, (0.0, 0.0, 1.0), 0.0, floor),
    )
    scan = KeyframeScan((), np.zeros((0, 3)), np.zeros(3))
    return MapView(stamp, planes, (Keyframe(0, 0, stamp, np.eye(4), scan),))


def make_proposals() -> Proposals:
    """Room 7 with planes, room 8 without (far off, hence false), wall 0."""
    pieces = (
        PlanePiece(0, np.array([[-2.0, -1.5], [2.0, -1.5]])),
        PlanePiece(1, np.array([[2.0, 1.5], [-2.0, 1.5]])),
    )
    polygon = np.array([[-2.0, -1.5], [2.0, -1.5], [2.0, 1.5], [-2.0, 1.5]])
    room = RoomProposal(7, pieces, polygon, np.zeros(2), 0.9)
    without_planes = RoomProposal(8, (), None, np.full(2, 9.0), 0.5)
    return Proposals((room, without_planes), (WallProposal(0, pieces, 0.8),))


def make_scan(index: int) -> Scan:
    points = np.random.default_rng(index).normal(size=(400, 3))
    flat = np.zeros(400)
    return Scan(index, 0.1 * (index + 1), points, flat, flat.astype(np.int16), flat)


def make_frame(index: int) -> Frame:
    return Frame(index, 0.1 * (index + 1), np.eye(4), np.eye(4), None)


def play_run(sink: Sink, with_truth: bool = True, retract: bool = True) -> None:
    """Four scans, two answers of the detector, and at the end a third that names nothing."""
    T_world_base = T_WORLD_BASE if with_truth else None
    sink.started(CONFIG, make_truth() if with_truth else None)
    sink.updated(make_view(), make_proposals())
    sink.timed(0.1, {"odometry": 0.02})
    sink.event(0.1, "loop closed")
    for index in range(4):
        sink.frame(make_frame(index), make_scan(index), np.eye(4), T_world_base)
    sink.updated(make_view(0.4), make_proposals())
    if retract:
        sink.updated(make_view(0.5), Proposals())
    sink.finished()


@pytest.fixture
def log() -> Log:
    return Log()


@pytest.fixture
def truth() -> Truth:
    return make_truth()


@pytest.fixture
def view() -> MapView:
    return make_view()


@pytest.fixture
def proposals() -> Proposals:
    return make_proposals()


@pytest.fixture
def T_world_base() -> Array:
    return T_WORLD_BASE


@pytest.fixture
def play() -> Callable[..., None]:
    return play_run
