"""What a random building may be."""

from __future__ import annotations

from dataclasses import dataclass


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
    """Chance that a long corridor is two, with a cross wall and a door between them, and that one
    round a corner is, with the wall at the corner."""
    opening: float = 0.0
    """Chance that corridors which meet do so in an opening, up to as wide as they are, and not in a
    door."""
    piers: float = 0.0
    """Chance that a room has piers on its walls, and chases in them."""
    pillars: float = 0.0
    """Chance that a room big enough has pillars in it."""
