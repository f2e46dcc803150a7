"""metrics.json as a tree of dataclasses: its keys are these fields, in this order.

SI units unless the key says otherwise. What does not apply is None, written as null; so is what is
not a finite number, since JSON has no NaN.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from eval.score.consistency import Consistency
from eval.score.failures import Failures
from eval.score.scores import Scores
from slam.core import Array

SCHEMA = "roomloop-1"


@dataclass(frozen=True)
class StageTime:
    """Wall time of one stage: per call, and in all."""

    median_ms: float | None
    p95_ms: float | None
    total_s: float | None

    @staticmethod
    def of(seconds: Sequence[float] | Array) -> StageTime:
        """From the durations of all calls [s]."""
        ms = 1000.0 * np.asarray(seconds, dtype=np.float64)
        if len(ms) == 0:
            return StageTime(None, None, None)
        median, p95 = np.percentile(ms, [50.0, 95.0])
        return StageTime(float(median), float(p95), float(ms.sum() / 1000.0))


NO_TIME = StageTime(None, None, None)


@dataclass(frozen=True)
class Stages:
    """Where the time went.

    A call of lidar and of odometry is a scan: until it is there, simulated or read; registration,
    also where another process does it ahead, and refinement against the planes seen lately.
    A call of planes is a keyframe of the front end. A call of semantics and of graph is a keyframe
    that the back end keeps: the detector; and, around that, matching, factors, solving and taking
    in what the detector says. What is spent on matching a keyframe that is not kept is of no stage:
    as a call of graph it would pass for a quick update.
    """

    lidar: StageTime = NO_TIME
    odometry: StageTime = NO_TIME
    planes: StageTime = NO_TIME
    semantics: StageTime = NO_TIME
    graph: StageTime = NO_TIME


@dataclass(frozen=True)
class Planes:
    """See ``score.planes.PlaneScore``."""

    mapped: int | None = None
    mixed: int | None = None
    duplicates: int | None = None
    faces_seen: int | None = None


@dataclass(frozen=True)
class Rooms:
    """See ``score.rooms.RoomScore`` and, for the last two, ``score.latency.TimeScore``."""

    truth: int | None = None
    entered: int | None = None
    detected: float | None = None
    true_positive: float | None = None
    precision: float | None = None
    recall: float | None = None
    centre_precision: float | None = None
    centre_recall: float | None = None
    mean_iou: float | None = None
    piece_f1: float | None = None
    over_segmented: int | None = None
    under_segmented: int | None = None
    retracted_true: int | None = None
    id_switches: int | None = None


@dataclass(frozen=True)
class Walls:
    """See ``score.walls.WallScore``."""

    truth: int | None = None
    detected: int | None = None
    true_positive: int | None = None
    precision: float | None = None
    recall: float | None = None


@dataclass(frozen=True)
class Loops:
    """Loop closures against the truth."""

    true: int | None = None
    false: int | None = None
    missed: int | None = None


@dataclass(frozen=True)
class Latency:
    """From entering a room to its being found, over rooms [s]."""

    median: float | None = None
    p95: float | None = None


@dataclass(frozen=True)
class RunFacts:
    """What a run knows of itself, beside its scores.

    status: complete | cut_off | failed; error: one line where it failed; scans_skipped: bad ones of
    a recording, and sweeps without a return; wall_s: of the loop alone; startup_s: before it;
    versions: package -> version; sensor, conditions: None of a recording.
    """

    status: str
    scene: str
    scene_sha256: str
    seed: int
    sensor: str | None
    conditions: str | None
    detector: str
    layers: str
    factors: str
    odometry: str
    versions: Mapping[str, str] = field(default_factory=dict)
    error: str | None = None
    simulated_s: float | None = None
    scans_skipped: int | None = None
    startup_s: float | None = None
    wall_s: float | None = None
    loops: Loops = Loops()
    consistency: Consistency = Consistency()
    stages: Stages = Stages()
    peak_rss_mb: float | None = None


@dataclass(frozen=True)
class Metrics:
    """metrics.json, whole. T_world_map: (4, 4) as nested tuples.

    There are two sets of keyframes: the front end's, of which planes are extracted, and those among
    them that the back end keeps. ate_keyframes_m is over the front end's; ``consistency`` and
    graph.json have the kept ones. ate_m, ate_online_m and ate_odometry_m are over all scans.
    """

    schema: str
    status: str
    error: str | None
    scene: str
    scene_sha256: str
    seed: int
    sensor: str | None
    conditions: str | None
    detector: str
    layers: str
    factors: str
    odometry: str
    versions: Mapping[str, str]
    simulated_s: float | None
    scans_skipped: int | None
    startup_s: float | None
    wall_s: float | None
    real_time_factor: float | None
    path_m: float | None
    T_world_map: tuple[tuple[float, ...], ...] | None
    ate_m: float | None
    ate_keyframes_m: float | None
    ate_online_m: float | None
    ate_origin_m: float | None
    ate_xy_m: float | None
    ate_z_m: float | None
    yaw_deg: float | None
    rpe_percent: float | None
    ate_odometry_m: float | None
    ate_odometry_xy_m: float | None
    rpe_odometry_percent: float | None
    mma_m: float | None
    mma_face_m: float | None
    mma_floor_m: float | None
    plane_rmse_m: float | None
    map_completeness: float | None
    planes: Planes
    rooms: Rooms
    walls: Walls
    failures: Failures
    loops: Loops
    consistency: Consistency
    first_room_s: float | None
    room_latency_s: Latency
    stages: Stages
    peak_rss_mb: float | None


def assemble(facts: RunFacts, scores: Scores) -> Metrics:
    """The metrics of a run from what it knows of itself and its scores."""
    estimate, odometry, planes = scores.estimate, scores.odometry, scores.planes
    rooms, walls, time, points = scores.rooms, scores.walls, scores.time, scores.map
    T = estimate.T_truth_estimate
    return Metrics(
        schema=SCHEMA,
        status=facts.status,
        error=facts.error,
        scene=facts.scene,
        scene_sha256=facts.scene_sha256,
        seed=facts.seed,
        sensor=facts.sensor,
        conditions=facts.conditions,
        detector=facts.detector,
        layers=facts.layers,
        factors=facts.factors,
        odometry=facts.odometry,
        versions=dict(facts.versions),
        simulated_s=facts.simulated_s,
        scans_skipped=facts.scans_skipped,
        startup_s=facts.startup_s,
        wall_s=facts.wall_s,
        real_time_factor=_real_time_factor(facts),
        path_m=scores.path_m,
        T_world_map=None if T is None else tuple(tuple(float(x) for x in row) for row in T),
        ate_m=estimate.ate,
        ate_keyframes_m=scores.ate_keyframes,
        ate_online_m=None if scores.online is None else scores.online.ate,
        ate_origin_m=estimate.ate_origin,
        ate_xy_m=estimate.ate_xy,
        ate_z_m=estimate.ate_z,
        yaw_deg=estimate.yaw_deg,
        rpe_percent=estimate.rpe_percent,
        ate_odometry_m=odometry.ate,
        ate_odometry_xy_m=odometry.ate_xy,
        rpe_odometry_percent=odometry.rpe_percent,
        mma_m=points.mma,
        mma_face_m=points.mma_face,
        mma_floor_m=points.mma_floor,
        plane_rmse_m=planes.plane_rmse,
        map_completeness=planes.completeness,
        planes=Planes(planes.mapped, planes.mixed, planes.duplicates, planes.faces_seen),
        rooms=Rooms(
            truth=rooms.truth,
            entered=rooms.entered,
            detected=rooms.detected,
            true_positive=rooms.true_positive,
            precision=rooms.precision,
            recall=rooms.recall,
            centre_precision=rooms.centre_precision,
            centre_recall=rooms.centre_recall,
            mean_iou=rooms.mean_iou,
            piece_f1=rooms.piece_f1,
            over_segmented=rooms.over_segmented,
            under_segmented=rooms.under_segmented,
            retracted_true=time.retracted_true,
            id_switches=time.id_switches,
        ),
        walls=Walls(
            walls.truth, walls.detected, walls.true_positive, walls.precision, walls.recall
        ),
        failures=scores.failures,
        loops=facts.loops,
        consistency=facts.consistency,
        first_room_s=time.first_room_s,
        room_latency_s=Latency(time.latency_median_s, time.latency_p95_s),
        stages=facts.stages,
        peak_rss_mb=facts.peak_rss_mb,
    )


def _real_time_factor(facts: RunFacts) -> float | None:
    if facts.simulated_s is None or not facts.wall_s:
        return None
    return facts.simulated_s / facts.wall_s
