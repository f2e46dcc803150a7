"""The baselines' parameters that suit a 16-beam sensor best, found on training buildings.

Starts from the published parameters and takes one after the other: the value that finds rooms best
in all training buildings together stays, and so on until nothing changes any more; and once more
from the tuned ones that ship, as the way there decides where it ends. What is best
goes by the F1 of precision and recall by the centre rule, by which the methods are compared, pooled
over the buildings. All buildings are the generator's, by their seeds, half of them furnished or
under construction (of ours in training: 60 %); those held out are scored alone.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Generic, TypeVar

from eval.score.rooms import ratio, score_rooms
from eval.studies.baseline_drives import Drive, drive_of, generated, hydra_rooms, sgraphs_rooms
from semantics.hydra.config import PUBLISHED_V2, HydraConfig
from semantics.hydra.config import TUNED as HYDRA_TUNED
from semantics.sgraphs.config import PUBLISHED, SgraphsConfig
from semantics.sgraphs.config import TUNED as SGRAPHS_TUNED
from slam.core import Proposals

METHODS = ("hydra", "sgraphs")
TRAINING = ((1, "as-built"), (3, "as-built"), (5, "office"), (21, "real-site"))
HELD_OUT = ((2, "as-built"), (8, "as-built"), (22, "office"), (23, "real-site"))
"""Seeds and conditions of buildings: 40 and 24 rooms."""

Axes = tuple[tuple[str, tuple[Any, ...]], ...]
"""Parameters, as ``part.field``, and what each may be."""

HYDRA_AXES: Axes = (
    ("space.places.compression", (0.35, 0.5, 0.75, 1.0, 1.5)),
    ("space.places.merge", (0.0, 0.1, 0.3, 0.5, 0.7)),
    ("space.places.merge_by_basis", (False, True)),
    ("space.places.min_edge", (0.2, 0.25, 0.4)),
    ("space.places.by_clearance", (False, True)),
    ("rooms.min_component", (1, 2, 3, 5, 7, 10)),
    ("rooms.min_room", (2, 3, 5, 7, 10)),
    ("rooms.min_dilation", (0.35, 0.43, 0.5, 0.6, 0.7)),
    ("rooms.max_dilation", (0.7, 0.8, 1.0, 1.2, 1.4)),
    ("rooms.repeated", (False, True)),
    ("rooms.plateau_ratio", (0.05, 0.1, 0.15, 0.25, 0.5, 0.7)),
    ("space.gvd.parents_cosine", (-0.2, 0.2, 0.5, 0.7)),
    ("space.gvd.parents_apart", (8, 12, 20)),
    ("space.tsdf.coarser", (1, 2)),
    ("rooms.version", (1, 2)),
)
SGRAPHS_AXES: Axes = (
    ("window", (1.5, 5.0, 20.0, 60.0)),
    ("clearance", (0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 1.0)),
    ("aligned", (20, 50, 100, 200, 500)),
    ("halves", (False, True)),
    ("vertices", (5, 10, 20)),
    ("near", (0.7, 1.0, 1.5)),
    ("votes", (2, 5, 10)),
    ("centre", (0.5, 1.0, 1.5, 2.5)),
    ("same_room", (1.0, 2.0, 3.0)),
)

Config = TypeVar("Config", HydraConfig, SgraphsConfig)


# --- what a configuration is worth ----------------------------------------------------------------


@dataclass(frozen=True)
class Tally:
    """Counted over buildings: detections that are true, all of them; true ones of rooms that were
    entered, and those rooms."""

    true: float = 0.0
    detected: float = 0.0
    recalled: float = 0.0
    entered: int = 0

    def __add__(self, other: Tally) -> Tally:
        return Tally(
            self.true + other.true,
            self.detected + other.detected,
            self.recalled + other.recalled,
            self.entered + other.entered,
        )

    @property
    def precision(self) -> float:
        """0 without a detection."""
        return ratio(self.true, self.detected) or 0.0

    @property
    def recall(self) -> float:
        """Of the rooms that were entered."""
        return ratio(self.recalled, self.entered) or 0.0

    @property
    def f1(self) -> float:
        """Harmonic mean of both."""
        return ratio(2 * self.precision * self.recall, self.precision + self.recall) or 0.0


def tally(drive: Drive, rooms: Proposals) -> Tally:
    """By the centre rule."""
    keeper = drive.keeper
    votes, _ = keeper.votes(drive.views[-1], rooms)
    entered = keeper.visits.entered
    score = score_rooms(
        *(votes, {}, keeper.truth, drive.T_world_map, entered.keys(), ()),
        storeys=keeper.visits.storeys,
    )
    recalled = (score.centre_recall or 0.0) * len(entered)
    true = (score.centre_precision or 0.0) * len(votes)
    return Tally(true, len(votes), recalled, len(entered))


# --- the search -----------------------------------------------------------------------------------


def changed(config: Config, path: str, value: Any) -> Config:
    """The configuration with one field, ``part.field``, set."""
    name, _, rest = path.partition(".")
    return replace(config, **{name: changed(getattr(config, name), rest, value) if rest else value})


def value_at(config: Any, path: str) -> Any:
    """The value of ``part.field``."""
    for name in path.split("."):
        config = getattr(config, name)
    return config


@dataclass(frozen=True)
class Trial(Generic[Config]):
    """A configuration, what was changed last, and what it is worth."""

    change: str
    config: Config
    worth: Tally


def search(start: Config, axes: Axes, worth: Callable[[Config], Tally]) -> Iterator[Trial[Config]]:
    """Everything that improves, in turn, from the start on. A value that is only as good as the one
    before does not replace it."""
    best = Trial("start", start, worth(start))
    yield best
    while True:
        before = best
        for path, values in axes:
            others = [value for value in values if value != value_at(best.config, path)]
            trials = [
                Trial(f"{path} = {value}", config, worth(config))
                for value in others
                for config in [changed(best.config, path, value)]
            ]
            found = max(trials, key=lambda trial: trial.worth.f1)
            if found.worth.f1 > best.worth.f1:
                best = found
                yield best
        if best is before:
            return


Rooms = Callable[[Drive, Config], Proposals]


def over(drives: Sequence[Drive], rooms: Rooms[Config], config: Config) -> Tally:
    """What a configuration is worth on buildings together."""
    return sum((tally(drive, rooms(drive, config)) for drive in drives), Tally())


def report(
    name: str,
    trials: Iterator[Trial[Config]],
    check: Callable[[Config], Tally],
) -> Iterator[str]:
    """Lines of a Markdown table, as the search goes on."""
    yield f"| {name} | precision | recall | F1 | held out: precision | recall | F1 |\n"
    yield "|---|---|---|---|---|---|---|\n"
    for trial in trials:
        numbers = [
            f"{value:.3f}"
            for worth in (trial.worth, check(trial.config))
            for value in (worth.precision, worth.recall, worth.f1)
        ]
        yield f"| {trial.change} | {' | '.join(numbers)} |\n"


def searches(methods: Sequence[str], cache: Path) -> Iterator[str]:
    """Lines of both tables, as the searches go on. methods: of METHODS; cache: where the drives
    through the buildings are kept, which take longest."""
    train, held_out = (
        [drive_of(generated(seed, cache), conditions, cache) for seed, conditions in buildings]
        for buildings in (TRAINING, HELD_OUT)
    )
    if "hydra" in methods:
        starts = {"published": PUBLISHED_V2, "tuned": HYDRA_TUNED}
        yield from _lines("Hydra", starts, HYDRA_AXES, hydra_rooms, train, held_out)
    if "sgraphs" in methods:
        known = {"published": PUBLISHED, "tuned": SGRAPHS_TUNED}
        yield from _lines("S-Graphs+", known, SGRAPHS_AXES, sgraphs_rooms, train, held_out)


def _lines(
    name: str,
    starts: Mapping[str, Config],
    axes: Axes,
    rooms: Rooms[Config],
    train: Sequence[Drive],
    held_out: Sequence[Drive],
) -> Iterator[str]:
    for start, config in starts.items():
        trials = search(config, axes, lambda config: over(train, rooms, config))
        yield from report(
            f"{name}, from {start}", trials, lambda config: over(held_out, rooms, config)
        )
