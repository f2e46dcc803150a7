"""What keyframes observed of which planes: one factor a keyframe, made anew when that changes."""

from __future__ import annotations

from collections.abc import Callable

from slam.core import PlaneObservation
from slam.factors import PlaneKey, keyframe_factor
from slam.solver import Solver

SIGHTING = "plane"


class Sightings:
    """The observations that a solver holds, from the next ``settle`` on.

    keyframe_key: the variable of a keyframe; plane_key: that of a plane, and its chart; robust: see
    ``keyframe_factor``.
    """

    def __init__(
        self,
        solver: Solver,
        keyframe_key: Callable[[int], int],
        plane_key: Callable[[int], PlaneKey],
        robust: float,
    ):
        self._solver = solver
        self._keyframe_key = keyframe_key
        self._plane_key = plane_key
        self._robust = robust
        self._of: dict[int, dict[int, tuple[int, PlaneObservation]]] = {}
        self._held: set[int] = set()
        self._changed: set[int] = set()

    def observe(self, keyframe: int, plane: int, observation: PlaneObservation, place: int) -> None:
        """Observation number ``place`` of a keyframe is of a plane, whatever was thought."""
        self._of.setdefault(keyframe, {})[place] = plane, observation
        self._changed.add(keyframe)

    def forget(self, keyframe: int, place: int) -> None:
        """The observation is of nothing."""
        del self._of[keyframe][place]
        self._changed.add(keyframe)

    def settle(self) -> None:
        """Makes anew the factors of keyframes of which something has changed."""
        for keyframe in sorted(self._changed):
            if keyframe in self._held:
                self._solver.remove((SIGHTING, keyframe))
                self._held.discard(keyframe)
            if seen := self._of[keyframe].values():
                planes = [self._plane_key(plane) for plane, _ in seen]
                observations = [observation for _, observation in seen]
                key = self._keyframe_key(keyframe)
                factor = keyframe_factor(key, planes, observations, self._robust)
                self._solver.add((SIGHTING, keyframe), factor)
                self._held.add(keyframe)
        self._changed = set()
