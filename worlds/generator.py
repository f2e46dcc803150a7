"""Random buildings: many kinds, every one valid, each decided by the random generator handed in.

A building is drawn axis-parallel as clear rectangles with gaps of wall thickness between them; some
rectangles are then carved, joined or chamfered into rooms of other shapes. What the rooms leave of
the outer rectangle is wall. Doors join neighbours; piers and pillars are put where they leave the
way free; at last everything is turned to any heading.
"""

from __future__ import annotations

import itertools
from dataclasses import dataclass

import numpy as np
import shapely
from shapely import affinity
from shapely.geometry import MultiPolygon, Polygon, box
from shapely.ops import unary_union

from slam.core import Array
from worlds.plan import Opening, Plan, RoomOutline, Storey

Rect = tuple[float, float, float, float]
"""x_min, y_min, x_max, y_max of a clear rectangle [m]."""

DOOR_OVERHANG = 0.01
"""How far a door's footprint reaches into the rooms, so that it surely cuts the wall [m]."""


@dataclass(frozen=True)
class GeneratorConfig:
    """What a random building may be; lengths in metres, (low, high) ranges are uniform."""

    kinds: tuple[str, ...] = ("corridor", "corridor", "spine", "split", "cluster", "hall")
    room_width: tuple[float, float] = (1.5, 8.0)
    room_depth: tuple[float, float] = (2.0, 9.0)
    floor_side: tuple[float, float] = (8.0, 28.0)
    hall_side: tuple[float, float] = (9.0, 30.0)
    corridor_width: tuple[float, float] = (1.2, 3.0)
    corridor_length: tuple[float, float] = (6.0, 40.0)
    thickness: tuple[float, float] = (0.08, 0.35)
    door_width: tuple[float, float] = (0.7, 1.2)
    height: tuple[float, float] = (2.4, 3.5)
    max_rooms: int = 40
    carve: float = 0.15
    """Chance that a room big enough loses a corner to a closet or a shaft (L-shape)."""
    join: float = 0.06
    """Chance that a room is joined with a neighbour (L-, T- and Z-shapes)."""
    chamfer: float = 0.03
    """Chance that a room has one corner cut off by a slanted wall."""
    curve: float = 0.0
    """Chance that such a wall is a quarter of a circle, in facets, where it is one."""
    extra_door: float = 0.2
    """Chance of a door between neighbours that are joined already."""
    shear: float = 0.0
    """Chance of a building whose walls do not meet at right angles (up to 25 degrees off)."""
    taper: float = 0.0
    """Chance of a building whose walls are off parallel,"""
    tapered: float = 5.0
    """by up to so much along each of its sides [degrees]; a few, as in much that is old."""
    cross: float = 0.0
    """Chance that a long corridor is two, with a cross wall and a door between them."""
    piers: float = 0.0
    """Chance that a room has piers on its walls, and chases in them."""
    pillars: float = 0.0
    """Chance that a room big enough has pillars in it."""


def random_plan(rng: np.random.Generator, config: GeneratorConfig | None = None) -> Plan:
    """One valid random building, a single storey; rooms are clear polygons, nothing overlaps."""
    config = config or GeneratorConfig()
    while True:
        plan = _drawn(rng, config)
        # Carving, joining and chamfering one room can, once in thousands, pinch it off.
        if all(shape.is_valid for shape in _shapes(plan.storeys[0])):
            return plan


def _shapes(storey: Storey) -> list[Polygon | MultiPolygon]:
    return [storey.walls, *(room.outline for room in storey.rooms)]


def _drawn(rng: np.random.Generator, config: GeneratorConfig) -> Plan:
    kind = str(rng.choice(config.kinds))
    thickness = float(rng.uniform(*config.thickness))
    rects, corridors = _KINDS[kind](rng, config, thickness)
    if config.cross > 0.0:
        rects, corridors = _crossed(rng, config, rects, corridors, thickness)
    outer = unary_union([box(*r) for r in rects]).envelope
    polygons, kinds = _outlines(rects[: config.max_rooms], corridors)
    polygons, kinds = _reshape(rng, config, thickness, polygons, kinds)
    doors = _doors(rng, config, polygons)
    if config.piers > 0.0:
        polygons = [_with_piers(rng, config, polygon, doors) for polygon in polygons]
    walls = outer.buffer(float(rng.uniform(*config.thickness)), join_style="mitre")
    walls = walls.difference(unary_union(polygons))
    if config.pillars > 0.0:
        walls = unary_union([walls, *_pillars(rng, config, polygons, doors)])
    return _placed(rng, config, kind, polygons, kinds, doors, walls)


def _outlines(rects: list[Rect], corridors: set[int]) -> tuple[list[Polygon], list[str]]:
    """Rooms and their kinds; a rectangle that touches the one before it is of the same room."""
    polygons: list[Polygon] = []
    kinds: list[str] = []
    for i, rect in enumerate(rects):
        shape = box(*rect)
        if polygons and polygons[-1].distance(shape) == 0.0:
            polygons[-1] = unary_union([polygons[-1], shape])
        else:
            polygons.append(shape)
            kinds.append("corridor" if i in corridors else "room")
    return polygons, kinds


# --- rectangles ----------------------------------------------------------------------------------


def _widths(rng: np.random.Generator, total: float, low: float, high: float, gap: float) -> Array:
    """Random widths with gaps between them that fill ``total`` exactly; each at least ``low``."""
    count = max(1, int((total + gap) // (low + gap)))
    widths: list[float] = []
    while len(widths) < count:
        left = total - sum(widths) - gap * len(widths)
        if left < 2 * low + gap:
            widths.append(left)
            break
        widths.append(float(min(rng.uniform(low, high), left)))
        if total - sum(widths) - gap * len(widths) < low:
            widths[-1] = left
            break
    return np.asarray(widths)


def _row(rng: np.random.Generator, config: GeneratorConfig, rect: Rect, gap: float) -> list[Rect]:
    """Rooms side by side along x that fill a rectangle."""
    x0, y0, x1, y1 = rect
    high = float(rng.uniform(config.room_width[0] + 1.0, config.room_width[1]))
    widths = _widths(rng, x1 - x0, config.room_width[0], high, gap)
    starts = x0 + np.concatenate([[0.0], np.cumsum(widths[:-1] + gap)])
    return [(float(s), y0, float(s + w), y1) for s, w in zip(starts, widths, strict=True)]


def _split(
    rng: np.random.Generator, config: GeneratorConfig, rect: Rect, gap: float, stop: float
) -> list[Rect]:
    """Cut a rectangle in two, and those again, until the pieces are room-sized."""
    x0, y0, x1, y1 = rect
    width, depth = x1 - x0, y1 - y0
    low = config.room_width[0]
    longest = max(width, depth)
    if longest < 2 * low + gap or (longest < stop and rng.random() < 0.7):
        return [rect]
    if width < depth:
        turned = _split(rng, config, (y0, x0, y1, x1), gap, stop)
        return [(b, a, d, c) for a, b, c, d in turned]
    cut = float(x0 + rng.uniform(low, width - low - gap))
    left = _split(rng, config, (x0, y0, cut, y1), gap, stop)
    return left + _split(rng, config, (cut + gap, y0, x1, y1), gap, stop)


def _corridor(
    rng: np.random.Generator, config: GeneratorConfig, gap: float
) -> tuple[list[Rect], set[int]]:
    """A corridor with rooms on both sides, sometimes on one."""
    length = float(rng.uniform(*config.corridor_length))
    width = float(rng.uniform(*config.corridor_width))
    rects: list[Rect] = [(0.0, 0.0, length, width)]
    depth = float(rng.uniform(*config.room_depth))
    rects += _row(rng, config, (0.0, width + gap, length, width + gap + depth), gap)
    if rng.random() < 0.8:
        depth = float(rng.uniform(*config.room_depth))
        rects += _row(rng, config, (0.0, -gap - depth, length, -gap), gap)
    return rects, {0}


def _spine(
    rng: np.random.Generator, config: GeneratorConfig, gap: float
) -> tuple[list[Rect], set[int]]:
    """A corridor through an office floor whose halves are split at random."""
    length = float(rng.uniform(*config.floor_side))
    width = float(rng.uniform(*config.corridor_width))
    stop = float(rng.uniform(3.0, 9.0))
    rects: list[Rect] = [(0.0, 0.0, length, width)]
    for sign in (1.0, -1.0):
        depth = float(rng.uniform(3.0, 11.0))
        low = width + gap if sign > 0 else -gap - depth
        rects += _split(rng, config, (0.0, low, length, low + depth), gap, stop)
    return rects, {0}


def _floor(
    rng: np.random.Generator, config: GeneratorConfig, gap: float
) -> tuple[list[Rect], set[int]]:
    """An office floor split at random, without a corridor."""
    rect = (0.0, 0.0, float(rng.uniform(*config.floor_side)), float(rng.uniform(6.0, 18.0)))
    return _split(rng, config, rect, gap, float(rng.uniform(3.0, 9.0))), set()


def _cluster(
    rng: np.random.Generator, config: GeneratorConfig, gap: float
) -> tuple[list[Rect], set[int]]:
    """A few rooms side by side: a flat, a site hut."""
    rect = (0.0, 0.0, float(rng.uniform(4.0, 12.0)), float(rng.uniform(3.0, 10.0)))
    return _split(rng, config, rect, gap, float(rng.uniform(3.5, 7.0))), set()


def _hall(
    rng: np.random.Generator, config: GeneratorConfig, gap: float
) -> tuple[list[Rect], set[int]]:
    """One large room with smaller ones along one or two of its sides."""
    length, depth = (float(v) for v in rng.uniform(*config.hall_side, 2))
    rects: list[Rect] = [(0.0, 0.0, length, depth)]
    side = float(rng.uniform(*config.room_depth))
    rects += _row(rng, config, (0.0, depth + gap, length, depth + gap + side), gap)
    if rng.random() < 0.5:
        side = float(rng.uniform(*config.room_depth))
        rects += _row(rng, config, (0.0, -gap - side, length, -gap), gap)
    return rects, set()


def _wings(
    rng: np.random.Generator, config: GeneratorConfig, gap: float
) -> tuple[list[Rect], set[int]]:
    """A corridor round a corner, rooms along its outside, and a hall, rooms or nothing inside."""
    a, b = (float(v) for v in rng.uniform(10.0, 28.0, 2))
    width = float(rng.uniform(1.5, 4.0))
    below, beside = (float(v) for v in rng.uniform(*config.room_depth, 2))
    rects: list[Rect] = [(0.0, 0.0, a, width), (a - width, width, a, b)]
    rects += _row(rng, config, (0.0, -gap - below, a, -gap), gap)
    turned = _row(rng, config, (0.0, a + gap, b, a + gap + beside), gap)
    rects += [(y0, x0, y1, x1) for x0, y0, x1, y1 in turned]
    inner = (0.0, width + gap, a - width - gap, b)
    inside = float(rng.random())
    if inside < 0.4:
        rects.append(inner)
    elif inside < 0.7:
        rects += _split(rng, config, inner, gap, float(rng.uniform(4.0, 9.0)))
    return rects, {0, 1}


def _crossed(
    rng: np.random.Generator,
    config: GeneratorConfig,
    rects: list[Rect],
    corridors: set[int],
    gap: float,
) -> tuple[list[Rect], set[int]]:
    """Some long corridors divided by a cross wall."""
    parts: list[Rect] = []
    halls: set[int] = set()
    for i, rect in enumerate(rects):
        x0, y0, x1, y1 = rect
        long = max(x1 - x0, y1 - y0)
        if i in corridors and long > 8.0 and rng.random() < config.cross:
            cut = float(rng.uniform(3.0, long - 3.0 - gap))
            wide = x1 - x0 >= y1 - y0
            first = (x0, y0, x0 + cut, y1) if wide else (x0, y0, x1, y0 + cut)
            rest = (x0 + cut + gap, y0, x1, y1) if wide else (x0, y0 + cut + gap, x1, y1)
            halls |= {len(parts), len(parts) + 1}
            parts += [first, rest]
        else:
            halls |= {len(parts)} if i in corridors else set()
            parts.append(rect)
    return parts, halls


_KINDS = {
    "wings": _wings,
    "corridor": _corridor,
    "spine": _spine,
    "split": _floor,
    "cluster": _cluster,
    "hall": _hall,
}


# --- rooms that are not rectangles ---------------------------------------------------------------


def _reshape(
    rng: np.random.Generator,
    config: GeneratorConfig,
    gap: float,
    polygons: list[Polygon],
    kinds: list[str],
) -> tuple[list[Polygon], list[str]]:
    """Some rooms joined with a neighbour, some carved, some with a slanted corner."""
    polygons, kinds = list(polygons), list(kinds)
    for i in range(len(polygons) - 1, 0, -1):
        if rng.random() < config.join:
            j = int(rng.integers(i))
            joined = _joined(polygons[i], polygons[j], gap)
            if joined is not None:
                polygons[j] = joined
                del polygons[i], kinds[i]
    for i in range(len(polygons)):
        if rng.random() < config.carve:
            polygons[i], closet = _carved(rng, polygons[i], gap)
            if closet is not None and rng.random() < 0.7:
                polygons.append(closet)
                kinds.append("room")
        elif rng.random() < config.chamfer:
            polygons[i] = _chamfered(rng, polygons[i], config.curve)
    return polygons, kinds


def _joined(a: Polygon, b: Polygon, gap: float) -> Polygon | None:
    """Two neighbours as one room with the wall between them taken out; None if they are none."""
    for (p, q), (r, s) in _facing(a, b, 1.0):
        bridge = Polygon([p, q, r, s])
        joined = unary_union([a, b, bridge.buffer(1e-6, join_style="mitre")]).simplify(1e-4)
        if isinstance(joined, Polygon) and not joined.interiors:
            return joined
    return None


def _carved(
    rng: np.random.Generator, polygon: Polygon, gap: float
) -> tuple[Polygon, Polygon | None]:
    """A rectangle without one corner, and the closet in that corner (None: too small)."""
    x0, y0, x1, y1 = polygon.bounds
    if len(polygon.exterior.coords) != 5 or min(x1 - x0, y1 - y0) < 3.2:
        return polygon, None
    width = float(rng.uniform(1.0, (x1 - x0) - 1.4 - gap))
    depth = float(rng.uniform(1.0, (y1 - y0) - 1.4 - gap))
    left, low = rng.random() < 0.5, rng.random() < 0.5
    cx0, cx1 = (x0, x0 + width) if left else (x1 - width, x1)
    cy0, cy1 = (y0, y0 + depth) if low else (y1 - depth, y1)
    body = box(cx0, cy0, cx1, cy1).buffer(gap, join_style="mitre")
    room = polygon.difference(body)
    return (room, box(cx0, cy0, cx1, cy1)) if isinstance(room, Polygon) else (polygon, None)


def _chamfered(rng: np.random.Generator, polygon: Polygon, curve: float) -> Polygon:
    """A rectangle with one corner cut off by a slanted wall, or by a round one."""
    x0, y0, x1, y1 = polygon.bounds
    if len(polygon.exterior.coords) != 5 or min(x1 - x0, y1 - y0) < 3.0:
        return polygon
    dx, dy = rng.uniform(0.8, 0.5 * (x1 - x0)), rng.uniform(0.8, 0.5 * (y1 - y0))
    ends = [(x0 + dx, y0), (x0, y0 + dy)]
    if curve > 0.0 and rng.random() < curve:
        radius = float(max(dx, dy))
        angle = np.linspace(1.5 * np.pi, np.pi, 1 + max(2, round(radius * 0.5 * np.pi / 0.7)))
        ends = [(x0 + radius * (1.0 + np.cos(a)), y0 + radius * (1.0 + np.sin(a))) for a in angle]
    corner = Polygon([(x0, y0), *ends])
    if rng.random() < 0.5:
        corner = affinity.scale(corner, -1, 1, origin=((x0 + x1) / 2, 0))
    room = polygon.difference(corner)
    return room if isinstance(room, Polygon) else polygon


def _with_piers(
    rng: np.random.Generator, config: GeneratorConfig, polygon: Polygon, doors: list[Polygon]
) -> Polygon:
    """A room with some short parts of its walls stepped into it or out of it."""
    if rng.random() >= config.piers:
        return polygon
    for _ in range(int(rng.integers(1, 4))):
        edges = [(p, q) for p, q in _edges(polygon) if np.linalg.norm(q - p) > 2.0]
        if not edges:
            break
        p, q = edges[int(rng.integers(len(edges)))]
        length = float(np.linalg.norm(q - p))
        run = (q - p) / length
        inward = np.array([-run[1], run[0]])
        width, depth = float(rng.uniform(0.3, 1.2)), float(rng.uniform(0.12, 0.5))
        start = p + run * float(rng.uniform(0.0, length - width))
        corners = [start, start + width * run]
        pier = Polygon([*corners, corners[1] + depth * inward, corners[0] + depth * inward])
        # Nobody could pass by a pier that leaves less than a door's width.
        free = pier.buffer(config.door_width[1], join_style="mitre").intersection(polygon)
        whole = free.area > 2.2 * config.door_width[1] * (width + depth)
        if whole and all(door.distance(pier) > 0.3 for door in doors):
            stepped = polygon.difference(pier)
            polygon = stepped if isinstance(stepped, Polygon) else polygon
    return polygon


def _pillars(
    rng: np.random.Generator,
    config: GeneratorConfig,
    polygons: list[Polygon],
    doors: list[Polygon],
) -> list[Polygon]:
    """Pillars that stand free in rooms."""
    found: list[Polygon] = []
    for polygon in polygons:
        inner = polygon.buffer(-1.2)
        if inner.is_empty or rng.random() >= config.pillars:
            continue
        side = float(rng.uniform(0.3, 0.8))
        x0, y0, x1, y1 = inner.bounds
        for _ in range(int(rng.integers(1, 5))):
            x, y = rng.uniform([x0, y0], [x1, y1])
            pillar = box(x - side / 2, y - side / 2, x + side / 2, y + side / 2)
            if inner.covers(pillar) and all(pillar.distance(other) > 1.2 for other in found):
                found.append(pillar)
    return [pillar for pillar in found if all(pillar.distance(door) > 1.0 for door in doors)]


# --- doors ---------------------------------------------------------------------------------------

Stretch = tuple[tuple[Array, Array], tuple[Array, Array]]
"""Where two rooms face each other across a wall: a stretch of one (two ends), then of the other."""


def _facing(a: Polygon, b: Polygon, least: float) -> list[Stretch]:
    """Every stretch of at least ``least`` where a and b face each other across at most 0.6 m."""
    if a.distance(b) > 0.6:
        return []
    found: list[Stretch] = []
    for p, q in _edges(a):
        run = (q - p) / np.linalg.norm(q - p)
        inward = np.array([-run[1], run[0]])
        for r, s in _edges(b):
            height = float((r - p) @ inward)
            if abs((s - r) @ inward) > 1e-6 or not -0.6 <= height <= -0.01:
                continue
            low = max(0.0, float(min((r - p) @ run, (s - p) @ run)))
            high = min(float((q - p) @ run), float(max((r - p) @ run, (s - p) @ run)))
            if high - low >= least and (s - r) @ run < 0:
                across = height * inward
                ends = p + low * run, p + high * run
                found.append((ends, (ends[1] + across, ends[0] + across)))
    return found


def _edges(polygon: Polygon) -> list[tuple[Array, Array]]:
    """Boundary edges, the room on their left."""
    ring = np.asarray(polygon.exterior.coords)
    ring = ring if polygon.exterior.is_ccw else ring[::-1]
    return list(itertools.pairwise(ring))


def _doors(
    rng: np.random.Generator, config: GeneratorConfig, polygons: list[Polygon]
) -> list[Polygon]:
    """Door footprints that join every room to the others where a wall allows it."""
    pairs = [(i, j) for i in range(len(polygons)) for j in range(i)]
    group = list(range(len(polygons)))
    doors: list[Polygon] = []
    # Big rooms and corridors first: doors lead to them rather than from cell to cell.
    size = [p.length + float(rng.uniform(0.0, 6.0)) for p in polygons]
    for i, j in sorted(pairs, key=lambda pair: -max(size[pair[0]], size[pair[1]])):
        if group[i] == group[j] and rng.random() > config.extra_door:
            continue
        door = _door(rng, config, polygons[i], polygons[j])
        if door is not None and all(door.distance(d) > 0.3 for d in doors):
            doors.append(door)
            group = [group[j] if g == group[i] else g for g in group]
    return doors


def _door(
    rng: np.random.Generator, config: GeneratorConfig, a: Polygon, b: Polygon
) -> Polygon | None:
    """A door somewhere in a wall between two rooms; None if no stretch of wall is long enough."""
    width = float(rng.uniform(*config.door_width))
    stretches = _facing(a, b, width + 0.2)
    if not stretches:
        return None
    (p, q), (_, s) = stretches[int(rng.integers(len(stretches)))]
    length = float(np.linalg.norm(q - p))
    run = (q - p) / length
    across = (s - p) / np.linalg.norm(s - p)
    start = p + run * float(rng.uniform(0.1, length - width - 0.1)) - DOOR_OVERHANG * across
    depth = (np.linalg.norm(s - p) + 2 * DOOR_OVERHANG) * across
    return Polygon([start, start + width * run, start + width * run + depth, start + depth])


# --- the plan ------------------------------------------------------------------------------------


def _placed(
    rng: np.random.Generator,
    config: GeneratorConfig,
    kind: str,
    polygons: list[Polygon],
    kinds: list[str],
    doors: list[Polygon],
    walls: Polygon | MultiPolygon,
) -> Plan:
    """The plan, sheared perhaps, turned to a random heading about the origin."""
    sheared = rng.random() < config.shear
    shear = float(rng.uniform(8.0, 25.0)) if sheared else 0.0
    heading = float(rng.uniform(0.0, 360.0))
    tapered = config.taper > 0.0 and rng.random() < config.taper
    extent = max(abs(v) for polygon in polygons for v in polygon.bounds)
    taper = rng.uniform(-1.0, 1.0, 2) * np.radians(config.tapered) / extent if tapered else None

    def place(shape: Polygon) -> Polygon:
        skewed = affinity.skew(shape, xs=shear, origin=(0, 0)) if shear else shape
        if taper is not None:  # what keeps straight lines straight, but not parallel
            skewed = shapely.transform(skewed, lambda xy: xy / (1.0 + xy @ taper)[:, None])
        return affinity.rotate(skewed, heading, origin=(0, 0))

    parts = list(walls.geoms) if isinstance(walls, MultiPolygon) else [walls]
    rooms = tuple(
        RoomOutline(f"r{i}", f"{kinds[i]} {i}", kinds[i], place(p)) for i, p in enumerate(polygons)
    )
    top = float(rng.uniform(2.0, 2.2))
    storey = Storey(
        name="0",
        z_floor=0.0,
        z_ceiling=float(rng.uniform(*config.height)),
        rooms=rooms,
        walls=MultiPolygon([place(p) for p in parts]),
        openings=tuple(Opening("door", place(d), 0.0, top) for d in doors),
    )
    return Plan(name=f"random-{kind}", storeys=(storey,), notes="generated at random")
