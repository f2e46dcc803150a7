"""The learned detector: planes -> pieces -> proximity graph -> edges -> rooms and walls."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Generic, TypeVar

import numpy as np

from semantics.clusters import ClusterConfig, Clusters, agglomerate, is_room
from semantics.cycles import cycles, has_opposed_sides, mean_centre
from semantics.edges import EdgeModel, Edges, LocalEdges
from semantics.habit import Habit
from semantics.outline import room_outlines
from semantics.pieces import Pieces, PreprocessConfig, joined
from semantics.preprocess import Preprocessor
from semantics.roomtracker import RoomTracker
from semantics.walls import WallConfig, faces_of, walls_of
from semantics.walltracker import WallTracker
from slam.core import (
    Array,
    InputError,
    IntArray,
    Links,
    MapView,
    Proposals,
    RoomProposal,
    WallProposal,
)

WEIGHTS = Path(__file__).parent / "weights"
"""The weights that ship; ``roomloop train`` makes them."""
T = TypeVar("T")


@dataclass(frozen=True)
class Clustering:
    """How edges become rooms. group: pieces into clusters; holds: is a cluster a room; centre: of
    a room (pieces, the outline's centre)."""

    group: Callable[[int, IntArray, Array, ClusterConfig], Clusters]
    holds: Callable[[Pieces, ClusterConfig], bool]
    centre: Callable[[Pieces, Array], Array]


LINKAGE = Clustering(agglomerate, is_room, lambda sides, centre: centre)
CYCLES = Clustering(cycles, has_opposed_sides, lambda sides, centre: mean_centre(sides))


@dataclass(frozen=True)
class DetectorConfig:
    """weights: files of the networks, which together tell both relations; habit: log-odds by which
    pieces that were in one room lean to be so again."""

    weights: tuple[Path, ...] = (WEIGHTS / "gnn.npz",)
    clustering: Clustering = LINKAGE
    clusters: ClusterConfig = field(default_factory=ClusterConfig)
    walls: WallConfig = field(default_factory=WallConfig)
    habit: float = 1.0
    preprocess: PreprocessConfig = field(default_factory=PreprocessConfig)


CONSERVATIVE = DetectorConfig()
GREEDY = replace(CONSERVATIVE, clusters=ClusterConfig(room=0.35), walls=WallConfig(wall=0.3))
PAPER = DetectorConfig(
    weights=(WEIGHTS / "paper_same_room.npz", WEIGHTS / "paper_same_wall.npz"),
    clustering=CYCLES,
    clusters=ClusterConfig(room=0.7),
)
PAPER_GREEDY = replace(PAPER, clusters=ClusterConfig(room=0.35), walls=WallConfig(wall=0.3))
PRESETS = {
    "gnn": CONSERVATIVE,
    "gnn-greedy": GREEDY,
    "paper": PAPER,
    "paper-greedy": PAPER_GREEDY,
}


def make_detector(name: str) -> GnnDetector:
    """A learned detector: ours (gnn) or the paper's, conservative or greedy."""
    if name not in PRESETS:
        raise InputError(f"detector: {name!r} is unknown, expected one of {', '.join(PRESETS)}")
    return GnnDetector(PRESETS[name])


class GnnDetector:
    """Edges by the networks (paper, III-B), rooms and walls of them, which keep their ids."""

    def __init__(self, config: DetectorConfig = CONSERVATIVE):
        self._config = config
        self._preprocess = Preprocessor(config.preprocess)
        self._edges = LocalEdges(EdgeModel(config.weights))
        self._rooms, self._walls = RoomTracker(), WallTracker()
        self._habit = Habit(config.habit)
        self._known_rooms = _Kept[RoomProposal | None]()
        self._known_walls = _Kept[WallProposal]()
        self._pieces, self._linked = joined([]), np.empty((0, 2), dtype=np.int64)

    def update(self, view: MapView) -> Proposals:
        """All rooms and walls of the map as it is now. Raises InputError for broken planes."""
        config = self._config
        pieces = self._preprocess(view.planes)
        edges = self._edges(pieces)
        steady = self._habit.lean(pieces, edges)
        self._pieces, self._linked = pieces, edges.pairs[steady > config.clusters.room]
        clusters = config.clustering.group(len(pieces), edges.pairs, steady, config.clusters)
        self._habit.remember(pieces, clusters)
        chosen = walls_of(pieces, edges.pairs, edges.wall, clusters.label, config.walls)
        rooms = self._find_rooms(pieces, clusters)
        walls = self._find_walls(pieces, edges.take(chosen))
        return _of_mapped(view, self._rooms.update(rooms), self._walls.update(walls))

    def links(self) -> Links:
        """The edges that speak for one room, of the last update."""
        return Links(self._pieces.every(), self._linked)

    def _find_rooms(self, pieces: Pieces, clusters: Clusters) -> list[RoomProposal]:
        groups = [group for group in clusters.groups() if len(group) > 1]
        firsts = np.array([group[0] for group in groups], dtype=np.int64)
        confidence = clusters.confidence[clusters.label[firsts]]

        def make(places: list[int]) -> list[RoomProposal | None]:
            return self._made(pieces.split([groups[k] for k in places]), confidence[places])

        members = np.concatenate([firsts[:0], *groups])
        keys = _keys(pieces.take(members), [len(group) for group in groups], confidence.tolist())
        return [room for room in self._known_rooms(keys, make) if room is not None]

    def _made(self, sides: Sequence[Pieces], confidence: Array) -> list[RoomProposal | None]:
        """The rooms that these sides make, each; None where they make none."""
        clustering, config = self._config.clustering, self._config.clusters
        held = [place for place, each in enumerate(sides) if clustering.holds(each, config)]
        found: list[RoomProposal | None] = [None] * len(sides)
        outlines = room_outlines([sides[place] for place in held])
        for place, (polygon, centre) in zip(held, outlines, strict=True):
            members, sure = sides[place].every(), float(confidence[place])
            centre = clustering.centre(sides[place], centre)
            found[place] = RoomProposal(-1, members, polygon, centre, sure)
        return found

    def _find_walls(self, pieces: Pieces, edges: Edges) -> list[WallProposal]:
        confidence = edges.wall.tolist()

        def make(places: list[int]) -> list[WallProposal]:
            faces = faces_of(pieces, edges.pairs[places])
            return [
                WallProposal(-1, both, confidence[k]) for k, both in zip(places, faces, strict=True)
            ]

        keys = _keys(pieces.take(edges.pairs.ravel()), [2] * len(confidence), confidence)
        return self._known_walls(keys, make)


def _of_mapped(
    view: MapView, rooms: Sequence[RoomProposal], walls: Sequence[WallProposal]
) -> Proposals:
    """Without the planes that the map has no more: a room that was missed only lately may still
    name some that were merged."""
    planes = {plane.id for plane in view.planes}
    kept = []
    for room in rooms:
        pieces = tuple(piece for piece in room.pieces if piece.plane_id in planes)
        if len(pieces) == len(room.pieces):
            kept.append(room)
        elif pieces:
            kept.append(replace(room, pieces=pieces))
    both = [wall for wall in walls if all(piece.plane_id in planes for piece in wall.pieces)]
    return Proposals(tuple(kept), tuple(both))


_Key = tuple[bytes, float]
"""What a proposal depends on: its pieces, and a confidence that is the same to a tenth."""


def _keys(members: Pieces, sizes: Sequence[int], confidence: Sequence[float]) -> list[_Key]:
    """Of groups of so many pieces each, one group after the other."""
    states = [members.plane_id, members.segment.reshape(-1, 4), members.normal]
    raw = np.column_stack(states).tobytes()
    bounds = (len(raw) // max(len(members), 1) * np.cumsum([0, *sizes])).tolist()
    spans = zip(bounds[:-1], bounds[1:], confidence, strict=True)
    return [(raw[start:end], round(sure, 1)) for start, end, sure in spans]


class _Kept(Generic[T]):
    """What was made last time and comes again, as the same object."""

    def __init__(self) -> None:
        self._known: dict[_Key, T] = {}

    def __call__(self, keys: Sequence[_Key], make: Callable[[list[int]], list[T]]) -> list[T]:
        """make: what stands at some places, all that are not known yet."""
        known = self._known
        new = [place for place, key in enumerate(keys) if key not in known]
        made = dict(zip(new, make(new) if new else [], strict=True))
        self._known = {
            key: made[place] if place in made else known[key] for place, key in enumerate(keys)
        }
        return list(self._known.values())
