"""What is true of a scan, kept apart from the scan itself: only the evaluation may read it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from slam.core import Array


@dataclass(frozen=True)
class ScanTruth:
    """The truth beside one ``Scan``; arrays run parallel to ``scan.points``.

    T_world_base: the base at the sweep's END; face: (N,) int32, the true face that each return was
    cast on or a negative label of ``worlds.truth``; geom: (N,) int32, MuJoCo's geom;
    points_world: (N, 3) float32, the measured return at the true pose of its own instant.
    """

    T_world_base: Array
    face: NDArray[np.int32]
    geom: NDArray[np.int32]
    points_world: NDArray[np.float32]
