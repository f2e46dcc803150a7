"""Consistency: are the back end's covariances honest?

The normalised estimation error squared (NEES) of an estimate with n parameters is its squared error
over its own covariance, and n on average if that is right; here it is given per parameter, so that
1 is honest, more is overconfident. Beside it the share of estimates within their own 95 % bounds.
The map hangs on the first keyframe, so both are judged with that one laid on its true pose.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from eval.score.planes import PlaneVote, feet_on_faces
from eval.score.scores import RunRecord
from eval.score.surfaces import Surfaces
from slam.charts import Chart
from slam.core import Array, MapPlane, inverse, so3_log, transform_plane, transform_points
from worlds.truth import Face

if TYPE_CHECKING:
    from slam.chisquares import ChiSquare
    from slam.graph import LayeredGraph

WITHIN = {3: 7.815, 6: 12.592}
"""95 % of chi-square distributed numbers are below this, by degrees of freedom."""

MOST = 200
"""So many keyframes are asked for, evenly along the way: each answer takes a millisecond."""


@dataclass(frozen=True)
class Nees:
    """mean: per parameter; within_95: share of the estimates; None without any."""

    mean: float | None = None
    within_95: float | None = None

    @staticmethod
    def of(errors: Sequence[Array], covariances: Sequence[Array]) -> Nees:
        """Of errors (n,) and their covariances (n, n)."""
        if not errors:
            return Nees()
        size = len(errors[0])
        squares = [
            float(e @ np.linalg.solve(c, e)) for e, c in zip(errors, covariances, strict=True)
        ]
        return Nees(
            float(np.mean(squares)) / size, float(np.mean(np.array(squares) < WITHIN[size]))
        )


@dataclass(frozen=True)
class ChiSquares:
    """Mean square of a residual over its variance, by type of factor; None without such."""

    odometry: float | None = None
    planes: float | None = None
    plumb: float | None = None
    loops: float | None = None
    rooms: float | None = None
    walls: float | None = None
    floors: float | None = None
    parallel: float | None = None
    perpendicular: float | None = None
    thickness: float | None = None

    @staticmethod
    def of(sums: Mapping[str, ChiSquare]) -> ChiSquares:
        """From the sums over each type."""
        return ChiSquares(**{kind: s.chi2 / s.residuals for kind, s in sums.items() if s.residuals})


@dataclass(frozen=True)
class Consistency:
    """See this file."""

    keyframes: Nees = Nees()
    planes: Nees = Nees()
    chi2: ChiSquares = ChiSquares()


def score_consistency(
    record: RunRecord, votes: Sequence[PlaneVote], graph: LayeredGraph
) -> Consistency:
    """votes: on the planes of the final map. Where the true poses are not known there is only how
    well the factors fit."""
    chi2 = ChiSquares.of(graph.chi_squares())
    keeper = record.keeper
    keyframes = record.view.keyframes
    true = keeper.poses_at(np.array([keyframe.stamp for keyframe in keyframes]))
    estimated = np.array([keyframe.T_map_base for keyframe in keyframes])
    if len(true) == 0 or not np.isfinite(true).all():
        return Consistency(chi2=chi2)
    T_world_map = true[0] @ inverse(estimated[0])
    walls = [
        (plane, vote.face_surface)
        for plane, vote in zip(record.view.planes, votes, strict=bool(votes))
        if vote.face_surface is not None
    ]
    return Consistency(
        keyframes=_keyframe_nees(estimated, true, T_world_map, graph),
        planes=_plane_nees(walls, Surfaces(keeper.truth), T_world_map, graph),
        chi2=chi2,
    )


def _keyframe_nees(estimated: Array, true: Array, T_world_map: Array, graph: LayeredGraph) -> Nees:
    """Of poses (K, 4, 4), estimated in the map and true in the world; the first one has no error,
    since the map hangs on it."""
    last = len(true) - 1
    asked = np.unique(np.linspace(1, last, min(MOST, last)).round().astype(np.int64))
    errors, covariances = [], []
    for k in asked.tolist():
        off = inverse(T_world_map @ estimated[k]) @ true[k]
        errors.append(np.append(so3_log(off[:3, :3]), off[:3, 3]))
        covariances.append(graph.keyframe_covariance(k))
    return Nees.of(errors, covariances)


def _plane_nees(
    walls: Sequence[tuple[MapPlane, int]],
    surfaces: Surfaces,
    T_world_map: Array,
    graph: LayeredGraph,
) -> Nees:
    """Of mapped planes and the surfaces that they are of."""
    errors, covariances = [], []
    for plane, surface in walls:
        chart = graph.estimates.chart(plane.id)
        true = _true_coordinates(plane.points, surfaces.faces(surface), chart, T_world_map)
        errors.append(chart.coordinates(plane.normal, plane.d) - true)
        covariances.append(graph.plane_covariance(plane.id))
    return Nees.of(errors, covariances)


def _true_coordinates(
    points: Array, faces: Sequence[Face], chart: Chart, T_world_map: Array
) -> Array:
    """(3,) of the plane that fits the true wall best where the points (N, 3), map frame, are.

    A face may run over several wall bodies, each built a little off the others. A stretch that is
    hardly high or long says little of its direction: there the face as a whole counts.
    """
    T_map_world = inverse(T_world_map)
    feet = feet_on_faces(transform_points(T_world_map, points), faces)
    feet = transform_points(T_map_world, feet)
    face = max(faces, key=lambda face: face.length)
    prior = chart.coordinates(*transform_plane(T_map_world, face.normal, face.d))
    design = np.column_stack([chart.place(feet), np.ones(len(feet))])
    target = (feet - chart.origin) @ chart.frame[2]
    weak = np.diag([1.0, 1.0, 1e-6])
    fitted = np.linalg.solve(design.T @ design + weak, design.T @ target + weak @ prior)
    return np.asarray(fitted, dtype=np.float64)
