"""How far a building as built departs from its plan, and what stands and walks in it: presets."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields, replace

from slam.core import InputError
from worlds.names import unknown

SPREADS = ("yaw", "lean", "shift", "thickness")
"""The fields that say how exactly walls are built; ``ideal`` switches these off."""


@dataclass(frozen=True)
class Conditions:
    """What is done to a plan. ``name`` is how it was asked for.

    Standard deviations of what happens to each wall body, all normal, independent: yaw, lean:
    turns about z and about the wall's foot [degrees]; shift: along its normal [m]; thickness:
    change of its thickness [m].

    Shares in [0, 1]: furniture, clutter: how much of a room's walls has furniture or building
    material before it (if it fits); unfinished: of partitions that are not whole (studs, half-high,
    a gap); bare: of doors without frame and lintel; open_doors: of doors with a leaf, which stands
    open; glass_walls: of partitions with a pane in them; glass_doors: of leaves that are panes;
    windows: of windows that have a pane (others are holes); no_ceiling: of rooms.
    people: how many walk about, per 100 m2 of rooms.
    """

    name: str
    yaw: float = 0.15
    lean: float = 0.15
    shift: float = 0.005
    thickness: float = 0.003
    furniture: float = 0.0
    clutter: float = 0.0
    unfinished: float = 0.0
    bare: float = 0.0
    open_doors: float = 0.0
    glass_walls: float = 0.0
    glass_doors: float = 0.0
    windows: float = 0.0
    no_ceiling: float = 0.0
    people: float = 0.0

    @property
    def redrawn(self) -> bool:
        """Whether partitions or openings of the plan change before it is built."""
        return max(self.unfinished, self.bare, self.glass_walls, self.windows) > 0.0


AS_BUILT = Conditions("as-built")
IDEAL = Conditions("ideal", yaw=0.0, lean=0.0, shift=0.0, thickness=0.0)
CONDITIONS = {
    conditions.name: conditions
    for conditions in (
        AS_BUILT,
        IDEAL,
        Conditions("furniture", furniture=0.5),
        Conditions("clutter", clutter=0.4),
        Conditions("unfinished", unfinished=0.4, bare=0.4),
        Conditions("open-doors", open_doors=0.9),
        Conditions("glass", glass_walls=0.25, glass_doors=0.4, windows=1.0),
        Conditions("people", people=2.5),
        Conditions("no-ceiling", no_ceiling=0.6),
        # A building site: nobody has hung the doors, a few craftsmen are about.
        Conditions(
            "real-site", clutter=0.35, unfinished=0.25, bare=0.6, no_ceiling=0.3, people=1.5
        ),
        Conditions(
            "office",
            furniture=0.5,
            open_doors=0.8,
            glass_walls=0.15,
            glass_doors=0.15,
            windows=1.0,
            people=2.5,
        ),
    )
}
"""By name. All but ``ideal`` come on top of the as-built walls."""


def conditions_named(name: str) -> Conditions:
    """The preset of that name, or several joined by "+": of each field the strongest, the walls
    ideal if that is among them. Raises InputError, with the nearest names, for an unknown one.
    """
    parts = [_preset(part.strip(), name) for part in name.split("+")]
    return parts[0] if len(parts) == 1 else _joined(name, parts)


def _preset(part: str, name: str) -> Conditions:
    if part not in CONDITIONS:
        raise InputError(f'conditions "{name}": {unknown("preset", part, CONDITIONS)}')
    return CONDITIONS[part]


def _joined(name: str, parts: Sequence[Conditions]) -> Conditions:
    walls = IDEAL if IDEAL in parts else AS_BUILT
    shares = [field.name for field in fields(Conditions) if field.name not in ("name", *SPREADS)]
    strongest = {share: max(getattr(part, share) for part in parts) for share in shares}
    return replace(walls, name=name, **strongest)
