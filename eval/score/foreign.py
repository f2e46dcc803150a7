"""Somebody else's trajectory, map and rooms against a scene's truth, with the metrics of a run."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass, fields, replace

import numpy as np
from numpy.typing import NDArray

from eval.config import RunConfig
from eval.foreign import ForeignRoom
from eval.metrics import SCHEMA, Latency, Loops, Metrics, Planes, Rooms, Stages, Walls
from eval.names import refuse
from eval.pointfile import thinned
from eval.score.consistency import Consistency
from eval.score.failures import Failures
from eval.score.map import VOXEL, SurfaceDistance
from eval.score.rooms import RoomScore, score_rooms
from eval.score.trajectory import Trajectory, TrajectoryScore, rms, score_trajectory
from eval.score.votes import RoomVote, inner_point
from eval.seen import RoomVisits
from eval.source import make_world
from slam.core import Array, RoomProposal, inverse, transform_points
from worlds.catalogue import scene_sha256
from worlds.truth import Truth
from worlds.world import World

MAX_GAP = 0.5
"""Truth is interpolated between poses at most so far apart [s]."""
BY = "foreign"
"""What the metrics call the detector, the layers and so on of another system."""


@dataclass(frozen=True)
class Foreign:
    """What there is of another system's run: estimate in any frame, base poses; points (N, 3) and
    rooms in that same frame, or in the scene's own where there is no estimate."""

    estimate: Trajectory | None = None
    points: Array | None = None
    rooms: tuple[ForeignRoom, ...] | None = None


def score_foreign(config: RunConfig, truth: Trajectory | None, foreign: Foreign) -> Metrics:
    """The metrics that apply; the others are None.

    config: says which world; truth: its true base poses, which an estimate needs. Without them
    every room of the storey counts as entered. Raises InputError.
    """
    world = make_world(config)
    metrics = _nothing(config, config.conditions or world.plan.conditions)
    T_world_map: Array = np.eye(4)
    if foreign.estimate is not None:
        metrics, T_world_map = _with_trajectory(metrics, foreign.estimate, truth)
    if foreign.points is not None:
        metrics = replace(metrics, mma_m=_mma(world, foreign.points, T_world_map))
    if foreign.rooms is not None:
        storey = config.storey or 0
        entered, storeys = _entered(world.truth, truth, storey)
        score = _score_rooms(foreign.rooms, world.truth, T_world_map, entered, storeys)
        metrics = replace(metrics, rooms=_rooms(score))
    return metrics


def _nothing(config: RunConfig, conditions: str) -> Metrics:
    """Metrics of which nothing is scored yet."""
    values: dict[str, object] = {item.name: None for item in fields(Metrics)}
    values |= {"planes": Planes(), "rooms": Rooms(), "walls": Walls(), "loops": Loops()}
    values |= {"failures": Failures(), "consistency": Consistency()}
    values |= {"room_latency_s": Latency(), "stages": Stages(), "versions": {}}
    values |= {"schema": SCHEMA, "status": "complete", "scene": config.scene, "seed": config.seed}
    values |= {"scene_sha256": scene_sha256(config.scene), "sensor": config.sensor}
    values |= {"conditions": conditions}
    values |= dict.fromkeys(("detector", "layers", "factors", "odometry"), BY)
    return Metrics(**values)  # type: ignore[arg-type]


# --- trajectory -----------------------------------------------------------------------------------


def _with_trajectory(
    metrics: Metrics, estimate: Trajectory, truth: Trajectory | None
) -> tuple[Metrics, Array]:
    if truth is None:
        refuse("trajectory: expected true poses to score it against: a run's folder, or --truth")
    kept, sampled = at_stamps(truth, estimate.stamps)
    score = score_trajectory(Trajectory(estimate.stamps[kept], estimate.poses[kept]), sampled)
    T = score.T_truth_estimate
    if T is None:
        refuse(
            f"trajectory: {kept.sum()} of its {len(estimate)} poses have a true one; three or "
            "more that do not lie on a line were expected, to align them"
        )
    return _scored(metrics, score, T, truth), T


def _scored(metrics: Metrics, score: TrajectoryScore, T: Array, truth: Trajectory) -> Metrics:
    return replace(
        metrics,
        path_m=truth.path_m,
        simulated_s=float(truth.stamps[-1]),
        T_world_map=tuple(tuple(float(x) for x in row) for row in T),
        ate_m=score.ate,
        ate_origin_m=score.ate_origin,
        ate_xy_m=score.ate_xy,
        ate_z_m=score.ate_z,
        yaw_deg=score.yaw_deg,
        rpe_percent=score.rpe_percent,
    )


def at_stamps(truth: Trajectory, stamps: Array) -> tuple[NDArray[np.bool_], Trajectory]:
    """Which of the stamps (N,) the truth can be interpolated at, and the truth there.

    Raises InputError, with both spans, if there is none.
    """
    from scipy.spatial.transform import Rotation, Slerp

    after = np.clip(np.searchsorted(truth.stamps, stamps), 1, max(len(truth) - 1, 1))
    good = np.zeros(len(stamps), dtype=bool)
    if len(truth) > 1 and len(stamps):
        inside = (stamps >= truth.stamps[0] - 1e-6) & (stamps <= truth.stamps[-1] + 1e-6)
        good = inside & (truth.stamps[after] - truth.stamps[after - 1] <= MAX_GAP)
    if not good.any():
        refuse(
            f"trajectory: no stamp of its {len(stamps)} ({_span(stamps)}) lies within the true "
            f"ones ({_span(truth.stamps)})"
        )
    wanted = np.clip(stamps[good], truth.stamps[0], truth.stamps[-1])
    poses = np.tile(np.eye(4), (len(wanted), 1, 1))
    turns = Rotation.from_matrix(truth.poses[:, :3, :3])
    poses[:, :3, :3] = Slerp(truth.stamps, turns)(wanted).as_matrix()
    for axis in range(3):
        poses[:, axis, 3] = np.interp(wanted, truth.stamps, truth.positions[:, axis])
    return good, Trajectory(stamps[good], poses)


def _span(stamps: Array) -> str:
    return f"{stamps[0]:.2f} to {stamps[-1]:.2f} s" if len(stamps) else "none"


def base_poses(lidar: Trajectory, T_base_lidar: Array) -> Trajectory:
    """The base's poses of the LiDAR's."""
    return Trajectory(lidar.stamps, lidar.poses @ inverse(T_base_lidar))


# --- map and rooms --------------------------------------------------------------------------------


def _mma(world: World, points: Array, T_world_map: Array) -> float | None:
    """RMSE of points to the nearest true surface, thinned as the maps of runs are."""
    mesh = world.mesh
    surface = SurfaceDistance(mesh.vertices, mesh.triangles, mesh.face)
    return rms(surface(transform_points(T_world_map, thinned(points, VOXEL))))


def _entered(
    truth: Truth, poses: Trajectory | None, storey: int
) -> tuple[Collection[int], Collection[int]]:
    """Rooms that the base was in, and storeys; all of the storey's where its poses are unknown."""
    if poses is None:
        return [room.id for room in truth.rooms if room.storey == storey], {storey}
    visits = RoomVisits(truth)
    for stamp, position in zip(poses.stamps, poses.positions, strict=True):
        visits.add(float(stamp), position)
    return visits.entered.keys(), visits.storeys


def _score_rooms(
    rooms: Sequence[ForeignRoom],
    truth: Truth,
    T_world_map: Array,
    entered: Collection[int],
    storeys: Collection[int],
) -> RoomScore:
    return score_rooms(
        votes=[_vote(place, room) for place, room in enumerate(rooms)],
        polygons={i: room.polygon for i, room in enumerate(rooms) if room.polygon is not None},
        truth=truth,
        T_world_map=T_world_map,
        entered=entered,
        mapped_faces=(),
        storeys=storeys,
    )


def _vote(place: int, room: ForeignRoom) -> RoomVote:
    """A room without pieces, which the centre rule judges."""
    inner = inner_point(RoomProposal(place, (), room.polygon, room.centre, 1.0))
    centre = (float(room.centre[0]), float(room.centre[1]))
    return RoomVote(place, (), None, 0.0, 0, centre, inner)


def _rooms(score: RoomScore) -> Rooms:
    return Rooms(
        truth=score.truth,
        entered=score.entered,
        centre_precision=score.centre_precision,
        centre_recall=score.centre_recall,
        mean_iou=score.mean_iou,
    )
