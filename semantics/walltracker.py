"""Walls over time: each keeps its id from one inference to the next, none flickers."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace

from semantics.overlap import common
from slam.core import WallProposal


@dataclass(frozen=True)
class WallTrackerConfig:
    """patience: inferences without evidence after which a wall is given up."""

    patience: int = 3


class WallTracker:
    """A wall is known by its two planes; where a pair of planes has several, by where they are."""

    def __init__(self, config: WallTrackerConfig = WallTrackerConfig()):
        self._config = config
        self._known: dict[int, WallProposal] = {}
        self._sources: dict[int, WallProposal] = {}
        self._missed: dict[int, int] = {}
        self._next = 0

    def update(self, found: Sequence[WallProposal]) -> tuple[WallProposal, ...]:
        """The walls to hold true now."""
        same = {id(wall): name for name, wall in self._sources.items()}
        names = [same.get(id(wall)) for wall in found]
        taken = set(names)
        free = _by_planes((n, wall) for n, wall in self._known.items() if n not in taken)
        named: dict[int, WallProposal] = {}
        sources = {}
        for wall, known in zip(found, names, strict=True):
            name = self._match(wall, free) if known is None else known
            sources[name] = wall
            named[name] = self._known[name] if known is not None else replace(wall, id=name)
        kept = self._missing(named)
        self._sources = sources
        self._known = dict(sorted({**named, **kept}.items()))
        return tuple(self._known.values())

    def _match(
        self, wall: WallProposal, free: dict[tuple[int, int], dict[int, WallProposal]]
    ) -> int:
        """The id of a known wall that is this one, which then is no longer free; or a new id."""
        rivals = free.get(_planes(wall), {})
        name = next((n for n, known in rivals.items() if _same_wall(wall, known)), None)
        if name is not None:
            del rivals[name]
            return name
        self._next += 1
        return self._next - 1

    def _missing(self, named: Mapping[int, WallProposal]) -> dict[int, WallProposal]:
        """Known walls that were not found but are kept for now."""
        lost = {name: wall for name, wall in self._known.items() if name not in named}
        present = _by_planes(named.items()) if lost else {}
        kept = {}
        for name, wall in lost.items():
            others = present.get(_planes(wall), {}).values()
            patient = self._missed.get(name, 0) < self._config.patience
            if patient and not any(_same_wall(wall, other) for other in others):
                kept[name] = wall
        self._missed = {name: self._missed.get(name, 0) + 1 for name in kept}
        return kept


def _planes(wall: WallProposal) -> tuple[int, int]:
    """Of both faces, in the order of their ids."""
    first, second = wall.pieces
    return min(first.plane_id, second.plane_id), max(first.plane_id, second.plane_id)


def _by_planes(
    walls: Iterable[tuple[int, WallProposal]],
) -> dict[tuple[int, int], dict[int, WallProposal]]:
    """The pair of planes -> walls by name."""
    found: dict[tuple[int, int], dict[int, WallProposal]] = {}
    for name, wall in walls:
        found.setdefault(_planes(wall), {})[name] = wall
    return found


def _same_wall(a: WallProposal, b: WallProposal) -> bool:
    return any(
        common(a.pieces[:1], pair[:1]) > 0.0 and common(a.pieces[1:], pair[1:]) > 0.0
        for pair in (b.pieces, b.pieces[::-1])
    )
