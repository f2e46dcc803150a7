"""The learned detector: planes -> pieces -> proximity graph -> edges -> rooms and walls."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING

from semantics.clusters import Cluster, ClusterConfig, agglomerate, is_room, walls_of
from semantics.outline import room_outline
from semantics.preprocess import Pieces, PreprocessConfig, Preprocessor
from semantics.proximity import features_named, proximity_graph
from semantics.tracker import RoomTracker, WallTracker
from slam.core import Array, InputError, IntArray, MapView, Proposals, RoomProposal, WallProposal

if TYPE_CHECKING:
    from semantics.network import EdgeClassifier

WEIGHTS = Path(__file__).parent / "weights"
"""The weights that ship; ``roomloop train`` makes them."""


@dataclass(frozen=True)
class DetectorConfig:
    """weights: folder with same_room.npz and same_wall.npz; thresholds are in ``clusters``."""

    weights: Path = WEIGHTS
    clusters: ClusterConfig = field(default_factory=ClusterConfig)
    preprocess: PreprocessConfig = field(default_factory=PreprocessConfig)


CONSERVATIVE = DetectorConfig()
GREEDY = replace(CONSERVATIVE, clusters=ClusterConfig(room=0.4, wall=0.3))
PRESETS = {"gnn": CONSERVATIVE, "gnn-greedy": GREEDY}


def make_detector(name: str) -> GnnDetector:
    """The learned detector at one of its thresholds: gnn (conservative) or gnn-greedy."""
    if name not in PRESETS:
        raise InputError(f"detector: {name!r} is unknown, expected one of {', '.join(PRESETS)}")
    return GnnDetector(PRESETS[name])


class GnnDetector:
    """Two edge classifiers (paper, III-B) and a clustering; rooms and walls keep their ids."""

    def __init__(self, config: DetectorConfig = CONSERVATIVE):
        self._config = config
        self._preprocess = Preprocessor(config.preprocess)
        self._room_edges = _EdgeModel(config.weights / "same_room.npz")
        self._wall_edges = _EdgeModel(config.weights / "same_wall.npz")
        self._rooms = RoomTracker()
        self._walls = WallTracker()

    def update(self, view: MapView) -> Proposals:
        """All rooms and walls of the map as it is now. Raises InputError for broken planes."""
        pieces = self._preprocess(view.planes)
        pairs, probability = self._room_edges(pieces)
        clusters = agglomerate(len(pieces), pairs, probability, self._config.clusters)
        rooms = self._find_rooms(pieces, clusters)
        walls = self._find_walls(pieces, clusters)
        return Proposals(self._rooms.update(rooms), self._walls.update(walls))

    def _find_rooms(self, pieces: Pieces, clusters: Sequence[Cluster]) -> list[RoomProposal]:
        found = []
        for cluster in clusters:
            sides = pieces.take(cluster.members)
            if not is_room(sides, self._config.clusters):
                continue
            polygon, centre = room_outline(sides)
            members = tuple(pieces.piece(int(place)) for place in cluster.members)
            found.append(RoomProposal(-1, members, polygon, centre, cluster.confidence))
        return found

    def _find_walls(self, pieces: Pieces, clusters: Sequence[Cluster]) -> list[WallProposal]:
        pairs, probability = self._wall_edges(pieces)
        found = walls_of(pieces, pairs, probability, clusters, self._config.clusters)
        return [
            WallProposal(-1, (pieces.piece(i), pieces.piece(j)), confidence)
            for i, j, confidence in found
        ]


class _EdgeModel:
    """One network with its features and its calibration."""

    def __init__(self, path: Path):
        self._model, self._temperature, features = _loaded(path)
        self._features = features_named(features)

    def __call__(self, pieces: Pieces) -> tuple[IntArray, Array]:
        """pairs (P, 2) and their probabilities (P,)."""
        from semantics.network import probabilities

        graph = proximity_graph(pieces, self._features)
        return graph.pairs, probabilities(self._model, self._temperature, graph)


@cache
def _loaded(path: Path) -> tuple[EdgeClassifier, float, str]:
    """Reading weights takes longer than an inference; they are the same for every run."""
    import torch

    from semantics.network import load

    torch.set_num_threads(1)  # graphs are small: more threads only get in each other's way
    model, checkpoint = load(path)
    return model, checkpoint.temperature, checkpoint.network.features
