"""Keyframes: which of their observations are planes at all, and all of them with their poses."""

from __future__ import annotations

import logging
from collections.abc import Sequence
from typing import overload

import numpy as np

from slam.core import Array, Frame, Keyframe, KeyframeScan, PlaneObservation
from slam.storeys import Storeys

log = logging.getLogger(__name__)


def usable_planes(keyframe: int, scan: KeyframeScan) -> list[tuple[int, PlaneObservation]]:
    """A keyframe's observations that are planes, each with its place among all of them."""
    usable = [(place, o) for place, o in enumerate(scan.planes) if _usable(o)]
    if len(usable) < len(scan.planes):
        count = len(scan.planes) - len(usable)
        log.warning("keyframe %d: %d observations are no planes: left out", keyframe, count)
    return usable


def _usable(observation: PlaneObservation) -> bool:
    """Is it a plane at all: finite, with a direction, points, and a covariance that is one?"""
    o = observation
    finite = all(np.isfinite(part).all() for part in (o.normal, o.d, o.centroid, o.covariance))
    if not finite or len(o.points) == 0 or not np.isfinite(o.points).all():
        return False
    upright = abs(float(np.linalg.norm(o.normal)) - 1.0) < 1e-6
    return upright and bool(np.linalg.eigvalsh(o.covariance)[0] > 0.0)


class Keyframes(Sequence[Keyframe]):
    """Keyframes that are made when they are looked at: there may be thousands. poses: (K, 4, 4)."""

    def __init__(self, frames: list[Frame], poses: Array, storeys: Storeys):
        self._frames = frames
        self._poses = poses
        self._storeys = storeys

    def __len__(self) -> int:
        return len(self._poses)

    @overload
    def __getitem__(self, place: int) -> Keyframe: ...
    @overload
    def __getitem__(self, place: slice) -> list[Keyframe]: ...
    def __getitem__(self, place: int | slice) -> Keyframe | list[Keyframe]:
        if isinstance(place, slice):
            return [self[k] for k in range(*place.indices(len(self)))]
        k = range(len(self))[place]
        frame = self._frames[k]
        assert frame.keyframe is not None
        storey = self._storeys.of(k)
        return Keyframe(k, frame.index, frame.stamp, self._poses[k], frame.keyframe, storey)
