"""How a frame moved during a sweep."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from slam.core import Array, quaternion_log, quaternion_xyzw, so3_exp


@dataclass(frozen=True)
class Motion:
    """Poses (K, 4, 4) of a frame in the world at rising stamps (K,) [s], K >= 2.

    Between two stamps the frame moves with constant linear and angular velocity: that is the
    truth, not an approximation of it, since every ray is cast from a pose found this way.
    """

    stamps: Array
    poses: Array

    def at(self, stamps: Array) -> tuple[Array, Array]:
        """Rotations (N, 3, 3) and translations (N, 3) at ``stamps`` (N,)."""
        k = np.clip(np.searchsorted(self.stamps, stamps, "right") - 1, 0, len(self.stamps) - 2)
        fraction = (stamps - self.stamps[k]) / (self.stamps[k + 1] - self.stamps[k])
        start, end = self.poses[:-1], self.poses[1:]
        deltas = np.swapaxes(start[:, :3, :3], 1, 2) @ end[:, :3, :3]
        turns = np.stack([quaternion_log(quaternion_xyzw(delta)) for delta in deltas])
        moves = end[:, :3, 3] - start[:, :3, 3]
        rotations = start[k, :3, :3] @ so3_exp(fraction[:, None] * turns[k])
        return rotations, start[k, :3, 3] + fraction[:, None] * moves[k]

    def seen_from(self, T_frame_other: Array) -> Motion:
        """The motion of another frame that is fixed to this one."""
        return Motion(self.stamps, self.poses @ T_frame_other)
