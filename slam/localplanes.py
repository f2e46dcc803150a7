"""The planes seen lately, in the tracker's own frame: learnt from keyframes, and soon forgotten."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from slam.core import (
    HORIZONTAL,
    Array,
    PlaneObservation,
    plane_axes,
    transform_plane,
    transform_points,
)


@dataclass(frozen=True)
class LocalPlaneConfig:
    """keep: keyframes after which an unseen plane is forgotten; match_*: an observation is of a
    known plane within these, of a floor or a ceiling within level_angle, less than any ramp has;
    observed_*: added to an observation's own standard deviations, for
    the pose it was seen from."""

    keep: int = 40
    match_angle: float = np.radians(5.0)
    level_angle: float = np.radians(2.5)
    match_distance: float = 0.10
    match_reach: float = 1.0
    observed_rotation: float = np.radians(0.1)
    observed_distance: float = 0.004


@dataclass
class LocalPlane:
    """A plane in the tracker's frame, with a covariance at its centroid (``PlaneObservation``), its
    extent along its level axis and in height, and the keyframe that saw it last."""

    normal: Array
    centroid: Array
    covariance: Array
    span: Array
    height: Array
    seen: int


class LocalPlanes:
    """All that is known of them, keyframe by keyframe."""

    def __init__(self, config: LocalPlaneConfig):
        self._config = config
        self._planes: list[LocalPlane] = []
        self._keyframes = 0

    def __iter__(self) -> Iterator[LocalPlane]:
        return iter(self._planes)

    def learn(self, observations: tuple[PlaneObservation, ...], T_track_base: Array) -> None:
        """Takes in what a keyframe at this pose (4, 4) observed; forgets what is long unseen."""
        self._keyframes += 1
        for observation in observations:
            self._learn(observation, T_track_base)
        oldest = self._keyframes - self._config.keep
        self._planes = [plane for plane in self._planes if plane.seen >= oldest]

    def _learn(self, observation: PlaneObservation, T: Array) -> None:
        config = self._config
        normal, d = transform_plane(T, observation.normal, observation.d)
        centroid = transform_points(T, observation.centroid)
        points = transform_points(T, observation.points)
        extra = [config.observed_rotation**2] * 2 + [config.observed_distance**2]
        # Residuals tell how far the true normal lies from the observed one; here it is reversed.
        reverse = np.diag([-1.0, -1.0, 1.0])
        covariance = reverse @ observation.covariance @ reverse + np.diag(extra)
        for plane in self._planes:
            if self._same(plane, normal, centroid, points):
                _update(plane, normal, d, centroid, covariance)
                break
        else:
            empty = np.array([np.inf, -np.inf])
            plane = LocalPlane(normal, centroid, covariance, empty, empty, 0)
            self._planes.append(plane)
        along = points @ plane_axes(plane.normal)[0]
        plane.span = _grown(plane.span, along)
        plane.height = _grown(plane.height, points[:, 2])
        plane.seen = self._keyframes

    def _same(self, plane: LocalPlane, normal: Array, centroid: Array, points: Array) -> bool:
        config = self._config
        level = abs(normal[2]) > HORIZONTAL
        if plane.normal @ normal < np.cos(config.level_angle if level else config.match_angle):
            return False
        if abs(plane.normal @ (centroid - plane.centroid)) > config.match_distance:
            return False
        along = points @ plane_axes(plane.normal)[0]
        gap = max(along.min() - plane.span[1], plane.span[0] - along.max())
        return bool(gap < config.match_reach or level)


def _grown(interval: Array, values: Array) -> Array:
    """The interval that also holds the bulk of the values (N,): from their first to their 99th
    percentile."""
    places = np.array([0.01, 0.99]) * (len(values) - 1)
    below = places.astype(np.int64)
    above = np.minimum(below + 1, len(values) - 1)
    ordered = np.partition(values, [*below, *above])  # np.percentile takes five times as long
    low, high = ordered[below] + (places - below) * (ordered[above] - ordered[below])
    return np.array([min(interval[0], low), max(interval[1], high)])


def _update(plane: LocalPlane, normal: Array, d: float, centroid: Array, covariance: Array) -> None:
    """Kalman update of a plane by another estimate of it, in the plane's axes at its centroid.

    State: turns of the normal towards both tangents, and the plane's offset along its normal.
    """
    first, second = plane_axes(plane.normal)
    lever = plane.centroid - centroid
    measured = np.array([first @ normal, second @ normal, -(normal @ plane.centroid + d)])
    carry = np.eye(3)
    carry[2, :2] = -first @ lever, -second @ lever
    innovation = plane.covariance + carry @ covariance @ carry.T
    gain = plane.covariance @ np.linalg.inv(innovation)
    change = gain @ measured
    plane.covariance = (np.eye(3) - gain) @ plane.covariance
    plane.centroid = plane.centroid + change[2] * plane.normal
    turned = plane.normal + change[0] * first + change[1] * second
    plane.normal = turned / np.linalg.norm(turned)
