"""What each choice of the learned detector is worth, on buildings that no network was trained on.

Features, networks, training set and clustering, each the paper's or ours, in every combination.
"""

from __future__ import annotations

import csv
from collections.abc import Mapping, Sequence
from dataclasses import astuple, dataclass, fields, replace
from itertools import product
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

from eval.files import whole_file
from semantics.dataset import SAME_ROOM, SAME_WALL, DatasetConfig, Sample, buildings, labels_of
from semantics.detector import CYCLES, LINKAGE, Clustering, DetectorConfig
from semantics.edges import EdgeModel, Edges
from semantics.layouts import LayoutConfig
from semantics.train import (
    RELATIONS,
    Progress,
    TrainConfig,
    draw,
    score_relation,
    train_on,
)
from semantics.walls import walls_of
from slam.core import IntArray
from worlds.plan import Plan

BARE = (("as-built", 1.0),)
FAMILIES = {
    "right-angled": DatasetConfig(layouts=40, conditions=BARE, generator=buildings(shear=0.0)),
    "sheared": DatasetConfig(layouts=40, conditions=BARE, generator=buildings(shear=1.0)),
    "fanned": DatasetConfig(
        layouts=40,
        conditions=BARE,
        generator=replace(buildings(shear=0.0), taper=1.0, tapered=30.0),
    ),
    "furnished": DatasetConfig(
        layouts=40,
        conditions=(("furniture", 1.0), ("office", 1.0), ("real-site", 1.0)),
        generator=buildings(shear=0.0),
    ),
}
"""Buildings to test on. No network is trained on fanned ones, whose walls run apart by up to 30
degrees; the study's are not on sheared ones either."""
TEST_SEED = 1_000_003
"""Far from any seed that somebody trains with."""
VIEWS = 10
"""Of each plan that is not drawn at random."""


@dataclass(frozen=True)
class Result:
    """Precision and recall of edges, where a relation is likelier than not; of rooms and walls as
    the detector gives them; and the calibration errors of both relations."""

    room_edge_precision: float
    room_edge_recall: float
    wall_edge_precision: float
    wall_edge_recall: float
    room_precision: float
    room_recall: float
    wall_precision: float
    wall_recall: float
    room_calibration: float
    wall_calibration: float


@dataclass(frozen=True)
class Row:
    """One combination on one family of buildings."""

    features: str
    networks: str
    training_set: str
    clustering: str
    family: str
    result: Result


@dataclass
class _Tally:
    """Right ones, those found, and those to be found."""

    right: int = 0
    found: int = 0
    wanted: int = 0

    def add(self, right: int, found: int, wanted: int) -> None:
        self.right += right
        self.found += found
        self.wanted += wanted

    @property
    def precision(self) -> float:
        return self.right / max(self.found, 1)

    @property
    def recall(self) -> float:
        return self.right / max(self.wanted, 1)


def held_out(processes: int) -> dict[str, list[Sample]]:
    """Samples of every family, the same each time."""
    return {
        name: [s for building in draw(family, TEST_SEED, processes) for s in building]
        for name, family in FAMILIES.items()
    }


def on_plans(plans: Mapping[str, Plan]) -> dict[str, list[Sample]]:
    """Samples of plans by their names, bare and as built: what of their true faces is seen on some
    walks, with the noise of mapped planes; the same each time."""
    built = replace(FAMILIES["right-angled"], views=VIEWS)
    seed = np.random.SeedSequence(TEST_SEED)
    return {
        name: built.views_of(plan, seed, np.random.default_rng(seed))
        for name, plan in plans.items()
    }


def judge(config: DetectorConfig, drawn: Sequence[Sample]) -> Result:
    """What a detector makes of samples, each by itself."""
    model = EdgeModel(config.weights)
    told = [model(sample.pieces) for sample in drawn]
    labels = np.concatenate(
        [labels_of(sample, edges.pairs) for sample, edges in zip(drawn, told, strict=True)]
    )
    room = score_relation(np.concatenate([e.room for e in told]), labels == SAME_ROOM)
    wall = score_relation(np.concatenate([e.wall for e in told]), labels == SAME_WALL)
    rooms, walls = _concepts(config, drawn, told)
    return Result(
        room.precision,
        room.recall,
        wall.precision,
        wall.recall,
        rooms.precision,
        rooms.recall,
        walls.precision,
        walls.recall,
        room.calibration,
        wall.calibration,
    )


def _concepts(
    config: DetectorConfig, drawn: Sequence[Sample], told: Sequence[Edges]
) -> tuple[_Tally, _Tally]:
    """Rooms and walls that follow from edges."""
    rooms, walls = _Tally(), _Tally()
    for sample, edges in zip(drawn, told, strict=True):
        group = config.clustering.group(
            len(sample.pieces), edges.pairs, edges.room, config.clusters
        )
        rooms.add(*_rooms(sample, group.groups(), config))
        chosen = walls_of(sample.pieces, edges.pairs, edges.wall, group.label, config.walls)
        walls.add(*_walls(sample, edges.pairs[chosen]))
    return rooms, walls


THRESHOLDS = (0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9)


@dataclass(frozen=True)
class Operating:
    """Precision and recall of rooms and of walls, where both thresholds are this."""

    threshold: float
    room_precision: float
    room_recall: float
    wall_precision: float
    wall_recall: float


def sweep(config: DetectorConfig, drawn: Sequence[Sample]) -> list[Operating]:
    """What each threshold is worth: the shipped ones have the largest F1 over all families but the
    fanned one."""
    model = EdgeModel(config.weights)
    told = [model(sample.pieces) for sample in drawn]
    found = []
    for threshold in THRESHOLDS:
        clusters = replace(config.clusters, room=threshold)
        walls = replace(config.walls, wall=threshold)
        tried = replace(config, clusters=clusters, walls=walls)
        of_rooms, of_walls = _concepts(tried, drawn, told)
        found.append(
            Operating(
                threshold, of_rooms.precision, of_rooms.recall, of_walls.precision, of_walls.recall
            )
        )
    return found


def _rooms(
    sample: Sample, groups: Sequence[IntArray], config: DetectorConfig
) -> tuple[int, int, int]:
    """Rooms right, found, and to be found: whose own pieces, as far as seen, make a room.

    Right: most of a room's pieces are of one true room, and it has half of that one's length.
    """
    length, holds = sample.pieces.length, LINKAGE.holds
    wanted = {
        room
        for room in np.unique(sample.room[sample.room >= 0]).tolist()
        if holds(sample.pieces.take(sample.room == room), config.clusters)
    }
    right, found = set(), 0
    for group in groups:
        if not config.clustering.holds(sample.pieces.take(group), config.clusters):
            continue
        found += 1
        names, count = np.unique(sample.room[group], return_counts=True)
        owner = int(names[count.argmax()])
        inside = sample.room == owner
        mine = np.isin(np.arange(len(length)), group)
        most = 2 * count.max() > len(group)
        if owner >= 0 and most and 2 * length[inside & mine].sum() >= length[inside].sum():
            right.add(owner)
    return len(right), found, len(wanted | right)


def _walls(sample: Sample, pairs: IntArray) -> tuple[int, int, int]:
    """Walls right, found, and to be found: of which both faces have a piece."""
    true = {frozenset(wall) for wall in sample.walls.tolist()}
    seen = set(sample.face[sample.face >= 0].tolist())
    right = {frozenset(pair) for pair in sample.face[pairs].tolist()} & true
    return len(right), len(pairs), sum(wall <= seen for wall in true)


@dataclass(frozen=True)
class StudyConfig:
    """layouts, epochs: of every training, fewer than of what ships; seed: of the training sets."""

    layouts: int = 200
    epochs: int = 8
    seed: int = 0
    processes: int = 2


FEATURES = ("paper", "invariant")
NETWORKS = {"two": tuple((r, (r,)) for r in RELATIONS), "one": (("both", RELATIONS),)}
CLUSTERINGS: dict[str, Clustering] = {"cycles": CYCLES, "linkage": LINKAGE}


def study(config: StudyConfig, report: Progress) -> list[Row]:
    """Every combination of features, networks, training set and clustering on every family.

    The training sets are of right-angled buildings only: the sheared ones stay unknown.
    """
    ours = DatasetConfig(layouts=config.layouts, generator=buildings(shear=0.0))
    sets = {
        "paper": draw(LayoutConfig(layouts=4 * config.layouts), config.seed, config.processes),
        "ours": draw(ours, config.seed, config.processes),
    }
    report("training sets", 0.2)
    tests = held_out(config.processes)
    rows: list[Row] = []
    runs = list(product(FEATURES, NETWORKS, sets))
    for number, (features, networks, name) in enumerate(runs):
        with TemporaryDirectory() as folder:
            base = TrainConfig(
                networks=NETWORKS[networks],
                features=features,
                seed=config.seed,
                epochs=config.epochs,
                folder=Path(folder),
            )
            files = train_on(base, sets[name], lambda *_: None).files
            for clustering, family in product(CLUSTERINGS, tests):
                detector = DetectorConfig(weights=files, clustering=CLUSTERINGS[clustering])
                result = judge(detector, tests[family])
                rows.append(Row(features, networks, name, clustering, family, result))
        report(f"{features} features", 0.2 + 0.8 * (number + 1) / len(runs))
    return rows


def write_study(rows: Sequence[Row], path: Path) -> Path:
    """The table as a CSV file."""
    with whole_file(path) as part, part.open("w", newline="", encoding="utf-8") as stream:
        table = csv.writer(stream)
        names = [f.name for f in fields(Row)][:-1] + [f.name for f in fields(Result)]
        table.writerow(names)
        for row in rows:
            choice = astuple(replace(row, result=None))[:-1]  # type: ignore[arg-type]
            table.writerow([*choice, *(f"{value:.4f}" for value in astuple(row.result))])
    return path
