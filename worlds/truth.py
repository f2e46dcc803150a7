"""The exact truth of a world, as built: faces, walls, rooms, doors and floors, in the world frame.

What the words mean is fixed by the scoring (README, "What is scored"): a *face* is what bounds one
room on one line; a *wall* is two faces that look away from each other across one wall body; rooms
that nothing or only an opening wider than 2.5 m separates are one room.
"""

from __future__ import annotations

from dataclasses import dataclass

from shapely.geometry import Polygon

from slam.core import Array
from worlds.plan import UNLABELLED

# Labels of LiDAR returns that are not on a face (faces are labelled 0, 1, 2, ...).
NO_FACE = -1  # jambs, sills, outer walls, faces too short to be scored
FLOOR = -2
CEILING = -3
CLUTTER = -4  # pillars; building material, ladders, scaffolds
FURNITURE = -5
PEOPLE = -6
GLASS = -7  # panes in windows, partitions and doors
LEAF = -8  # door leaves
LABELS = {
    "none": NO_FACE,
    "floor": FLOOR,
    "ceiling": CEILING,
    "clutter": CLUTTER,
    "furniture": FURNITURE,
    "people": PEOPLE,
    "glass": GLASS,
    "leaf": LEAF,
}
"""By the names that files use."""


@dataclass(frozen=True)
class Face:
    """All coplanar, same-facing parts of one room's boundary.

    Facets of a curve that are shorter than what is scored are taken together: such a face is a
    chord, and its plane the best one through them.

    id: its place in ``Truth.faces`` and the label of the returns from it; segment: (2, 2) its two
    ends in plan view, at mid height, left end first when seen from the room; parts: (P, 2, 2) the
    stretches of real wall between them; normal (3,), d: n.x + d = 0 with n into the room; z_range:
    lowest and highest point; surface: coplanar, same-facing faces share one (2 cm, 1 degree).
    """

    id: int
    room: int
    normal: Array
    d: float
    segment: Array
    parts: Array
    z_range: tuple[float, float]
    surface: int

    @property
    def length(self) -> float:
        """Length of real wall on this face [m]."""
        return float(((self.parts[:, 1] - self.parts[:, 0]) ** 2).sum(axis=1).__pow__(0.5).sum())


@dataclass(frozen=True)
class Wall:
    """Two faces that look away from each other across one wall body."""

    id: int
    faces: tuple[int, int]
    thickness: float


@dataclass(frozen=True)
class Room:
    """A room as built: its clear outline, and the faces that it owns."""

    id: int
    name: str
    kind: str
    storey: int
    polygon: Polygon
    faces: tuple[int, ...]


@dataclass(frozen=True)
class Door:
    """A doorway or opening: its middle, the two rooms it joins (None: outside), its clear width."""

    centre: Array
    rooms: tuple[int | None, int | None]
    width: float
    height: float


@dataclass(frozen=True)
class Floor:
    """A storey's floor and ceiling heights [m]."""

    storey: int
    z_floor: float
    z_ceiling: float


@dataclass(frozen=True)
class Truth:
    """Everything that is true of a world."""

    faces: tuple[Face, ...]
    walls: tuple[Wall, ...]
    rooms: tuple[Room, ...]
    doors: tuple[Door, ...]
    floors: tuple[Floor, ...]

    @property
    def rooms_known(self) -> bool:
        """Whether the rooms are truth, not mere free areas of a building that tells of none. Where
        they are not, neither are walls: faces end where rooms end."""
        return any(room.kind != UNLABELLED for room in self.rooms)
