"""The plane map: which observations are of one plane, and the points each plane was built from.

Geometry only: the graph holds the estimates, this holds what supports them.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from slam.alignment import Sight, aligned
from slam.association import (
    AssociationConfig,
    PlaneBelief,
    difference,
    in_chart,
    statistical_distance,
)
from slam.cells import CellGrid, Stretches
from slam.core import (
    Array,
    Floats,
    IntArray,
    MapPlane,
    PlaneObservation,
    point_ids,
    transform_points,
)
from slam.estimates import Estimates


@dataclass(frozen=True)
class PlaneMapConfig:
    """voxel [m]: of the points that are kept, and coarse_voxel of those that a detector is shown;
    doubt: keyframes after which a plane that was seen only once is dropped, if it has fewer points
    than doubt_points (a diagonal across a corner, the edge of a door) or is another's shadow;
    grown: a floor or ceiling, which has no end, is shown again when it has grown by this share;
    plane_moved [rad, m]: change of a plane, and pose_moved [m] of a keyframe, that others are told
    of."""

    voxel: float = 0.05
    coarse_voxel: float = 0.1
    doubt: int = 8
    doubt_points: int = 120
    grown: float = 0.1
    plane_moved: float = 0.001
    pose_moved: float = 0.005
    association: AssociationConfig = field(default_factory=AssociationConfig)


@dataclass(frozen=True)
class Observed:
    """One observation that supports a plane: its keyframe, and its place among that one's."""

    keyframe: int
    place: int
    observation: PlaneObservation


@dataclass
class _Chunk:
    """The points that one observation added. points: base frame; shown: those that a detector is
    shown; mapped: those, map frame, as they were told last."""

    keyframe: int
    points: Floats
    ids: IntArray
    shown: NDArray[np.bool_]
    mapped: Array | None = None

    def told(self, poses: Array, moved: NDArray[np.bool_]) -> Array:
        """The shown points in the map frame, worked out again if the keyframe moved."""
        if self.mapped is None or moved[self.keyframe]:
            self.mapped = transform_points(poses[self.keyframe], self.points[self.shown])
        return self.mapped


class _Support:
    """What a mapped plane was built from, and how far it reaches."""

    def __init__(self, config: PlaneMapConfig):
        self.observed: list[Observed] = []
        self.chunks: list[_Chunk] = []
        self.cells = CellGrid(config.voxel)
        self.coarse_cells = CellGrid(config.coarse_voxel)
        self.stretches = Stretches()
        self.belief = PlaneBelief()
        self.z_range = (np.inf, -np.inf)
        self.seen_at = 0.0
        self.keyframes: set[int] = set()
        self.shown = 0
        self.changed = True

    def absorb(self, other: _Support) -> None:
        """Takes over another's observations and points (its extent is the caller's to add)."""
        self.observed += other.observed
        self.chunks += other.chunks
        self.z_range = _hull(self.z_range, other.z_range)
        self.seen_at = max(self.seen_at, other.seen_at)
        self.keyframes |= other.keyframes
        self.shown += other.shown
        self.changed = True


class PlaneMap:
    """Mapped planes by id, with what supports each."""

    def __init__(self, estimates: Estimates, config: PlaneMapConfig = PlaneMapConfig()):
        self._config = config
        self._estimates = estimates
        self._support: dict[int, _Support] = {}
        self._views: dict[int, MapPlane] = {}
        self._told_poses = np.zeros((0, 4, 4))
        self._told_planes = np.zeros((0, 4))
        self._of_keyframe: dict[int, set[int]] = {}
        self._unchecked: set[int] = set()

    def __iter__(self) -> Iterator[int]:
        return iter(self._support)

    def __len__(self) -> int:
        return len(self._support)

    def new_plane(self, plane: int) -> None:
        """A plane that nothing supports yet."""
        self._support[plane] = _Support(self._config)

    # --- association ---

    def associate(
        self, T_map_base: Array, observations: Sequence[PlaneObservation], way: float
    ) -> tuple[Array, list[int | None]]:
        """The pose aligned to the planes that are seen, and the plane of each observation, or None.

        Twice: loosely from the pose as it is, then strictly from where the planes put it, so that a
        wall and the next one a few centimetres off are told apart. way: driven so far [m].
        """
        config = self._config.association
        sights: list[Sight] = []
        for observation in observations:
            loose = config.pose_angle, config.pose_distance
            found = self._nearest(T_map_base, observation, way, *loose)
            if found is not None:
                plane, covariance = found
                sights.append((observation, *self._estimates.plane(plane), covariance))
        T = aligned(T_map_base, sights) if sights else T_map_base
        strict = [self._nearest(T, observation, way, 0.0, 0.0) for observation in observations]
        return T, [None if found is None else found[0] for found in strict]

    def _nearest(
        self,
        T_map_base: Array,
        observation: PlaneObservation,
        way: float,
        turn: float,
        shift: float,
    ) -> tuple[int, Array] | None:
        """The mapped plane that is statistically nearest, and the covariance of the difference.

        turn [rad], shift [m]: standard deviations of the pose itself.
        """
        config = self._config.association
        normal = T_map_base[:3, :3] @ observation.normal
        centroid = transform_points(T_map_base, observation.centroid)
        points = transform_points(T_map_base, observation.points)
        best, smallest = None, config.chi2
        for plane in self._near(normal, centroid).tolist():
            support, chart = self._support[plane], self._estimates.chart(plane)
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

    def _near(self, normal: Array, centroid: Array) -> IntArray:
        """Living planes that face the same way and pass by, whatever their extent."""
        config, estimates = self._config.association, self._estimates
        fits = estimates.normals @ normal > np.cos(config.angle)
        fits &= np.abs(estimates.normals @ centroid + estimates.offsets) < config.distance
        return np.flatnonzero(fits & estimates.alive)

    def _meets(self, plane: int, points: Array) -> bool:
        """Do the points (map frame) lie within reach of the plane's extent?"""
        config, support = self._config.association, self._support[plane]
        chart = self._estimates.chart(plane)
        if abs(chart.frame[2, 2]) > 0.7:
            place = chart.place(points.mean(axis=0)[None])[0]
            return float(np.hypot(*place)) < config.extent
        low, high = support.z_range
        if points[:, 2].min() > high - config.overlap or points[:, 2].max() < low + config.overlap:
            return False
        return support.stretches.gap(chart.place(points)[:, 0]) < config.reach

    # --- support ---

    def support(
        self, plane: int, observed: Observed, scan_index: int, T_map_base: Array, way: float
    ) -> None:
        """Adds an observation to a plane; of its points those that the plane does not have yet."""
        support, chart = self._support[plane], self._estimates.chart(plane)
        observation = observed.observation
        support.observed.append(observed)
        support.keyframes.add(observed.keyframe)
        support.seen_at = way
        self._of_keyframe.setdefault(observed.keyframe, set()).add(plane)
        self._unchecked.add(plane)
        points = transform_points(T_map_base, observation.points)
        places = chart.place(points)
        support.stretches.add(places[:, 0])
        if len(points):
            support.z_range = _hull(support.z_range, (points[:, 2].min(), points[:, 2].max()))
        centroid = chart.place(transform_points(T_map_base, observation.centroid)[None])[0]
        seen = in_chart(chart, T_map_base, observation)
        support.belief.add(chart, centroid, seen)
        self._keep_points(support, observed, scan_index, places)

    def _keep_points(
        self, support: _Support, observed: Observed, scan_index: int, places: Array
    ) -> None:
        observation = observed.observation
        new = support.cells.take(places)
        if len(new) == 0:
            return
        shown = np.zeros(len(new), dtype=bool)
        shown[support.coarse_cells.take(places[new])] = True
        ids = point_ids(scan_index, observation.point_index[new])
        support.chunks.append(_Chunk(observed.keyframe, observation.points[new], ids, shown))
        count = int(shown.sum())
        level = bool(abs(observation.normal[2]) > 0.7)
        support.changed |= not level or count > self._config.grown * support.shown
        support.shown += count

    # --- merging ---

    def duplicates(self, last: bool = False) -> list[tuple[int, int]]:
        """Pairs (kept, gone) of planes that are one: same side, coplanar where they meet. Looks at
        planes that were observed since the last call; the ``last`` time at all of them, however
        well they are known, since nothing more will be."""
        if last:
            self._unchecked = set(self._support)
        pairs: list[tuple[int, int]] = []
        gone: set[int] = set()
        for plane in sorted(self._unchecked & self._support.keys()):
            normal, _ = self._estimates.plane(plane)
            middle = self._views[plane].points.mean(axis=0)
            for other in self._near(normal, middle).tolist():
                if other == plane or {plane, other} & gone or not self._is_one(plane, other, last):
                    continue
                pairs.append((min(plane, other), max(plane, other)))
                gone.add(max(plane, other))
        self._unchecked = set()
        return pairs

    def _is_one(self, a: int, b: int, last: bool) -> bool:
        """Are two planes one, by what is known of both where the smaller one lies?"""
        config = self._config.association
        if self._support[a].shown < self._support[b].shown:
            a, b = b, a
        (normal, d), chart = self._estimates.plane(b), self._estimates.chart(a)
        points = self._views[b].points
        centroid = points.mean(axis=0)
        centroid = centroid - (normal @ centroid + d) * normal
        off = difference(chart, self._estimates.plane(a), normal, centroid)
        if np.hypot(off[0], off[1]) > config.merge_angle or abs(off[2]) > config.merge_distance:
            return False
        place = chart.place(centroid[None])[0]
        others = self._estimates.chart(b).place(centroid[None])[0]
        covariance = self._support[a].belief.covariance(place)
        covariance += self._support[b].belief.covariance(others)
        covariance += np.diag([config.model_angle**2] * 2 + [config.model_distance**2])
        known = last or covariance[2, 2] < config.merge_sigma**2
        close = statistical_distance(off, covariance) < config.merge_chi2
        return known and close and self._meets(a, points)

    def is_one_in_a_room(self, a: int, b: int, apart: float) -> bool:
        """Are two planes of one room one? Two surfaces that face the same way and overlap cannot
        both be seen, unless one is furniture, which stands off by more than ``apart`` [m]."""
        config = self._config.association
        if self._support[a].shown < self._support[b].shown:
            a, b = b, a
        (normal, d), chart = self._estimates.plane(b), self._estimates.chart(a)
        centroid = self._views[b].points.mean(axis=0)
        centroid = centroid - (normal @ centroid + d) * normal
        off = difference(chart, self._estimates.plane(a), normal, centroid)
        near = np.hypot(off[0], off[1]) < config.merge_angle and abs(off[2]) < apart
        along = chart.place(self._views[b].points)[:, 0]
        return bool(near and self._support[a].stretches.gap(along) == 0.0)

    def merge(self, kept: int, gone: int) -> list[Observed]:
        """Moves all support of ``gone`` to ``kept``; returns the observations that moved."""
        into, out = self._support[kept], self._support.pop(gone)
        chart = self._estimates.chart(kept)
        points = self._views.pop(gone).points
        into.stretches.add(chart.place(points)[:, 0])
        into.cells.take(chart.place(points))
        into.coarse_cells.take(chart.place(points))
        into.belief.merge(out.belief, chart, self._estimates.chart(gone))
        into.absorb(out)
        for keyframe in out.keyframes:
            self._of_keyframe[keyframe] = self._of_keyframe[keyframe] - {gone} | {kept}
        self._unchecked = self._unchecked - {gone} | {kept}
        return out.observed

    def doubtful(self, keyframe: int, last: bool = False) -> list[int]:
        """Planes that only one keyframe saw, a while ago, and little of. At the ``last`` keyframe
        all that others had the chance to see again: not those that are seen only now."""
        before = {keyframe - self._config.doubt}
        if last:
            before = set(self._of_keyframe) - {keyframe}
        seen = {plane for k in before for plane in self._of_keyframe.get(k, ())}
        return sorted(plane for plane in seen & self._support.keys() if self._is_doubtful(plane))

    def _is_doubtful(self, plane: int) -> bool:
        support = self._support[plane]
        if len(support.observed) > 1:
            return False
        points = sum(len(chunk.ids) for chunk in support.chunks)
        return points < self._config.doubt_points or self._is_shadow(plane)

    def _is_shadow(self, plane: int) -> bool:
        """Does it lie along a plane that was seen more often, hardly apart, as what a sweep sees
        of it whose motion was wrong?"""
        config = self._config.association
        normal, points = self._estimates.plane(plane)[0], self._views[plane].points
        centroid = points.mean(axis=0)
        for other in self._near(normal, centroid).tolist():
            support, chart = self._support[other], self._estimates.chart(other)
            off = difference(chart, self._estimates.plane(other), normal, centroid)
            near = np.hypot(off[0], off[1]) < config.shadow_angle
            near &= abs(off[2]) < config.shadow_distance
            beside = support.stretches.gap(chart.place(points)[:, 0]) == 0.0
            if len(support.observed) > 1 and near and beside:
                return True
        return False

    def drop(self, plane: int) -> Observed:
        """Forgets a plane that was observed once; returns the observation."""
        self._views.pop(plane)
        self._unchecked.discard(plane)
        return self._support.pop(plane).observed[0]

    # --- views ---

    def refresh(self) -> None:
        """Brings the views of planes up to date that have changed since they were told."""
        moved = self._moved_keyframes()
        stale = {plane for k in np.flatnonzero(moved).tolist() for plane in self._planes_of(k)}
        stale |= set(self._moved_planes()) | {
            plane for plane in self._unchecked if self._support[plane].changed
        }
        for plane in stale & self._support.keys():
            self._tell(plane, moved)

    def _planes_of(self, keyframe: int) -> Iterable[int]:
        return self._of_keyframe.get(keyframe, ())

    def _moved_keyframes(self) -> NDArray[np.bool_]:
        """(K,) which poses differ from what was told; new ones do not count, their planes do."""
        poses = self._estimates.poses
        known = len(self._told_poses)
        moved = np.zeros(len(poses), dtype=bool)
        change = np.abs(poses[:known] - self._told_poses).max(axis=(1, 2), initial=0.0)
        moved[:known] = change > self._config.pose_moved
        told = poses.copy()
        told[:known][~moved[:known]] = self._told_poses[~moved[:known]]
        self._told_poses = told
        return moved

    def _moved_planes(self) -> list[int]:
        """Ids of planes that differ from what was told."""
        estimates = self._estimates
        # Distances are compared where the plane is, not at the map's origin.
        now = np.hstack([estimates.normals, estimates.heights[:, None]])
        known = len(self._told_planes)
        change = np.abs(now[:known] - self._told_planes).max(axis=1, initial=0.0)
        moved = np.ones(len(now), dtype=bool)
        moved[:known] = change > self._config.plane_moved
        told = now.copy()
        told[:known][~moved[:known]] = self._told_planes[~moved[:known]]
        self._told_planes = told
        return np.flatnonzero(moved & estimates.alive).tolist()

    def _tell(self, plane: int, moved: NDArray[np.bool_]) -> None:
        support, old = self._support[plane], self._views.get(plane)
        poses = self._estimates.poses
        normal, d = self._estimates.plane(plane)
        support.changed = False
        self._views[plane] = MapPlane(
            id=plane,
            normal=normal,
            d=d,
            points=np.concatenate([chunk.told(poses, moved) for chunk in support.chunks]),
            point_ids=np.concatenate([chunk.ids[chunk.shown] for chunk in support.chunks]),
            keyframes=np.array(sorted(support.keyframes)),
            revision=1 + (old.revision if old is not None else 0),
        )

    def dense(self) -> list[MapPlane]:
        """All planes with all points that were kept."""
        return [self._dense(plane) for plane in self._support]

    def _dense(self, plane: int) -> MapPlane:
        support, view = self._support[plane], self._views[plane]
        poses = self._estimates.poses
        normal, d = self._estimates.plane(plane)
        points = [transform_points(poses[chunk.keyframe], chunk.points) for chunk in support.chunks]
        return MapPlane(
            id=plane,
            normal=normal,
            d=d,
            points=np.concatenate(points),
            point_ids=np.concatenate([chunk.ids for chunk in support.chunks]),
            keyframes=np.array(sorted(support.keyframes)),
            revision=view.revision,
        )

    def view(self, plane: int) -> MapPlane:
        """The plane as it was at the last ``refresh``."""
        return self._views[plane]

    def views(self) -> list[MapPlane]:
        """All planes as they were at the last ``refresh``."""
        return list(self._views.values())


def _hull(a: tuple[float, float], b: tuple[float, float]) -> tuple[float, float]:
    return min(a[0], b[0]), max(a[1], b[1])
