"""Random buildings: many kinds, every one valid, each decided by the random generator handed in.

A building is drawn axis-parallel as clear rectangles with gaps of wall thickness between them; some
rectangles are then carved, joined or chamfered into rooms of other shapes. What the rooms leave of
the outer rectangle is wall. Doors join neighbours; piers and pillars are put where they leave the
way free; at last everything is turned to any heading.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import shapely
from shapely import affinity
from shapely.geometry import MultiPolygon, Polygon, box
from shapely.ops import unary_union

from worlds.generator.config import GeneratorConfig
from worlds.generator.doors import draw_doors
from worlds.generator.layouts import draw_layout
from worlds.generator.piers import pillars, with_piers
from worlds.generator.shapes import merged, reshaped
from worlds.plan import Opening, Plan, RoomOutline, Storey

__all__ = ["GeneratorConfig", "random_plan"]


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
    rects, corridors = draw_layout(rng, config, kind, thickness)
    outer = unary_union([box(*r) for r in rects]).envelope
    polygons, kinds = merged(rects[: config.max_rooms], corridors)
    polygons, kinds = reshaped(rng, config, thickness, polygons, kinds)
    doors, openings = draw_doors(rng, config, polygons, kinds)
    if config.piers > 0.0:
        polygons = [with_piers(rng, config, polygon, doors + openings) for polygon in polygons]
    walls = outer.buffer(float(rng.uniform(*config.thickness)), join_style="mitre")
    walls = walls.difference(unary_union(polygons))
    if config.pillars > 0.0:
        walls = unary_union([walls, *pillars(rng, config, polygons, doors + openings)])
    return _placed(rng, config, kind, polygons, kinds, doors, openings, walls)


def _placed(
    rng: np.random.Generator,
    config: GeneratorConfig,
    kind: str,
    polygons: list[Polygon],
    kinds: list[str],
    doors: list[Polygon],
    openings: list[Polygon],
    walls: Polygon | MultiPolygon,
) -> Plan:
    """The plan of what was drawn axis-parallel."""
    place = _placement(rng, config, polygons)
    parts = list(walls.geoms) if isinstance(walls, MultiPolygon) else [walls]
    rooms = tuple(
        RoomOutline(f"r{i}", f"{kinds[i]} {i}", kinds[i], place(p)) for i, p in enumerate(polygons)
    )
    top = float(rng.uniform(2.0, 2.2))
    ceiling = float(rng.uniform(*config.height))
    holes = [Opening("door", place(door), 0.0, top) for door in doors]
    holes += [
        Opening("opening", place(o), 0.0, float(rng.uniform(top, ceiling - 0.1))) for o in openings
    ]
    storey = Storey(
        name="0",
        z_floor=0.0,
        z_ceiling=ceiling,
        rooms=rooms,
        walls=MultiPolygon([place(p) for p in parts]),
        openings=tuple(holes),
    )
    return Plan(name=f"random-{kind}", storeys=(storey,), notes="generated at random")


def _placement(
    rng: np.random.Generator, config: GeneratorConfig, polygons: list[Polygon]
) -> Callable[[Polygon], Polygon]:
    """What shears a building, or tapers it, perhaps, and turns it to a random heading about the
    origin. polygons: its rooms, for how far it reaches."""
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

    return place
