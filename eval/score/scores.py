"""All scores of a run, from what was stored while it went on."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from eval.labels import TruthKeeper
from eval.score.failures import Evidence, Failures, Fates, linked_rooms, room_fates
from eval.score.latency import UNKNOWN_TIME, TimeScore, score_time
from eval.score.map import MapCloud, MapScore, SurfaceDistance, map_cloud, score_map
from eval.score.planes import LabelledPlane, PlaneScore, score_planes
from eval.score.rooms import RoomScore, score_rooms
from eval.score.trajectory import (
    Trajectory,
    TrajectoryScore,
    ate_of_subset,
    part_of,
    score_trajectory,
)
from eval.score.votes import RoomVote
from eval.score.walls import WallScore, score_walls
from slam.core import Array, Links, MapView, Proposals
from worlds.truth import Truth


@dataclass(frozen=True)
class RunRecord:
    """What a run leaves to be scored; trajectories have one pose per scan, map frame.

    estimate: after the last optimisation; odometry: the odometry alone; online: each pose as it was
    first given, None where a run keeps none; view, proposals: the final map and the detector's last
    word on it (ask it once more after the last optimisation, so that the two fit); links: of the
    same update, None from a detector that does not tell.
    """

    keeper: TruthKeeper
    estimate: Trajectory
    odometry: Trajectory
    online: Trajectory | None
    view: MapView
    proposals: Proposals
    links: Links | None = None


@dataclass(frozen=True)
class Scores:
    """Everything that is scored; what needs T_world_map is None inside where there is none.

    Each trajectory is aligned by itself; ate_keyframes, and all scores of the map and of rooms, use
    the alignment of the final estimate. ate_keyframes: over the front end's keyframes, kept by the
    back end or not. fates: of rooms; None where they are not scored.
    """

    truth_trajectory: Trajectory
    estimate: TrajectoryScore
    odometry: TrajectoryScore
    online: TrajectoryScore | None
    ate_keyframes: float | None
    path_m: float | None
    cloud: MapCloud
    planes: PlaneScore
    map: MapScore
    rooms: RoomScore
    walls: WallScore
    time: TimeScore
    fates: Fates | None

    @property
    def failures(self) -> Failures:
        """What was missed and what is false, counted by causes."""
        return Failures() if self.fates is None else self.fates.count()

    @property
    def T_world_map(self) -> Array | None:
        """The one alignment that serves all scores."""
        return self.estimate.T_truth_estimate


def score_run(record: RunRecord, surface: SurfaceDistance | None) -> Scores:
    """Score a run; surface: the distance to the world's mesh, None where nothing but poses (or not
    even those) is known of the place."""
    keeper, truth = record.keeper, record.keeper.truth
    known = np.asarray(np.isfinite(keeper.trajectory.positions).all(axis=1))
    true_path, final = part_of(keeper.trajectory, known), part_of(record.estimate, known)
    estimate = score_trajectory(final, true_path)
    T_world_map = estimate.T_truth_estimate
    keyframes = np.isin(np.arange(len(known)), keeper.keyframe_scans)
    cloud = map_cloud(record.view.planes)
    if surface is None:
        planes = PlaneScore(mapped=len(record.view.planes))
        concepts = _Concepts()
    else:
        planes = score_planes(labelled_planes(record), truth, keeper.seen, T_world_map)
        concepts = _score_concepts(record, planes, T_world_map)
    return Scores(
        truth_trajectory=true_path,
        estimate=estimate,
        odometry=score_trajectory(part_of(record.odometry, known), true_path),
        online=None
        if record.online is None
        else score_trajectory(part_of(record.online, known), true_path),
        ate_keyframes=ate_of_subset(
            T_world_map, final, true_path, np.flatnonzero(keyframes[known]).astype(np.int64)
        ),
        path_m=true_path.path_m if known.any() or not len(known) else None,
        cloud=cloud,
        planes=planes,
        map=_score_map(record, cloud, surface, T_world_map),
        rooms=concepts.rooms,
        walls=concepts.walls,
        time=concepts.time,
        fates=concepts.fates,
    )


def _score_map(
    record: RunRecord, cloud: MapCloud, surface: SurfaceDistance | None, T_world_map: Array | None
) -> MapScore:
    if surface is None:
        return MapScore(None, None, None)
    faces = record.keeper.faces_of(cloud.point_ids)
    return score_map(cloud, faces, record.keeper.true_points(cloud.point_ids), surface, T_world_map)


def labelled_planes(record: RunRecord) -> list[LabelledPlane]:
    """The final planes with the truth of their points."""
    keeper = record.keeper
    return [
        LabelledPlane(
            plane=plane,
            faces=keeper.faces_of(plane.point_ids),
            along=keeper.along_of(plane.point_ids),
            points_world=keeper.true_points(plane.point_ids),
        )
        for plane in record.view.planes
    ]


@dataclass(frozen=True)
class _Concepts:
    """What is scored of rooms and walls."""

    rooms: RoomScore = RoomScore()
    walls: WallScore = WallScore()
    time: TimeScore = UNKNOWN_TIME
    fates: Fates | None = None


def _score_concepts(record: RunRecord, planes: PlaneScore, T_world_map: Array | None) -> _Concepts:
    keeper, truth = record.keeper, record.keeper.truth
    if not truth.rooms_known:
        return _Concepts()
    room_votes, wall_votes = keeper.votes(record.view, record.proposals)
    walls = score_walls(wall_votes, truth, keeper.seen)
    entered = keeper.visits.entered
    if T_world_map is None:
        return _Concepts(RoomScore(len(truth.rooms), len(entered)), walls)
    rooms = score_rooms(
        votes=room_votes,
        polygons={r.id: r.polygon for r in record.proposals.rooms if r.polygon is not None},
        truth=truth,
        T_world_map=T_world_map,
        entered=entered.keys(),
        mapped_faces=planes.mapped_faces,
        storeys=keeper.visits.storeys,
    )
    time = score_time(keeper.instants, truth, T_world_map, entered, keeper.start)
    evidence = Evidence(
        seen=keeper.seen,
        mapped=planes.mapped_faces if _uses_planes(record, room_votes) else None,
        linked=None
        if record.links is None
        else linked_rooms(record.links, record.view.planes, keeper.voter, record.proposals),
    )
    fates = room_fates(
        room_votes, truth, T_world_map, entered.keys(), evidence, keeper.visits.storeys
    )
    return _Concepts(rooms, walls, time, fates)


def _uses_planes(record: RunRecord, votes: Sequence[RoomVote]) -> bool:
    """Is the detector known to make rooms of planes: do its last rooms have pieces? Of one without
    any: does it link planes, or had an earlier room pieces?"""
    if votes:
        return any(vote.faces for vote in votes)
    earlier = (vote for instant in record.keeper.instants for vote in instant.rooms)
    return record.links is not None or any(vote.faces for vote in earlier)


def graph_truth(scores: Scores, truth: Truth, record: RunRecord) -> dict[tuple[str, int], str]:
    """True labels of planes, rooms and walls for graph.json: (layer, id) -> label.

    "surface 3" | "mixed" | a name of ``worlds.truth.LABELS`` for planes; a room's name or "false";
    "wall 2" or "false"; without room truth none for rooms and walls, and nothing where nothing is
    known of the place.
    """
    if not truth.faces:
        return {}
    labels = {("plane", vote.plane_id): vote.label for vote in scores.planes.votes}
    if not truth.rooms_known:
        return labels
    for room in record.proposals.rooms if scores.T_world_map is not None else ():
        found = scores.rooms.matches.get(room.id)
        labels["room", room.id] = "false" if found is None else truth.rooms[found].name
    for wall in record.proposals.walls:
        match = scores.walls.matches.get(wall.id)
        labels["wall", wall.id] = "false" if match is None else f"wall {match}"
    return labels
