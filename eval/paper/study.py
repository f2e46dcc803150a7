"""Which runs the tables need: the catalogue, fresh buildings, and what lies beyond the paper."""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from eval.comparing.ablation import Ablation, Result, Variant, evaluate, make_variant
from eval.config import RunConfig
from eval.files import write_text
from eval.paper.published import (
    BASELINES,
    CLAIMS,
    FIGURE_CLAIMS,
    GREEDY,
    HYDRA,
    HYDRA_TUNED,
    MMA_SCENES,
    NOT_PUBLISHED,
    OURS,
    REAL,
    ROOMS_ONLY,
    SGRAPHS,
    SGRAPHS_TUNED,
    SIMULATED,
    WITHOUT_PLANES,
    Claim,
)
from eval.sweep.engine import State, SweepConfig, sweep
from eval.sweep.job import Job, Row
from eval.sweep.store import read_rows
from worlds.conditions import CONDITIONS
from worlds.generator import GeneratorConfig, random_plan
from worlds.plan import Plan
from worlds.planfile import plan_text

INFORMATIVE = "Ours C, informative factors"
PLANES_ONLY = "Planes only"

DETECTORS = (
    make_variant(HYDRA, "hydra", "planes"),
    make_variant(HYDRA_TUNED, "hydra-tuned", "planes"),
    make_variant(SGRAPHS, "sgraphs", "rooms"),
    make_variant(SGRAPHS_TUNED, "sgraphs-tuned", "rooms"),
    make_variant(OURS, "gnn", "rooms+walls"),
    make_variant(GREEDY, "gnn-greedy", "rooms+walls"),
)
VARIANTS = (
    *DETECTORS,
    make_variant(ROOMS_ONLY, "gnn", "rooms"),
    make_variant(INFORMATIVE, "gnn", "rooms+walls", "informative"),
)
WITHOUT_ROOMS = make_variant(PLANES_ONLY, "none", "planes")
"""The graph alone."""

CAUSES = tuple(
    f"failures.{kind}_{cause}"
    for kind in ("missed", "false")
    for cause in ("unseen", "planes", "edges", "clustering")
)
ENTERED = "rooms.entered"
METRICS = (
    ENTERED,
    *("rooms.centre_precision", "rooms.centre_recall", "rooms.precision", "rooms.recall"),
    *("rooms.mean_iou", "rooms.piece_f1", "walls.precision", "walls.recall"),
    *("first_room_s", "room_latency_s.median", "room_latency_s.p95", "rooms.id_switches"),
    *("ate_m", "ate_odometry_m", "mma_m", "mma_floor_m", "plane_rmse_m"),
    *CAUSES,
)
BY_PIECES = ("rooms.precision", "rooms.recall")
CENTRE_RULE = ("rooms.centre_precision", "rooms.centre_recall")
COMPARED = tuple(
    dict.fromkeys([*(claim.metric for claim in (*FIGURE_CLAIMS, *CLAIMS)), *BY_PIECES])
)
OUR_CLAIMS = tuple(
    Claim(f"{what}, rooms and walls", metric, INFORMATIVE, PLANES_ONLY, scenes, NOT_PUBLISHED)
    for what, metric, scenes in (("ATE", "ate_m", SIMULATED), ("MMA", "mma_m", MMA_SCENES))
)
AGAINST_BASELINES = tuple((OURS, baseline) for baseline in BASELINES)
PAIRS = tuple(
    dict.fromkeys(
        [(claim.variant, claim.against) for claim in (*FIGURE_CLAIMS, *CLAIMS, *OUR_CLAIMS)]
        + [*AGAINST_BASELINES, (INFORMATIVE, SGRAPHS), (INFORMATIVE, ROOMS_ONLY)]
    )
)


def applies(variant: str, metric: str) -> bool:
    """Can a metric be told of a variant? Planes alone find nothing, Hydra's rooms have no pieces
    (the scores can tell that only from runs in which it finds some), and the baselines look for no
    walls and have no edges."""
    if variant == PLANES_ONLY:
        return not metric.startswith(("rooms.", "walls.", "failures.", "first_", "room_"))
    if variant in WITHOUT_PLANES and (metric in BY_PIECES or metric.endswith("_planes")):
        return False
    return variant not in BASELINES or not (
        metric.startswith("walls.") or metric.endswith("_edges")
    )


WORLDS = ("angled", "curved", "open-plan", "identical", "hotel", "ramp")
"""Not Manhattan, without walls between rooms, aliased, and on two storeys."""
CONDITION_SCENES = ("SC1F2", "SE2")
FRESH = 20
FRESH_CONFIG = GeneratorConfig(max_rooms=20)
FRESH_ROOMS = 4
"""A fresh building with fewer rooms is drawn again."""
QUICK_SCENES = ("SC1F1", "SE1", "SE3", "RC1F1", "RC2F2")
QUICK_S = 30.0
QUICK_FRESH = 4


@dataclass(frozen=True)
class Group:
    """Runs that are told of together. name: for the tables."""

    name: str
    ablation: Ablation


def _ablation(
    variants: Sequence[Variant], scenes: Sequence[str], seeds: Sequence[int], base: RunConfig
) -> Ablation:
    """With those pairs of which both are run."""
    names = {variant.name for variant in variants}
    pairs = tuple(pair for pair in PAIRS if set(pair) <= names)
    return Ablation(tuple(variants), pairs, tuple(scenes), tuple(seeds), METRICS, base)


def _detectors(scenes: Sequence[str], seeds: Sequence[int], base: RunConfig) -> Ablation:
    """Without the variants that differ in the graph alone."""
    return _ablation(DETECTORS, scenes, seeds, base)


def catalogue(seeds: Sequence[int], base: RunConfig, quick: bool) -> Group:
    """The paper's nine scenes."""
    scenes = QUICK_SCENES if quick else (*SIMULATED, *REAL)
    variants = (*VARIANTS, WITHOUT_ROOMS)
    return Group("the paper's scenes", _ablation(variants, scenes, seeds, base))


def fresh(files: Sequence[Path], base: RunConfig) -> Group:
    """Generated buildings, one drive each."""
    scenes = [str(path) for path in files]
    return Group("fresh buildings", _ablation(VARIANTS, scenes, (0,), base))


def beyond(seeds: Sequence[int], base: RunConfig, quick: bool) -> list[Group]:
    """Worlds of other kinds, and each condition on two scenes."""
    worlds = WORLDS[:2] if quick else WORLDS
    scenes = CONDITION_SCENES[-1:] if quick else CONDITION_SCENES
    names = ("as-built", "real-site") if quick else tuple(CONDITIONS)
    return [Group(f"World {name}", _detectors([name], seeds, base)) for name in worlds] + [
        Group(f"Condition {name}", _detectors(scenes, seeds, replace(base, conditions=name)))
        for name in names
    ]


def of_plans(plans: Sequence[str], seeds: Sequence[int], base: RunConfig) -> list[Group]:
    """Buildings of the user."""
    return [Group(f"Plan {Path(plan).stem}", _detectors([plan], seeds, base)) for plan in plans]


# --- fresh buildings ------------------------------------------------------------------------------


def fresh_seed(weights: Sequence[Path]) -> int:
    """The SHA-256 of the weights that ship, as a number: so the buildings are known only when the
    training is over."""
    digest = hashlib.sha256(b"".join(path.read_bytes() for path in weights))
    return int(digest.hexdigest(), 16)


def fresh_plans(seed: int, count: int = FRESH) -> list[Plan]:
    """Generated buildings that follow from a seed."""
    children = np.random.SeedSequence(seed).spawn(count)
    return [_fresh_plan(np.random.default_rng(child), i) for i, child in enumerate(children)]


def _fresh_plan(rng: np.random.Generator, place: int) -> Plan:
    while True:
        plan = random_plan(rng, FRESH_CONFIG)
        if len(plan.storeys[0].rooms) >= FRESH_ROOMS:
            return replace(plan, name=f"fresh-{place:02d}")


def write_plans(plans: Sequence[Plan], folder: Path) -> list[Path]:
    """Plan files of buildings; one that is there already is not touched."""
    folder.mkdir(parents=True, exist_ok=True)
    files = [folder / f"{plan.name}.json" for plan in plans]
    for plan, path in zip(plans, files, strict=True):
        text = plan_text(plan)
        if not path.exists() or path.read_text(encoding="utf-8") != text:
            write_text(path, text)
    return files


# --- what comes of it -----------------------------------------------------------------------------


def _telling(pairs: Sequence[tuple[str, str]], metric: str) -> list[tuple[str, str]]:
    """Those whose both variants have the metric."""
    return [pair for pair in pairs if all(applies(variant, metric) for variant in pair)]


@dataclass(frozen=True)
class Measured:
    """A group, run. rows: of its configurations."""

    group: Group
    rows: Mapping[RunConfig, Row]

    def result(
        self,
        scenes: Sequence[str] | None = None,
        pairs: Sequence[tuple[str, str]] = (),
        metrics: Sequence[str] = METRICS,
    ) -> Result:
        """Levels over all scenes, or over some; and comparisons of pairs, which take their time."""
        ablation = self.group.ablation
        ablation = replace(
            ablation,
            scenes=ablation.scenes if scenes is None else tuple(scenes),
            pairs=tuple(pairs),
            metrics=tuple(metrics),
        )
        return evaluate(ablation, [self.rows[config] for config in ablation.configs])

    def compared(
        self,
        scenes: Sequence[str] | None = None,
        pairs: Sequence[tuple[str, str]] | None = None,
        metrics: Sequence[str] = COMPARED,
    ) -> Result:
        """Pairs, all if None, in what the paper compares and in rooms by pieces: each pair in the
        metrics that apply to both."""
        wanted = self.group.ablation.pairs if pairs is None else pairs
        comparisons = [
            comparison
            for name in metrics
            for comparison in self.result(scenes, _telling(wanted, name), [name]).comparisons
        ]
        return replace(self.result(scenes, (), metrics), comparisons=tuple(comparisons))

    def of(self, scenes: Sequence[str]) -> tuple[str, ...]:
        """Those of some scenes that were run."""
        return tuple(scene for scene in scenes if scene in self.group.ablation.scenes)

    @property
    def errors(self) -> list[str]:
        """Of runs that failed."""
        return [row.error for row in self.rows.values() if row.error]


def measure(
    groups: Sequence[Group], settings: SweepConfig, watch: Callable[[State], None] | None = None
) -> list[Measured]:
    """Runs all groups in one sweep, the first seeds of all first. Raises InputError."""
    configs = [config for group in groups for config in group.ablation.configs]
    configs.sort(key=lambda config: config.seed)
    rows = dict(zip(configs, sweep(configs, settings, watch), strict=True))
    return [Measured(g, {c: rows[c] for c in g.ablation.configs}) for g in groups]


def already_measured(group: Group, folder: Path) -> Measured | None:
    """A group as earlier sweeps of the folder left it, with as many of its seeds as are whole; None
    without any."""
    ablation = group.ablation
    jobs = [Job(config) for config in ablation.configs]
    found = read_rows(folder, [job.key for job in jobs])
    missing = {job.config.seed for job in jobs if job.key not in found}
    seeds = tuple(seed for seed in ablation.seeds if seed not in missing)
    if not seeds:
        return None
    rows = {job.config: found[job.key] for job in jobs if job.config.seed in seeds}
    return Measured(replace(group, ablation=replace(ablation, seeds=seeds)), rows)
