"""Honest covariances give 1, those that are too small more; what is not known gives null."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest
from looking import keep

from eval.labels import TruthKeeper
from eval.score.consistency import ChiSquares, Consistency, Nees, score_consistency
from eval.score.planes import LabelledPlane, vote_plane
from eval.score.scores import RunRecord
from eval.score.surfaces import Surfaces
from eval.score.trajectory import Trajectory
from slam.charts import Chart
from slam.chisquares import ChiSquare
from slam.core import Keyframe, KeyframeScan, MapView, Proposals, inverse, pose, so3_exp

SIGMA = np.array([0.002, 0.002, 0.004, 0.01, 0.01, 0.005])


class Graph:
    """Tells the same covariances of everything."""

    def __init__(self, charts, keyframe=SIGMA, plane=(0.01, 0.01, 0.01)):
        self.estimates = self
        self._charts, self._keyframe, self._plane = charts, keyframe, plane

    def chart(self, plane):
        return self._charts[plane]

    def keyframe_covariance(self, keyframe):
        return np.diag(np.square(self._keyframe))

    def plane_covariance(self, plane):
        return np.diag(np.square(self._plane))

    def chi_squares(self):
        return {"odometry": ChiSquare(6, 3.0), "planes": ChiSquare(300, 150.0)}


def test_errors_as_large_as_they_are_said_to_be_are_one():
    rng = np.random.default_rng(0)
    root = rng.normal(size=(6, 6))
    covariance = root @ root.T + 0.1 * np.eye(6)
    errors = list(rng.multivariate_normal(np.zeros(6), covariance, 4000))
    honest = Nees.of(errors, [covariance] * 4000)
    assert honest.mean == pytest.approx(1.0, abs=0.03)
    assert honest.within_95 == pytest.approx(0.95, abs=0.015)
    bold = Nees.of(errors, [0.25 * covariance] * 4000)
    assert bold.mean == pytest.approx(4.0 * honest.mean)
    assert Nees.of([], []) == Nees(None, None)


def record_of(house, errors, T_map_world, shift=0.0):
    """A drive from A to B and back; keyframes off by (6,) each, the face to the south by shift."""
    keeper = TruthKeeper(house.truth)
    true = house.drive([(1.0, 1.5), (3.0, 1.5), (1.0, 2.0)], steps=len(errors) // 2)
    look = house.whole(0, 1, 2, 3)
    keyframes = []
    nothing = KeyframeScan((), np.zeros((0, 3)), np.zeros(3))
    for k, (T, e) in enumerate(zip(true, errors, strict=True)):
        scan, truth = house.scan(k, 0.1 * (k + 1), T[:3, 3], look)
        keep(keeper, scan, replace(truth, T_world_base=T), keyframe=True)
        estimated = T_map_world @ T @ inverse(pose(so3_exp(e[:3]), e[3:]))
        keyframes.append(Keyframe(k, k, 0.1 * (k + 1), estimated, nothing))
    pair = house.scan(0, 0.1, true[0][:3, 3], look)
    plane = house.plane(0, pair, {0: (0.0, 4.0)}, T_map_world, shift)
    poses = np.array([keyframe.T_map_base for keyframe in keyframes])
    path = Trajectory(np.array([keyframe.stamp for keyframe in keyframes]), poses)
    record = RunRecord(keeper, path, path, None, MapView(0.0, (plane,), keyframes), Proposals())
    labelled = LabelledPlane(
        plane,
        keeper.faces_of(plane.point_ids),
        keeper.along_of(plane.point_ids),
        keeper.true_points(plane.point_ids),
    )
    votes = (vote_plane(labelled, Surfaces(house.truth)),)
    normal = T_map_world[:3, :3] @ house.truth.faces[0].normal
    return record, votes, Graph({0: Chart.at(plane.points.mean(axis=0), normal)})


ANYWHERE = pose(so3_exp(np.array([0.1, -0.2, 2.0])), np.array([5.0, -3.0, 1.0]))


@pytest.mark.parametrize("T_map_world", [np.eye(4), ANYWHERE])
def test_poses_are_judged_from_the_first_keyframe_on(house, T_map_world):
    rng = np.random.default_rng(1)
    errors = rng.normal(0.0, 1.0, (160, 6)) * SIGMA
    errors[0] = 0.0
    record, votes, graph = record_of(house, errors, T_map_world)
    found = score_consistency(record, votes, graph)
    assert found.keyframes.mean == pytest.approx(np.mean(np.square(errors[1:] / SIGMA)), rel=0.02)
    assert found.keyframes.within_95 == pytest.approx(0.95, abs=0.04)
    assert found.chi2 == ChiSquares(odometry=0.5, planes=0.5)


@pytest.mark.parametrize("T_map_world", [np.eye(4), ANYWHERE])
@pytest.mark.parametrize(("shift", "nees", "within"), [(0.0, 0.0, 1.0), (0.03, 3.0, 0.0)])
def test_planes_are_judged_where_they_are(house, T_map_world, shift, nees, within):
    """Three centimetres off where one is said: nine over three parameters."""
    record, votes, graph = record_of(house, np.zeros((6, 6)), T_map_world, shift)
    found = score_consistency(record, votes, graph)
    assert found.planes.mean == pytest.approx(nees, abs=0.02)
    assert found.planes.within_95 == within


def test_without_true_poses_there_is_only_how_well_the_factors_fit(house):
    record, votes, graph = record_of(house, np.zeros((6, 6)), np.eye(4))
    unknown = TruthKeeper(house.truth)
    scan, truth = house.scan(0, 0.1, (1.0, 1.5, 0.0), house.whole(0))
    lost = replace(truth, T_world_base=np.full((4, 4), np.nan))
    keep(unknown, scan, lost, keyframe=True)
    found = score_consistency(replace(record, keeper=unknown), votes, graph)
    assert found == Consistency(chi2=ChiSquares(odometry=0.5, planes=0.5))
    assert json.dumps(found.keyframes.mean) == "null"
