"""Free space of a map that is still being optimised."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Protocol

import numpy as np

from semantics.freespace.gvd import GvdConfig, gvd_of
from semantics.freespace.places import Places, PlacesConfig, places_of
from semantics.freespace.tsdf import Tsdf, TsdfConfig, Volume
from slam.core import Array, MapView


@dataclass(frozen=True)
class SpaceConfig:
    """moved: when a keyframe has moved by more since it was integrated, all are integrated anew
    [m]."""

    tsdf: TsdfConfig = field(default_factory=TsdfConfig)
    gvd: GvdConfig = field(default_factory=GvdConfig)
    places: PlacesConfig = field(default_factory=PlacesConfig)
    moved: float = 0.1


class Space(Protocol):
    """Where a detector reads its places."""

    def add(self, view: MapView) -> bool:
        """The map has a new keyframe, or has moved. Is there anything that ``places`` has not told
        yet?"""
        ...

    def places(self) -> Places:
        """Of all that was added."""
        ...


class Rhythm:
    """When free space is read: every ``period`` seconds, and when a map is shown again that has
    no new keyframe, but more to tell: the last word on it, or on a storey that was left."""

    def __init__(self, period: float):
        self._period = period
        self._read_at = -np.inf
        self._shown: int | None = None

    def due(self, view: MapView, unread: bool) -> bool:
        """Is it to be read on this view? unread: as ``Space.add`` says of it."""
        newest = view.keyframes[-1].id if view.keyframes else None
        last_word = unread and newest == self._shown
        self._shown = newest
        if not last_word and view.stamp - self._read_at < self._period:
            return False
        self._read_at = view.stamp
        return True


class FreeSpace:
    """Integrates each keyframe's scan once, where the keyframe is estimated to be."""

    def __init__(self, config: SpaceConfig = SpaceConfig()):
        self._config = config
        self._tsdf = Tsdf(config.tsdf)
        self._used: dict[int, Array] = {}
        self._unread = False

    def add(self, view: MapView) -> bool:
        """Integrates the keyframes that are new, or all of them anew if some have moved."""
        if any(self._has_moved(keyframe.id, keyframe.T_map_base) for keyframe in view.keyframes):
            self._tsdf, self._used = Tsdf(self._config.tsdf), {}
        for keyframe in view.keyframes:
            if keyframe.id not in self._used:
                T_map_sensor = keyframe.T_map_base.copy()
                T_map_sensor[:3, 3] += T_map_sensor[:3, :3] @ keyframe.scan.origin
                points = np.asarray(keyframe.scan.points) - keyframe.scan.origin
                self._tsdf.integrate(T_map_sensor, points)
                self._used[keyframe.id] = keyframe.T_map_base[:3, 3].copy()
                self._unread = True
        return self._unread

    def _has_moved(self, keyframe: int, T_map_base: Array) -> bool:
        before = self._used.get(keyframe)
        if before is None:
            return False
        return float(np.linalg.norm(T_map_base[:3, 3] - before)) > self._config.moved

    def places(self) -> Places:
        """The graph of places of all that was integrated."""
        self._unread = False
        volume = self.volume()
        return places_of(gvd_of(volume, self._config.gvd), volume, self._config.places)

    def volume(self) -> Volume:
        """The field of all that was integrated."""
        return self._tsdf.volume()
