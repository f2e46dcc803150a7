"""The building as a MuJoCo model: every solid a mesh geom, floors and ceilings as boxes."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import mujoco
import numpy as np
import shapely
from shapely.geometry import Polygon

from slam.core import Array
from worlds.convex import ConvexPart, convex_parts
from worlds.drafting import as_multipolygon
from worlds.fittings import BOX_CORNERS, BOX_TRIANGLES, Fitting
from worlds.solids import Solid, prism
from worlds.truth import CEILING, FLOOR, GLASS, NO_FACE

SLAB = 0.1
"""Thickness of floors and ceilings [m]."""
MARGIN = 2.0
"""Floors and ceilings reach this far beyond the outermost walls [m]."""
WALL_RGBA = (0.82, 0.80, 0.76, 1.0)
SLAB_RGBA = (0.55, 0.55, 0.57, 1.0)
FITTING_RGBA = (0.62, 0.47, 0.33, 1.0)
GLASS_RGBA = (0.60, 0.80, 0.90, 0.30)
"""Not wholly transparent: rays pass through what is."""


@dataclass(frozen=True)
class Slab:
    """A level box. low, high: (3,) its corners in the world frame; label: FLOOR or CEILING."""

    name: str
    low: Array
    high: Array
    label: int

    def solid(self) -> Solid:
        """The same box as triangles."""
        vertices = (self.low + self.high) / 2.0 + BOX_CORNERS * (self.high - self.low) / 2.0
        return Solid(self.name, vertices, BOX_TRIANGLES, np.full(12, self.label, dtype=np.int32))


def slabs(bounds: Array, z_floor: float, z_ceiling: float, prefix: str) -> tuple[Slab, Slab]:
    """Floor and ceiling over bounds (min x, min y, max x, max y) and a margin."""
    low, high = bounds[:2] - MARGIN, bounds[2:] + MARGIN
    levels = ((z_floor - SLAB, z_floor), (z_ceiling, z_ceiling + SLAB))
    floor, ceiling = ((np.append(low, bottom), np.append(high, top)) for bottom, top in levels)
    return Slab(f"{prefix}floor", *floor, FLOOR), Slab(f"{prefix}ceiling", *ceiling, CEILING)


def with_holes(plate: Slab, holes: Sequence[Polygon]) -> list[Solid]:
    """What holes leave of a level box, as prisms; the edges of the holes are neither floor nor
    ceiling."""
    whole = shapely.box(*plate.low[:2], *plate.high[:2])
    convex = convex_parts(as_multipolygon(whole.difference(shapely.union_all(holes))))
    return [
        _prism(f"{plate.name}_{k}", plate, convex.points, part)
        for k, part in enumerate(convex.parts)
    ]


def _prism(name: str, plate: Slab, points: Array, part: ConvexPart) -> Solid:
    ring, count = list(part.ring), len(part.ring)
    caps = np.array([[ring.index(corner) for corner in triangle] for triangle in part.triangles])
    low, high = (
        np.column_stack([points[ring], np.full(count, level[2])])
        for level in (plate.low, plate.high)
    )
    return prism(name, low, high, np.full(count, NO_FACE), caps, plate.label)


def building_spec(
    name: str, solids: Sequence[Solid], plates: Sequence[Slab], fittings: Sequence[Fitting] = ()
) -> mujoco.MjSpec:
    """The building as a specification that compiles, and to which bodies can be added.

    Every geom collides and is visible: rays see no others.
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
    for fitting in fittings:
        _add_fitting(spec, fitting)
    return spec


def _add_fitting(spec: mujoco.MjSpec, fitting: Fitting) -> None:
    for k, block in enumerate(fitting.blocks):
        quaternion_wxyz = np.empty(4)
        mujoco.mju_mat2Quat(quaternion_wxyz, block.rotation.ravel())
        spec.worldbody.add_geom(
            name=f"{fitting.name}_{k}",
            type=mujoco.mjtGeom.mjGEOM_BOX,
            pos=block.centre,
            size=block.half,
            quat=quaternion_wxyz,
            rgba=GLASS_RGBA if fitting.label == GLASS else FITTING_RGBA,
            contype=1,
            conaffinity=1,
        )


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
        rgba=GLASS_RGBA if (solid.face == GLASS).all() else WALL_RGBA,
        contype=1,
        conaffinity=1,
    )
