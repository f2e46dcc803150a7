"""The end of a run: its scores, and the files that it leaves."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np

from eval.graphfile import write_graph
from eval.metrics import Loops, Metrics, RunFacts, assemble
from eval.outputs import write_metrics, write_ply, write_tum
from eval.parts import Parts
from eval.picture import plan_png
from eval.report.run import write_report
from eval.roomtable import ROOMS_FILE, room_rows, write_rooms
from eval.scenegraph import scene_graph
from eval.score.consistency import score_consistency
from eval.score.loops import score_loops
from eval.score.map import SurfaceDistance
from eval.score.scores import RunRecord, Scores, graph_truth, score_run
from eval.score.trajectory import Trajectory
from eval.source import Place
from slam.core import Linking, Proposals


def finish(parts: Parts, proposals: Proposals, facts: RunFacts, folder: Path) -> Metrics:
    """Scores what a run has mapped, and writes its files. proposals: the detector's last word."""
    record = _record(parts, proposals)
    scores = score_run(record, _surface(parts.place))
    simulated_s = float(record.estimate.stamps[-1]) - parts.keeper.start
    facts = replace(
        facts, simulated_s=simulated_s, scans_skipped=_skipped(parts), loops=_loops(parts)
    )
    if facts.status != "failed":
        consistency = score_consistency(record, scores.planes.votes, parts.backend.graph())
        facts = replace(facts, consistency=consistency)
    metrics = assemble(facts, scores)
    _write_map(record, scores, folder)
    write_metrics(metrics, folder / "metrics.json")
    write_report(folder)
    return metrics


def _skipped(parts: Parts) -> int:
    """Bad scans of a recording, and sweeps without a return."""
    recording = parts.place.recording
    bad = 0 if recording is None else recording.skipped
    return bad + parts.scans - len(parts.backend.stamps())


def _record(parts: Parts, proposals: Proposals) -> RunRecord:
    """What there is to score."""
    backend, detector = parts.backend, parts.guard.detector
    return RunRecord(
        keeper=parts.keeper,
        estimate=Trajectory(backend.stamps(), backend.trajectory()),
        odometry=Trajectory(backend.stamps(), backend.odometry()),
        online=Trajectory(backend.stamps(), backend.online()),
        view=backend.dense_view(),
        proposals=proposals,
        links=detector.links() if isinstance(detector, Linking) else None,
    )


def _write_map(record: RunRecord, scores: Scores, folder: Path) -> None:
    """The trajectories, the map and the scene graph, and what the truth says of them."""
    truth = record.keeper.truth
    write_tum(record.estimate, folder / "trajectory.tum")
    write_tum(record.odometry, folder / "odometry.tum")
    if len(scores.truth_trajectory):
        write_tum(scores.truth_trajectory, folder / "truth.tum")
    write_ply(scores.cloud.points, scores.cloud.plane_id, folder / "map.ply")
    labels = graph_truth(scores, truth, record)
    write_graph(scene_graph(record.view, record.proposals, labels), folder / "graph.json")
    plan_png(record, scores, folder / "plan.png")
    if rows := room_rows(scores.fates, truth, record.keeper.visits.entered):
        write_rooms(rows, folder / ROOMS_FILE)


def _loops(parts: Parts) -> Loops:
    """Loop closures against the truth, where it is known at every keyframe."""
    stamps = np.array([keyframe.stamp for keyframe in parts.backend.keyframes()])
    poses = parts.keeper.poses_at(stamps)
    if not np.isfinite(poses).all():
        return Loops()
    found = score_loops(parts.backend.loops, poses)
    return Loops(found.true, found.false, found.missed)


def _surface(place: Place) -> SurfaceDistance | None:
    if place.mesh is None:
        return None
    return SurfaceDistance(place.mesh.vertices, place.mesh.triangles, place.mesh.face)
