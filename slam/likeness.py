"""Which planes are near one another, and which are one."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from slam.alignment import Sight, aligned
from slam.association import AssociationConfig, difference, in_chart, statistical_distance
from slam.core import HORIZONTAL, Array, Floats, PlaneObservation, transform_points
from slam.estimates import Estimates
from slam.planeviews import PlaneViews
from slam.support import Support


class Likeness:
    """Compares observations with mapped planes, and these with each other."""

    def __init__(
        self,
        estimates: Estimates,
        supports: Mapping[int, Support],
        views: PlaneViews,
        config: AssociationConfig,
    ):
        self._estimates = estimates
        self._supports = supports
        self._views = views
        self._config = config

    def near(self, normal: Array, centroid: Array, storey: int) -> list[int]:
        """Living planes of a storey that face the same way and pass by, whatever their extent:
        walls may stand one above the other."""
        config, estimates = self._config, self._estimates
        fits = estimates.normals @ normal > np.cos(config.angle)
        fits &= np.abs(estimates.normals @ centroid + estimates.offsets) < config.distance
        passing = np.flatnonzero(fits & estimates.alive).tolist()
        return [plane for plane in passing if self._supports[plane].storey == storey]

    # --- observations ---

    def associate(
        self, T_map_base: Array, observations: Sequence[PlaneObservation], way: float, storey: int
    ) -> tuple[Array, list[int | None]]:
        """The pose aligned to the planes that are seen, and the plane of each observation, or None.

        Twice: loosely from the pose as it is, then strictly from where the planes put it, so that a
        wall and the next one a few centimetres off are told apart. way: driven so far [m]; storey:
        whose planes come into question.
        """
        sights: list[Sight] = []
        for observation in observations:
            loose = self._config.pose_angle, self._config.pose_distance
            found = self._nearest(T_map_base, observation, way, storey, *loose)
            if found is not None:
                plane, covariance = found
                sights.append((observation, *self._estimates.plane(plane), covariance))
        T = aligned(T_map_base, sights) if sights else T_map_base
        strict = [self._nearest(T, seen, way, storey, 0.0, 0.0) for seen in observations]
        return T, [None if found is None else found[0] for found in strict]

    def _nearest(
        self,
        T_map_base: Array,
        observation: PlaneObservation,
        way: float,
        storey: int,
        turn: float,
        shift: float,
    ) -> tuple[int, Array] | None:
        """The mapped plane that is statistically nearest, and the covariance of the difference.

        turn [rad], shift [m]: standard deviations of the pose itself.
        """
        config = self._config
        normal = T_map_base[:3, :3] @ observation.normal
        centroid = transform_points(T_map_base, observation.centroid)
        points = transform_points(T_map_base, _sample(observation.points))
        best, smallest = None, config.chi2
        for plane in self.near(normal, centroid, storey):
            support, chart = self._supports[plane], self._estimates.chart(plane)
            off = difference(chart, self._estimates.plane(plane), normal, centroid)
            covariance = in_chart(chart, T_map_base, observation)
            covariance += support.belief.covariance(chart.place(centroid[None])[0])
            apart = way - support.seen_at
            angle = config.model_angle + apart * config.drift_angle
            distance = config.model_distance + apart * config.drift_distance
            covariance += np.diag([angle**2 + turn**2] * 2 + [distance**2 + shift**2])
            chi2 = statistical_distance(off, covariance)
            if chi2 < smallest and self._meets(plane, points):
                best, smallest = (plane, covariance), chi2
        return best

    def _meets(self, plane: int, points: Array) -> bool:
        """Do the points (map frame) lie within reach of the plane's extent?"""
        config, support = self._config, self._supports[plane]
        chart = self._estimates.chart(plane)
        if abs(chart.frame[2, 2]) > HORIZONTAL:
            place = chart.place(points.mean(axis=0)[None])[0]
            return float(np.hypot(*place)) < config.extent
        low, high = support.z_range
        if points[:, 2].min() > high - config.overlap or points[:, 2].max() < low + config.overlap:
            return False
        return support.stretches.gap(chart.place(points)[:, 0]) < config.reach

    # --- planes ---

    def are_one(self, a: int, b: int, last: bool) -> bool:
        """Are two planes one, by what is known of both where the smaller one lies? The ``last``
        time however well they are known, since nothing more will be."""
        config = self._config
        a, b = self._larger_first(a, b)
        off, centroid = self._apart(a, b)
        if np.hypot(off[0], off[1]) > config.merge_angle or abs(off[2]) > config.merge_distance:
            return False
        covariance = np.diag([config.model_angle**2] * 2 + [config.model_distance**2])
        for plane in (a, b):
            place = self._estimates.chart(plane).place(centroid[None])[0]
            covariance += self._supports[plane].belief.covariance(place)
        known = last or covariance[2, 2] < config.merge_sigma**2
        close = statistical_distance(off, covariance) < config.merge_chi2
        return bool(known) and close and self._meets(a, self._views[b].points)

    def are_one_in_a_room(self, a: int, b: int, apart: float) -> bool:
        """Are two planes of one room one? Two surfaces that face the same way and overlap cannot
        both be seen, unless one is furniture, which stands off by more than ``apart`` [m]."""
        a, b = self._larger_first(a, b)
        off, _ = self._apart(a, b)
        near = np.hypot(off[0], off[1]) < self._config.merge_angle and abs(off[2]) < apart
        return bool(near) and self._beside(a, b)

    def is_shadow(self, plane: int) -> bool:
        """Does a plane lie along one that was seen more than once, hardly apart? So does what a
        sweep sees of it whose motion was wrong."""
        config = self._config
        centroid = self._views[plane].points.mean(axis=0)
        normal, storey = self._estimates.normals[plane], self._supports[plane].storey
        for other in self.near(normal, centroid, storey):
            if len(self._supports[other].observed) > 1:
                off, _ = self._apart(other, plane)
                near = np.hypot(off[0], off[1]) < config.shadow_angle
                if near and abs(off[2]) < config.shadow_distance and self._beside(other, plane):
                    return True
        return False

    def _larger_first(self, a: int, b: int) -> tuple[int, int]:
        return (a, b) if self._supports[a].shown >= self._supports[b].shown else (b, a)

    def _apart(self, a: int, b: int) -> tuple[Array, Array]:
        """By how much a exceeds b (``difference``), and where: b's middle (3,), on its plane."""
        normal, d = self._estimates.plane(b)
        centroid = self._views[b].points.mean(axis=0)
        centroid = centroid - (normal @ centroid + d) * normal
        chart = self._estimates.chart(a)
        return difference(chart, self._estimates.plane(a), normal, centroid), centroid

    def _beside(self, a: int, b: int) -> bool:
        """Do two planes overlap along the wall?"""
        along = self._estimates.chart(a).place(self._views[b].points)[:, 0]
        return self._supports[a].stretches.gap(along) == 0.0


def _sample(points: Floats) -> Floats:
    """Enough of the points (N, 3) to tell where along a wall they are, to a quarter metre."""
    return points[:: max(1, len(points) // 150)]
