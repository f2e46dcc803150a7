"""What rooms and walls say about planes: the informative factors, as data.

Each relation holds between two planes and stands by itself, so that its worth can be measured. None
knows anything of the plan, and each is proposed only where the estimate already agrees with it: in
a building that is not rectangular there is nothing to propose.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from itertools import combinations
from typing import Literal

import numpy as np

from slam.core import Array, InputError

Kind = Literal["parallel", "perpendicular", "thickness"]

Wall = tuple[tuple[int, int], Array]
"""The ids of its two planes, and a point (3,) between them."""


@dataclass(frozen=True)
class Relation:
    """Two planes, by id, and what holds between them. point: (3,) where, for a thickness, and
    group: the walls that share it."""

    kind: Kind
    planes: tuple[int, int]
    group: int = 0
    point: Array = field(default_factory=lambda: np.zeros(3), compare=False)
    value: float = field(default=0.0, compare=False)


@dataclass(frozen=True)
class RelationConfig:
    """Which relations there are, and how firmly they hold.

    parallel, perpendicular: of the walls of one room, with their standard deviation angle [rad], if
    the estimate is within gate [rad]; thickness: walls as thick as at least ``alike`` others within
    ``group`` [m] share one thickness, to spread [m]; merging: planes of one room that face the same
    way are one if they are within apart [m].
    """

    parallel: bool = True
    perpendicular: bool = True
    thickness: bool = True
    merging: bool = True
    angle: float = np.radians(0.3)
    gate: float = np.radians(1.0)
    alike: int = 3
    group: float = 0.015
    spread: float = 0.006
    apart: float = 0.08


KINDS = ("parallel", "perpendicular", "thickness", "merging")


def relations_named(name: str) -> RelationConfig | None:
    """``paper``: none beside the published factors; ``informative``: all; a kind: that alone.

    Raises InputError for another name.
    """
    known = ("paper", "informative", *KINDS)
    if name not in known:
        raise InputError(f"factors: {name!r} is unknown, expected one of {', '.join(known)}")
    if name == "paper":
        return None
    return RelationConfig(**{kind: name in ("informative", kind) for kind in KINDS})


class Relations:
    """All relations that hold now; it remembers which walls it has found equally thick."""

    def __init__(self, config: RelationConfig):
        self.config = config
        self._thicknesses = Thicknesses(config)

    def of(
        self, rooms: Iterable[Sequence[int]], walls: Iterable[Wall], normals: Array, offsets: Array
    ) -> set[Relation]:
        """Of rooms by the ids of their planes, and of walls. normals: (P, 3) and offsets: (P,) of
        all planes, by id."""
        config = self.config
        found = {r for planes in rooms for r in room_relations(planes, normals, config)}
        if config.thickness:
            found |= set(self._thicknesses.relations(walls, normals, offsets))
        return found


def room_relations(
    planes: Sequence[int], normals: Array, config: RelationConfig
) -> Iterable[Relation]:
    """Of the planes of one room. normals: (P, 3) of all planes, by id."""
    for a, b in combinations(sorted(planes), 2):
        dot = float(normals[a] @ normals[b])
        if config.parallel and abs(dot) > np.cos(config.gate):
            yield Relation("parallel", (a, b))
        elif config.perpendicular and abs(dot) < np.sin(config.gate):
            yield Relation("perpendicular", (a, b))


class Thicknesses:
    """Groups of walls that are about equally thick."""

    def __init__(self, config: RelationConfig):
        self._config = config
        self._centres: list[float] = []
        self._of_wall: dict[tuple[int, int], int] = {}

    def relations(self, walls: Iterable[Wall], normals: Array, offsets: Array) -> list[Relation]:
        """Of walls as thick as enough others. normals: (P, 3) and offsets: (P,) by id."""
        found = []
        for planes, point in walls:
            a, b = planes
            if normals[a] @ normals[b] > -np.cos(self._config.gate):
                continue
            thickness = -float((normals[a] + normals[b]) @ point + offsets[a] + offsets[b])
            group = self._group((min(planes), max(planes)), thickness)
            found.append(Relation("thickness", (min(planes), max(planes)), group, point, thickness))
        counts = np.bincount([relation.group for relation in found], minlength=1)
        return [relation for relation in found if counts[relation.group] >= self._config.alike]

    def _group(self, wall: tuple[int, int], thickness: float) -> int:
        """The group that a wall is in, where it stays while it fits, or joins, or a new one."""
        group = self._of_wall.get(wall)
        if group is None or abs(self._centres[group] - thickness) > 2.0 * self._config.group:
            apart = [abs(centre - thickness) for centre in self._centres]
            group = int(np.argmin(apart)) if apart else 0
            if not apart or apart[group] > self._config.group:
                group = len(self._centres)
                self._centres.append(thickness)
            self._of_wall[wall] = group
        return group
