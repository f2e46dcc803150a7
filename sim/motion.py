"""How a frame moved during a sweep."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from slam.core import Array, skew


@dataclass(frozen=True)
class Motion:
    """Poses (K, 4, 4) of a frame in the world at rising stamps (K,) [s], K >= 2.

    Between two stamps, less than half a turn apart, the frame moves with constant linear and
    angular velocity: that is the truth, not an approximation of it, since every ray is cast from a
    pose found this way.
    """

    stamps: Array
    poses: Array

    def at(self, stamps: Array) -> tuple[Array, Array]:
        """Rotations (N, 3, 3) and translations (N, 3) at ``stamps`` (N,)."""
        k = np.clip(np.searchsorted(self.stamps, stamps, "right") - 1, 0, len(self.stamps) - 2)
        fraction = (stamps - self.stamps[k]) / (self.stamps[k + 1] - self.stamps[k])
        start, end = self.poses[:-1, :3, :3], self.poses[1:, :3, :3]
        axes, angles = _axes_and_angles(np.swapaxes(start, 1, 2) @ end)
        # Rodrigues' formula with what does not depend on the fraction taken together.
        turn = (fraction * angles[k])[:, None, None]
        once, twice = start @ axes, start @ axes @ axes
        rotations = start[k] + np.sin(turn) * once[k] + (1.0 - np.cos(turn)) * twice[k]
        moves = np.diff(self.poses[:, :3, 3], axis=0)
        return rotations, self.poses[k, :3, 3] + fraction[:, None] * moves[k]

    def seen_from(self, T_frame_other: Array) -> Motion:
        """The motion of another frame that is fixed to this one."""
        return Motion(self.stamps, self.poses @ T_frame_other)


def _axes_and_angles(rotations: Array) -> tuple[Array, Array]:
    """Cross-product matrices (K, 3, 3) of the unit axes, and angles (K,) in [0, pi), of rotations
    (K, 3, 3); where there is no turn, the axis is zero."""
    lean = rotations - np.swapaxes(rotations, 1, 2)
    twice = np.stack([lean[:, 2, 1], lean[:, 0, 2], lean[:, 1, 0]], axis=1)
    sine = 0.5 * np.linalg.norm(twice, axis=1)
    cosine = 0.5 * (np.trace(rotations, axis1=1, axis2=2) - 1.0)
    axes = 0.5 * twice / np.maximum(sine, 1e-300)[:, None]
    return skew(axes), np.arctan2(sine, cosine)
