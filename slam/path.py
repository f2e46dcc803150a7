"""The way of the base: a pose for every scan, between the keyframes that the graph estimates."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from slam.core import Array, Frame, interpolate, inverse, pose

Anchor = tuple[int, Array]
"""A keyframe of the graph, and where (4, 4) another frame is in its frame."""


class Path:
    """Every frame in order, and where it was thought to be when it came."""

    def __init__(self) -> None:
        self._frames: list[Frame] = []
        self._online: list[Array] = []
        self._anchors: list[tuple[int, int, Array]] = []

    def add(self, frame: Frame, T_map_base: Array, anchor: Anchor | None) -> None:
        """The next frame, and its pose as it is known now (its planes are not kept). anchor: of a
        frame that is a keyframe, or has been seen to stand near one."""
        if anchor is not None:
            self._anchors.append((len(self._frames), *anchor))
        self._frames.append(replace(frame, keyframe=None))
        self._online.append(T_map_base)

    @property
    def stamp(self) -> float:
        """The end of the last sweep [s]."""
        return self._frames[-1].stamp

    def latest(self) -> Array:
        """T_map_base (4, 4) of the last frame as it was known when it came."""
        return self._online[-1]

    def stamps(self) -> Array:
        """(N,) the end of every sweep [s]."""
        return np.array([frame.stamp for frame in self._frames])

    def odometry(self) -> Array:
        """(N, 4, 4) T_odom_base of every frame."""
        return np.array([frame.T_odom_base for frame in self._frames])

    def online(self) -> Array:
        """(N, 4, 4) T_map_base of every frame as it was known when it came."""
        return np.array(self._online)

    def trajectory(self, keyframe_poses: Array) -> Array:
        """(N, 4, 4) T_map_base of every frame, from those of the keyframes (K, 4, 4).

        Between two anchored frames the correction of the tracking goes over from one's to the
        other's.
        """
        first = np.array([place for place, _, _ in self._anchors])
        corrections = [
            keyframe_poses[keyframe] @ T_keyframe_base @ inverse(self._frames[place].T_track_base)
            for place, keyframe, T_keyframe_base in self._anchors
        ]
        poses = []
        for place, frame in enumerate(self._frames):
            before = int(np.searchsorted(first, place, side="right")) - 1
            after = min(before + 1, len(first) - 1)
            span = first[after] - first[before]
            fraction = (place - first[before]) / span if span else 0.0
            T_map_track = _between(corrections[before], corrections[after], fraction)
            poses.append(T_map_track @ frame.T_track_base)
        return np.array(poses)


def _between(T_before: Array, T_after: Array, fraction: float) -> Array:
    """(4, 4) a fraction of the way from one motion to the other."""
    rotations, translations = interpolate(T_before, T_after, np.array([fraction]))
    return pose(rotations[0], translations[0])
