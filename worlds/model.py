"""The building as a MuJoCo model: every solid a mesh geom, floors and ceilings as boxes."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import mujoco
import numpy as np

from slam.core import Array
from worlds.solids import Solid
from worlds.truth import CEILING, FLOOR

SLAB = 0.1
"""Thickness of floors and ceilings [m]."""
MARGIN = 2.0
"""Floors and ceilings reach this far beyond the outermost walls [m]."""
WALL_RGBA = (0.82, 0.80, 0.76, 1.0)
SLAB_RGBA = (0.55, 0.55, 0.57, 1.0)

# Corners of a box count in binary (x lowest); two triangles a side, outward.
BOX_TRIANGLES = np.array(
    [
        [0, 2, 1], [1, 2, 3], [4, 5, 6], [5, 7, 6], [0, 1, 4], [1, 5, 4],
        [2, 6, 3], [3, 6, 7], [0, 4, 2], [2, 4, 6], [1, 3, 5], [3, 7, 5],
    ],
    dtype=np.int32,
)  # fmt: skip


@dataclass(frozen=True)
class Slab:
    """A level box. low, high: (3,) its corners in the world frame; label: FLOOR or CEILING."""

    name: str
    low: Array
    high: Array
    label: int

    def solid(self) -> Solid:
        """The same box as triangles."""
        corners = np.array([[x, y, z] for z in (0, 1) for y in (0, 1) for x in (0, 1)])
        vertices = self.low + corners * (self.high - self.low)
        return Solid(self.name, vertices, BOX_TRIANGLES, np.full(12, self.label, dtype=np.int32))


def slabs(bounds: Array, z_floor: float, z_ceiling: float, prefix: str) -> tuple[Slab, Slab]:
    """Floor and ceiling over bounds (min x, min y, max x, max y) and a margin."""
    low, high = bounds[:2] - MARGIN, bounds[2:] + MARGIN
    levels = ((z_floor - SLAB, z_floor), (z_ceiling, z_ceiling + SLAB))
    floor, ceiling = ((np.append(low, bottom), np.append(high, top)) for bottom, top in levels)
    return Slab(f"{prefix}floor", *floor, FLOOR), Slab(f"{prefix}ceiling", *ceiling, CEILING)


def building_spec(name: str, solids: Sequence[Solid], plates: Sequence[Slab]) -> mujoco.MjSpec:
    """The building as a specification that compiles, and to which bodies can be added.

    Every geom collides and is opaque: rays see no others.
    """
    spec = mujoco.MjSpec()
    spec.modelname = name
    for solid in solids:
        _add_solid(spec, solid)
    for plate in plates:
        spec.worldbody.add_geom(
            name=plate.name,
            type=mujoco.mjtGeom.mjGEOM_BOX,
            pos=(plate.low + plate.high) / 2.0,
            size=(plate.high - plate.low) / 2.0,
            rgba=SLAB_RGBA,
            contype=1,
            conaffinity=1,
        )
    return spec


def _add_solid(spec: mujoco.MjSpec, solid: Solid) -> None:
    mesh = spec.add_mesh(
        name=solid.name, uservert=solid.vertices.ravel(), userface=solid.triangles.ravel()
    )
    # Walls never move; a shell's inertia exists for thin solids too.
    mesh.inertia = mujoco.mjtMeshInertia.mjMESH_INERTIA_SHELL
    spec.worldbody.add_geom(
        name=solid.name,
        type=mujoco.mjtGeom.mjGEOM_MESH,
        meshname=solid.name,
        rgba=WALL_RGBA,
        contype=1,
        conaffinity=1,
    )
