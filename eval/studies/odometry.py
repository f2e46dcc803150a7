"""The odometry study: odometries alone, side by side on the same drives."""

from __future__ import annotations

import itertools
import json
import re
import time
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np

from eval.artefact import code_hash
from eval.files import whole_file
from eval.score.trajectory import Trajectory, score_trajectory
from sim.base import BaseConfig
from sim.drive import Drive
from sim.route import plan_route
from sim.sensorfile import sensor_named
from slam.core import Array, InputError, Odometry, RunError, Scan
from slam.odometry import MotionLimits, Stamped, check_motion
from worlds.catalogue import load_scene
from worlds.conditions import conditions_named
from worlds.generator import random_plan
from worlds.plan import Plan
from worlds.world import build_world

Factory = Callable[[], Odometry]

GENERATED = re.compile(r"generated-(\d+)")
"""Names a random building by its seed; presets are chosen on these, never on the catalogue."""


CODE = ("worlds", "sim", "slam.core", "slam.odometry", "slam.kiss", "slam.vgicp")
"""What rows depend on."""


@dataclass(frozen=True)
class StudyCase:
    """One drive. scene: of the catalogue, a file, or ``generated-N``; speed [m/s] and turn_rate
    [rad/s]: limits of the base; duration [s], None: the whole route."""

    scene: str
    seed: int = 0
    sensor: str = "vlp16"
    speed: float = BaseConfig.speed
    turn_rate: float = BaseConfig.turn_rate
    duration: float | None = None


@dataclass(frozen=True)
class StudyRow:
    """What one odometry made of one drive.

    ate, ate_xy, ate_z [m]: of the aligned positions, None where a path cannot be aligned; yaw_deg:
    RMSE of the heading; rpe_percent: per metre; path_m: driven; ms: median processor time of a
    scan; diverged_s: when it lost track, None if it did not (the scores are up to there).
    """

    case: StudyCase
    odometry: str
    ate: float | None
    ate_xy: float | None
    ate_z: float | None
    yaw_deg: float | None
    rpe_percent: float | None
    path_m: float
    ms: float
    diverged_s: float | None


@dataclass
class _Record:
    """One odometry on its way through a drive. It is alone: no planes catch its jumps, so what no
    base can do counts as lost here."""

    odometry: Odometry
    poses: list[Array]
    seconds: list[float]
    last: Stamped | None = None
    diverged_s: float | None = None

    def take(self, scan: Scan) -> None:
        if self.diverged_s is not None:
            return
        started = time.process_time()
        try:
            now = scan.stamp, self.odometry.register(scan)
            check_motion(self.last, now, MotionLimits())
        except RunError:
            self.diverged_s = scan.stamp
        else:
            self.last = now
            self.poses.append(now[1])
        self.seconds.append(time.process_time() - started)


def cases(
    scenes: Sequence[str],
    seeds: Sequence[int],
    sensors: Sequence[str],
    speeds: Sequence[float],
    turn_rates: Sequence[float],
    duration: float | None = None,
) -> list[StudyCase]:
    """Every combination of what is given."""
    grid = itertools.product(scenes, seeds, sensors, speeds, turn_rates)
    return [StudyCase(*values, duration) for values in grid]


def study(case: StudyCase, odometries: Mapping[str, Factory]) -> list[StudyRow]:
    """A row for each odometry; all of them are given the same scans. Raises InputError for a case
    that cannot be driven, and RunError if the base touches a wall."""
    records = {name: _Record(make(), [], []) for name, make in odometries.items()}
    stamps, truth = [], []
    for scan, scan_truth in drive(case):
        stamps.append(scan.stamp)
        truth.append(scan_truth.T_world_base)
        for record in records.values():
            record.take(scan)
    whole = Trajectory(np.array(stamps), np.array(truth).reshape(-1, 4, 4))
    return [_row(case, name, record, whole) for name, record in records.items()]


def drive(case: StudyCase) -> Drive:
    """The drive of a case: as-built world and seeds as in a run."""
    world_seed, drive_seed = np.random.SeedSequence(case.seed).spawn(2)
    world = build_world(_plan(case.scene), world_seed, conditions_named("as-built"), 0)
    return Drive(
        world,
        sensor_named(case.sensor),
        plan_route(world),
        case.speed,
        drive_seed,
        case.duration,
        BaseConfig(turn_rate=case.turn_rate),
    )


def _plan(scene: str) -> Plan:
    generated = GENERATED.fullmatch(scene)
    if generated is None:
        return load_scene(scene)
    return random_plan(np.random.default_rng(int(generated.group(1))))


class StudyFile:
    """The rows of a study, kept as JSON: one that was stopped goes on where it was.

    path: None keeps nothing. Raises InputError for a file that is no study, or of other code.
    """

    def __init__(self, path: Path | None) -> None:
        self._path = path
        self._code = " ".join(code_hash(module)[:8] for module in CODE)
        self.rows: list[StudyRow] = []
        if path is not None and path.exists():
            self.rows = self._read(path)

    def _read(self, path: Path) -> list[StudyRow]:
        try:
            kept = json.loads(path.read_text())
            code = kept["code"]
            rows = [StudyRow(**{**row, "case": StudyCase(**row["case"])}) for row in kept["rows"]]
        except (OSError, ValueError, KeyError, TypeError) as error:
            raise InputError(f"{path}: no rows of `bench odometry`: {error}") from error
        if code != self._code:
            raise InputError(f"{path}: rows of other code than this; delete it or name another")
        return rows

    def missing(self, case: StudyCase, names: Iterable[str]) -> list[str]:
        """The odometries that have no row for a case yet."""
        known = {row.odometry for row in self.rows if row.case == case}
        return [name for name in names if name not in known]

    def add(self, rows: Sequence[StudyRow]) -> None:
        """Keeps more rows, at once on disk."""
        self.rows += rows
        if self._path is not None:
            whole = {"code": self._code, "rows": [asdict(row) for row in self.rows]}
            with whole_file(self._path) as part:
                part.write_text(json.dumps(whole, indent=1) + "\n")


def _row(case: StudyCase, name: str, record: _Record, whole: Trajectory) -> StudyRow:
    n = len(record.poses)
    truth = Trajectory(whole.stamps[:n], whole.poses[:n])
    score = score_trajectory(Trajectory(truth.stamps, np.array(record.poses)), truth)
    return StudyRow(
        case=case,
        odometry=name,
        ate=score.ate,
        ate_xy=score.ate_xy,
        ate_z=score.ate_z,
        yaw_deg=score.yaw_deg,
        rpe_percent=score.rpe_percent,
        path_m=truth.path_m,
        ms=1e3 * float(np.median(record.seconds)),
        diverged_s=record.diverged_s,
    )


@dataclass(frozen=True)
class StudySummary:
    """One odometry over many drives: mean and worst ATE [m] of those on which it held, how many
    drives there were, how many it lost, and its median milliseconds a scan."""

    odometry: str
    mean: float | None
    worst: float | None
    drives: int
    diverged: int
    ms: float


def summaries(rows: Sequence[StudyRow]) -> Iterator[StudySummary]:
    """One for each odometry, in the order in which they appear."""
    for name in dict.fromkeys(row.odometry for row in rows):
        mine = [row for row in rows if row.odometry == name]
        held = [row.ate for row in mine if row.diverged_s is None and row.ate is not None]
        yield StudySummary(
            odometry=name,
            mean=float(np.mean(held)) if held else None,
            worst=max(held, default=None),
            drives=len(mine),
            diverged=sum(row.diverged_s is not None for row in mine),
            ms=float(np.median([row.ms for row in mine])),
        )
