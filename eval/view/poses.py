"""Poses of a body that moves, sent some at a time: one message costs as much as ten poses."""

from __future__ import annotations

from typing import Any

import numpy as np
import rerun as rr

from slam.core import Array


class Poses:
    """Poses that wait to be sent, each with its place on both timelines."""

    def __init__(self, entity: str) -> None:
        self._entity = entity
        self._waiting: list[tuple[float, int, Array]] = []

    def add(self, stamp: float, keyframe: int, T_parent_body: Array) -> None:
        """One more."""
        self._waiting.append((stamp, keyframe, T_parent_body))

    def send(self, stream: Any) -> None:
        """Sends what waits."""
        if not self._waiting:
            return
        stamps, keyframes, poses = zip(*self._waiting, strict=True)
        self._waiting = []
        T = np.array(poses)
        stream.send_columns(
            self._entity,
            [
                rr.TimeColumn("sim_time", duration=stamps),
                rr.TimeColumn("keyframe", sequence=keyframes),
            ],
            rr.Transform3D.columns(translation=T[:, :3, 3], mat3x3=T[:, :3, :3]),
        )
