"""The plane map: which observations are of one plane, and the points each plane was built from.

Geometry only: the graph holds the estimates, this holds what supports them.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field

import numpy as np

from slam.association import AssociationConfig, in_chart
from slam.core import Array, MapPlane, PlaneObservation, transform_points
from slam.estimates import Estimates
from slam.likeness import Likeness
from slam.planeviews import PlaneViews
from slam.support import Observed, Support


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


class PlaneMap:
    """Mapped planes by id, with what supports each."""

    def __init__(self, estimates: Estimates, config: PlaneMapConfig = PlaneMapConfig()):
        self._config = config
        self._estimates = estimates
        self._supports: dict[int, Support] = {}
        self._views = PlaneViews(estimates, config.plane_moved, config.pose_moved)
        self._likeness = Likeness(estimates, self._supports, self._views, config.association)
        self._of_keyframe: dict[int, set[int]] = {}
        self._unchecked: set[int] = set()
        self._lost = 0

    def __iter__(self) -> Iterator[int]:
        return iter(self._supports)

    def __len__(self) -> int:
        return len(self._supports)

    def __contains__(self, plane: object) -> bool:
        return plane in self._supports

    @property
    def lost(self) -> int:
        """How many planes have been merged or dropped so far."""
        return self._lost

    # --- what is seen ---

    def associate(
        self, T_map_base: Array, observations: Sequence[PlaneObservation], way: float, storey: int
    ) -> tuple[Array, list[int | None]]:
        """The pose aligned to the planes that are seen, and the plane of each observation, or None
        (see ``Likeness``). way: driven so far [m]."""
        return self._likeness.associate(T_map_base, observations, way, storey)

    def new_plane(self, plane: int, storey: int) -> None:
        """A plane that nothing supports yet, seen from a storey."""
        config = self._config
        self._supports[plane] = Support(config.voxel, config.coarse_voxel, config.grown, storey)

    def support(
        self, plane: int, observed: Observed, scan_index: int, T_map_base: Array, way: float
    ) -> None:
        """Adds an observation to a plane; of its points those that the plane does not have yet."""
        support, chart = self._supports[plane], self._estimates.chart(plane)
        observation = observed.observation
        points = transform_points(T_map_base, observation.points)
        support.add(observed, scan_index, points, chart.place(points))
        support.seen_at = way
        centroid = chart.place(transform_points(T_map_base, observation.centroid)[None])[0]
        support.belief.add(chart, centroid, in_chart(chart, T_map_base, observation))
        self._of_keyframe.setdefault(observed.keyframe, set()).add(plane)
        self._unchecked.add(plane)

    def times_seen(self, plane: int) -> int:
        """How many observations support a plane."""
        return len(self._supports[plane].observed)

    # --- planes that are one ---

    def duplicates(self, last: bool = False) -> list[tuple[int, int]]:
        """Pairs (kept, gone) of planes that are one: same side, coplanar where they meet. Looks at
        planes that were observed since the last call; the ``last`` time at all of them."""
        if last:
            self._unchecked = set(self._supports)
        pairs: list[tuple[int, int]] = []
        gone: set[int] = set()
        for plane in sorted(self._unchecked & self._supports.keys()):
            middle = self._views[plane].points.mean(axis=0)
            normal, storey = self._estimates.normals[plane], self._supports[plane].storey
            for other in self._likeness.near(normal, middle, storey):
                known = other == plane or bool({plane, other} & gone)
                if not known and self._likeness.are_one(plane, other, last):
                    pairs.append((min(plane, other), max(plane, other)))
                    gone.add(max(plane, other))
        self._unchecked = set()
        return pairs

    def is_one_in_a_room(self, a: int, b: int, apart: float) -> bool:
        """Are two planes of one room one? See ``Likeness``."""
        return self._likeness.are_one_in_a_room(a, b, apart)

    def merge(self, kept: int, gone: int) -> list[Observed]:
        """Moves all support of ``gone`` to ``kept``; returns the observations that moved."""
        self._lost += 1
        into, out = self._supports[kept], self._supports.pop(gone)
        chart = self._estimates.chart(kept)
        into.absorb(out, chart.place(self._views.pop(gone).points))
        into.belief.merge(out.belief, chart, self._estimates.chart(gone))
        for keyframe in out.keyframes:
            self._of_keyframe[keyframe] = self._of_keyframe[keyframe] - {gone} | {kept}
        self._unchecked = self._unchecked - {gone} | {kept}
        return out.observed

    # --- planes that are none ---

    def doubtful(self, keyframe: int, last: bool = False) -> list[int]:
        """Planes that only one keyframe saw, a while ago, and little of. At the ``last`` keyframe
        all that others had the chance to see again: not those that are seen only now."""
        before = {keyframe - self._config.doubt}
        if last:
            before = set(self._of_keyframe) - {keyframe}
        seen = {plane for k in before for plane in self._of_keyframe.get(k, ())}
        return sorted(plane for plane in seen & self._supports.keys() if self._is_doubtful(plane))

    def _is_doubtful(self, plane: int) -> bool:
        support = self._supports[plane]
        if len(support.observed) > 1:
            return False
        little = support.point_count < self._config.doubt_points
        return little or self._likeness.is_shadow(plane)

    def drop(self, plane: int) -> Observed:
        """Forgets a plane that was observed once; returns the observation."""
        self._lost += 1
        self._views.pop(plane)
        self._unchecked.discard(plane)
        return self._supports.pop(plane).observed[0]

    # --- views ---

    def refresh(self) -> None:
        """Brings the views of planes up to date that have changed since they were told."""
        moved = self._views.moved_keyframes()
        stale = {p for k in np.flatnonzero(moved).tolist() for p in self._of_keyframe.get(k, ())}
        stale |= set(self._views.moved_planes())
        stale |= {plane for plane in self._unchecked if self._supports[plane].changed}
        self._views.tell(stale & self._supports.keys(), self._supports, moved)

    def dense(self) -> list[MapPlane]:
        """All planes with all points that were kept."""
        return self._views.dense(self._supports)

    def view(self, plane: int) -> MapPlane:
        """The plane as it was at the last ``refresh``."""
        return self._views[plane]

    def views(self) -> list[MapPlane]:
        """All planes as they were at the last ``refresh``."""
        return self._views.all()
