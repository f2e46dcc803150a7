"""Which mapped plane an observation is of, and which mapped planes are one: by statistics.

An observation differs from a mapped plane by two tilts and a distance, taken at the observation's
centroid. How far they may differ follows from how well either is known there and from how far the
base has driven since the plane was seen last.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from slam.charts import Chart
from slam.core import Array, PlaneObservation


@dataclass(frozen=True)
class AssociationConfig:
    """chi2: largest squared statistical distance (three degrees of freedom) of an observation;
    angle [rad], distance [m]: never more than this apart; reach [m]: largest hole between their
    extents along the wall, which is less than the width of a corridor, and overlap [m]: largest
    one in height, which is less than a storey's ceiling; extent [m]: of a floor or ceiling from
    where it was first seen, beyond which it is another (a variable that every keyframe of a large
    building hangs on would be solved again with each of them).

    model_angle, model_distance: standard deviations of what covariances do not know of, as walls
    are not flat and sensors not ideal; pose_angle, pose_distance: of the pose before it has been
    aligned to the planes; drift_angle [rad/m], drift_distance [m/m]: of the estimate per metre
    driven since the plane was seen.

    merge_chi2, merge_angle, merge_distance: two mapped planes closer than this are one, once the
    distance between them is known to merge_sigma [m]. shadow_angle, shadow_distance: closer than
    this to another plane, one that was seen only once is that one's shadow.
    """

    chi2: float = 9.0
    angle: float = np.radians(8.0)
    distance: float = 0.25
    reach: float = 1.0
    overlap: float = 0.2
    extent: float = 40.0
    model_angle: float = np.radians(0.2)
    model_distance: float = 0.007
    pose_angle: float = np.radians(0.5)
    pose_distance: float = 0.02
    drift_angle: float = np.radians(0.004)
    drift_distance: float = 0.0004
    merge_chi2: float = 12.0
    merge_angle: float = np.radians(2.5)
    merge_distance: float = 0.06
    merge_sigma: float = 0.012
    shadow_angle: float = np.radians(5.0)
    shadow_distance: float = 0.12


class PlaneBelief:
    """How well a plane is known, from its observations alone: the information (3, 3) on a, b, h of
    its chart, where it is of full rank."""

    def __init__(self) -> None:
        self._information = np.zeros((3, 3))

    def add(self, chart: Chart, place: Array, covariance: Array) -> None:
        """An observation at a place (2,) in the chart, with the covariance (3, 3) that it has there
        in the chart's axes."""
        H = _at(place)
        self._information += H.T @ np.linalg.inv(covariance) @ H

    def merge(self, other: PlaneBelief, chart: Chart, others: Chart) -> None:
        """Takes in what is known of a plane that turned out to be the same."""
        move = np.eye(3)
        move[2, :2] = chart.place(others.origin[None])[0]
        self._information += move.T @ other._information @ move

    def covariance(self, place: Array) -> Array:
        """(3, 3) of two tilts and the distance at a place (2,) in the chart."""
        H = _at(place)
        weak = np.diag([100.0, 100.0, 1.0])  # 6 degrees, 1 m
        return np.asarray(H @ np.linalg.inv(self._information + weak) @ H.T, dtype=np.float64)


def _at(place: Array) -> Array:
    """From a, b, h to two tilts and the distance at a place."""
    H = np.eye(3)
    H[2, :2] = place
    return H


def in_chart(chart: Chart, T_map_base: Array, observation: PlaneObservation) -> Array:
    """An observation's covariance (3, 3) in the axes of a chart that faces nearly the same way."""
    axes = observation.rows[:2] @ T_map_base[:3, :3].T
    turn = np.eye(3)
    turn[:2, :2] = chart.frame[:2] @ axes.T
    return np.asarray(turn @ observation.covariance @ turn.T, dtype=np.float64)


def difference(chart: Chart, mapped: tuple[Array, float], normal: Array, centroid: Array) -> Array:
    """(3,) by how much a and b [rad] and the distance [m] of an observed plane exceed a mapped
    one's, at the centroid. normal, centroid: (3,) of the observed one, map frame."""
    n, d = mapped
    tilts = chart.frame[:2] @ (n - normal)  # a and b grow as the normal leans the other way
    return np.append(tilts, n @ centroid + d)


def statistical_distance(residual: Array, covariance: Array) -> float:
    """Squared Mahalanobis distance of a residual (3,)."""
    return float(residual @ np.linalg.solve(covariance, residual))
