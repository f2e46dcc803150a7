"""Buildings of a given number of rooms from a seed: the scene names ``rooms-N-SEED``.

Bands of two rows of rooms along a corridor lie side by side; with more than one band, a corridor
across either end joins them to rings. Drawn as clear rectangles with walls between them.
"""

from __future__ import annotations

import itertools
import re
from dataclasses import dataclass, field

import numpy as np
import shapely
from shapely import affinity
from shapely.geometry import Polygon, box

from slam.core import InputError
from worlds.drafting import as_multipolygon
from worlds.plan import Opening, Plan, RoomOutline, Storey

NAME = re.compile(r"rooms-(\d{1,6})-(\d{1,9})")
"""``rooms-N-SEED``."""
FEWEST, MOST = 10, 1000
"""Rooms that a building can have, its corridors among them."""
DEEPER = 0.01
"""How far a door's footprint reaches into the rooms, so that it surely cuts the wall [m]."""

Range = tuple[float, float]


@dataclass(frozen=True)
class LargeBuildingConfig:
    """Uniform ranges [m]. room_width: of single rooms, as a share of the mean; neighbour: chance of
    a door between neighbours; bands_per_room: bands squared, so that the building is about square.
    """

    room_width: Range = (0.6, 1.4)
    mean_width: float = 4.2
    depth: Range = (3.0, 6.5)
    corridor: Range = (1.5, 2.4)
    partition: Range = (0.10, 0.20)
    corridor_wall: Range = (0.12, 0.25)
    outer: Range = (0.25, 0.30)
    door: Range = (0.75, 1.10)
    door_height: Range = (2.0, 2.15)
    opening: Range = (1.1, 1.4)
    ceiling: Range = (2.5, 3.2)
    neighbour: float = 0.1
    bands_per_room: float = 0.16


@dataclass
class _Drawing:
    """What is drawn so far: clear rectangles, their kinds, and the doors."""

    rects: list[Polygon] = field(default_factory=list)
    kinds: list[str] = field(default_factory=list)
    openings: list[Opening] = field(default_factory=list)

    def room(self, kind: str, x: Range, y: Range) -> None:
        self.rects.append(box(x[0], y[0], x[1], y[1]))
        self.kinds.append(kind)

    def opening(self, kind: str, x: Range, y: Range, height: float) -> None:
        self.openings.append(Opening(kind, box(x[0], y[0], x[1], y[1]), 0.0, height))


def is_large_building(name: str) -> bool:
    """Whether a scene's name is one of these buildings'."""
    return re.fullmatch(r"rooms-[-\d]*", name) is not None


def large_building(name: str) -> Plan:
    """The building of a name ``rooms-N-SEED``. Raises InputError for other names and sizes."""
    match = NAME.fullmatch(name)
    if match is None or not FEWEST <= int(match[1]) <= MOST:
        raise InputError(
            f'scene "{name}": expected rooms-N-SEED with {FEWEST} to {MOST} rooms, as rooms-100-7'
        )
    return draw_large_building(int(match[1]), np.random.default_rng(int(match[2])), name)


def draw_large_building(
    rooms: int,
    rng: np.random.Generator,
    name: str,
    config: LargeBuildingConfig = LargeBuildingConfig(),
) -> Plan:
    """A single storey with exactly that many rooms, corridors among them; all can be reached."""
    bands = max(1, round(np.sqrt(config.bands_per_room * rooms)))
    across = 2 if bands > 1 else 0
    in_rows = _shared_out(rooms - bands - across, 2 * bands)
    length = config.mean_width * max(in_rows)
    drawing, y, middles = _Drawing(), 0.0, []
    for band in range(bands):
        y += float(rng.uniform(*config.corridor_wall)) if band else 0.0
        y, middle = _draw_band(drawing, rng, config, length, y, in_rows[2 * band : 2 * band + 2])
        middles.append(middle)
    if across:
        for x, outward in ((0.0, -1.0), (length, 1.0)):
            _draw_across(drawing, rng, config, (x, outward), y, middles)
    return _finished(drawing, rng, config, name)


def _shared_out(total: int, parts: int) -> list[int]:
    """``total`` in whole numbers that differ by one at most."""
    return [total // parts + (k < total % parts) for k in range(parts)]


def _draw_band(
    drawing: _Drawing,
    rng: np.random.Generator,
    config: LargeBuildingConfig,
    length: float,
    y: float,
    counts: list[int],
) -> tuple[float, float]:
    """A row of rooms, a corridor and another row, from y on; where it ends, and its middle."""
    low = y + float(rng.uniform(*config.depth))
    walls = rng.uniform(*config.corridor_wall, 2)
    corridor = (low + walls[0], low + walls[0] + float(rng.uniform(*config.corridor)))
    high = corridor[1] + walls[1]
    end = high + float(rng.uniform(*config.depth))
    drawing.room("corridor", (0.0, length), corridor)
    _draw_row(drawing, rng, config, length, (y, low), (low, corridor[0]), counts[0])
    _draw_row(drawing, rng, config, length, (high, end), (corridor[1], high), counts[1])
    return end, 0.5 * (corridor[0] + corridor[1])


def _draw_row(
    drawing: _Drawing,
    rng: np.random.Generator,
    config: LargeBuildingConfig,
    length: float,
    y: Range,
    wall: Range,
    count: int,
) -> None:
    """Rooms side by side, each with a door through the corridor's wall."""
    walls = rng.uniform(*config.partition, count - 1)
    shares = rng.uniform(*config.room_width, count)
    widths = shares / shares.sum() * (length - walls.sum())
    starts = np.append(0.0, np.cumsum(widths[:-1] + walls))
    for start, width in zip(starts, widths, strict=True):
        drawing.room("room", (start, start + width), y)
        door = min(float(rng.uniform(*config.door)), width - 0.4)
        at = start + float(rng.uniform(0.15, width - door - 0.15))
        through = (wall[0] - DEEPER, wall[1] + DEEPER)
        height = float(rng.uniform(*config.door_height))
        drawing.opening("door", (at, at + door), through, height)
    for k in np.flatnonzero(rng.random(count - 1) < config.neighbour):
        door = float(rng.uniform(*config.door))
        at = float(rng.uniform(y[0] + 0.2, y[1] - door - 0.2))
        gap = (starts[k + 1] - walls[k] - DEEPER, starts[k + 1] + DEEPER)
        drawing.opening("door", gap, (at, at + door), float(rng.uniform(*config.door_height)))


def _draw_across(
    drawing: _Drawing,
    rng: np.random.Generator,
    config: LargeBuildingConfig,
    at: tuple[float, float],
    end: float,
    middles: list[float],
) -> None:
    """A corridor across the ends of all bands at x, on the outward side, open to each of them."""
    x, outward = at
    near = x + outward * float(rng.uniform(*config.corridor_wall))
    far = near + outward * float(rng.uniform(*config.corridor))
    drawing.room("corridor", (min(near, far), max(near, far)), (0.0, end))
    through = (min(x, near) - DEEPER, max(x, near) + DEEPER)
    for middle in middles:
        half = 0.5 * float(rng.uniform(*config.opening))
        drawing.opening("opening", through, (middle - half, middle + half), 2.3)


def _finished(
    drawing: _Drawing, rng: np.random.Generator, config: LargeBuildingConfig, name: str
) -> Plan:
    """The plan, turned to any heading: what no room is, is wall."""
    outer = shapely.union_all(drawing.rects).envelope
    outer = shapely.buffer(outer, float(rng.uniform(*config.outer)), join_style="mitre")
    walls = shapely.difference(outer, shapely.union_all(drawing.rects))
    ceiling, heading = float(rng.uniform(*config.ceiling)), float(rng.uniform(0.0, 360.0))
    turned = [_turned(shape, heading) for shape in (walls, *drawing.rects)]
    number = {kind: itertools.count(1) for kind in set(drawing.kinds)}
    rooms = tuple(
        RoomOutline(str(i), f"{kind} {next(number[kind])}", kind, shape)
        for i, (kind, shape) in enumerate(zip(drawing.kinds, turned[1:], strict=True))
    )
    openings = tuple(
        Opening(o.kind, _turned(o.footprint, heading), o.z_min, o.z_max) for o in drawing.openings
    )
    storey = Storey("0", 0.0, ceiling, rooms, as_multipolygon(turned[0]), openings)
    return Plan(name, (storey,), notes="A building drawn from a seed.")


def _turned(shape: Polygon, degrees: float) -> Polygon:
    return affinity.rotate(shape, degrees, origin=(0, 0))
