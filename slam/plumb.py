"""Which way is up, by the walls: they are plumb on every storey and beside every ramp."""

from __future__ import annotations

import numpy as np

from slam.core import Array

FIRST = 5
"""Keyframes that tell it; later ones are compared with them."""
LEVEL = np.radians(2.0)
"""A frame is that of a base which stood level. What leans more in it, while nothing else is known,
is no wall: sheets that lean in a row, say."""


class Up:
    """The direction in which plumb walls run in a frame whose z is about that."""

    def __init__(self) -> None:
        self._seen: list[Array] = []

    def compared(self, T_frame_base: Array, plumb: Array) -> Array | None:
        """(3,) unit, in the frame; None to the first keyframes, which tell it. plumb: what one saw
        from a pose (4, 4), see ``KeyframeScan``."""
        if len(self._seen) < FIRST:
            seen = T_frame_base[:3, :3] @ plumb
            if seen[2] > np.cos(LEVEL):
                self._seen.append(seen)
            return None
        up = np.mean(self._seen, axis=0)
        return np.asarray(up / np.linalg.norm(up))
