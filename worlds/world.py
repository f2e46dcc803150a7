"""A building as built from a plan: its geometry, its MuJoCo model and its truth."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import mujoco
import numpy as np
from numpy.typing import NDArray
from shapely.geometry import MultiPolygon

from slam.core import Array, InputError
from worlds.asbuilt import build_walls
from worlds.conditions import AS_BUILT, Conditions
from worlds.drafting import as_multipolygon
from worlds.layout import lay_out
from worlds.model import Slab, building_spec, slabs
from worlds.plan import Plan, Storey
from worlds.solids import Solid, wall_solids
from worlds.survey import BuiltStorey, survey
from worlds.truth import Truth


@dataclass(frozen=True)
class Mesh:
    """All surfaces of a world, the same as in its MuJoCo model.

    vertices: (V, 3) float64, world frame [m]; triangles: (T, 3), outward; face: (T,) the face id or
    negative label of ``worlds.truth``; geom_name: (T,) index into geom_names, the MuJoCo geom that
    holds the triangle; glass: (T,) whether it is a pane.
    """

    vertices: Array
    triangles: NDArray[np.int32]
    face: NDArray[np.int32]
    geom_name: NDArray[np.int32]
    geom_names: tuple[str, ...]
    glass: NDArray[np.bool_]


@dataclass(frozen=True)
class World:
    """A building as built.

    spec: the building only; whoever adds a base does so to a copy. footprints: per storey of the
    plan, the walls at floor level with the passable openings taken out (empty if it was not built).
    """

    plan: Plan
    truth: Truth
    spec: mujoco.MjSpec
    mesh: Mesh
    footprints: tuple[MultiPolygon, ...]


def build_world(
    plan: Plan,
    seed: np.random.SeedSequence,
    conditions: Conditions = AS_BUILT,
    storey: int | None = None,
) -> World:
    """The world that a plan becomes; ``storey`` builds that one only.

    The same seed builds the same world, and a storey does not depend on the others.
    """
    storeys = [_built(plan, index, seed, conditions) for index in _wanted(plan, storey)]
    truth, labels = survey(storeys)
    solids: list[Solid] = []
    plates: list[Slab] = []
    for part, label in zip(storeys, labels, strict=True):
        prefix = f"s{part.index}_"
        drawn = part.layout.storey
        solids += wall_solids(part.layout, part.built, label, prefix)
        plates += slabs(_bounds(drawn), drawn.z_floor, drawn.z_ceiling, prefix)
    return World(
        plan=plan,
        truth=truth,
        spec=building_spec(plan.name, solids, plates),
        mesh=_mesh([*solids, *(plate.solid() for plate in plates)]),
        footprints=_footprints(plan, storeys),
    )


def true_world(plan: Plan, seed: np.random.SeedSequence, conditions: Conditions) -> Truth:
    """The truth of ``build_world`` without the world: what training sets are made from."""
    return survey([_built(plan, index, seed, conditions) for index in _wanted(plan, None)])[0]


def _wanted(plan: Plan, storey: int | None) -> Sequence[int]:
    if storey is None:
        return range(len(plan.storeys))
    if not 0 <= storey < len(plan.storeys):
        raise InputError(
            f'plan "{plan.name}": storey {storey}: expected 0 to {len(plan.storeys) - 1}'
        )
    return [storey]


def _built(
    plan: Plan, index: int, seed: np.random.SeedSequence, conditions: Conditions
) -> BuiltStorey:
    # Not seed.spawn(): that would make a second call with the same seed build another world.
    own = np.random.SeedSequence(seed.entropy, spawn_key=(*seed.spawn_key, index))
    layout = lay_out(plan.storeys[index])
    built = build_walls(
        layout.outline, layout.cut, layout.height, conditions, np.random.default_rng(own)
    )
    return BuiltStorey(index, layout, built)


def _bounds(storey: Storey) -> Array:
    """(4,) min x, min y, max x, max y of walls and rooms."""
    shapes = [shape.bounds for shape in (storey.walls, *(room.outline for room in storey.rooms))]
    boxes = np.array([box for box in shapes if np.isfinite(box).all()]).reshape(-1, 4)
    if not len(boxes):
        return np.zeros(4)
    return np.concatenate([boxes[:, :2].min(axis=0), boxes[:, 2:].max(axis=0)])


def _mesh(solids: Sequence[Solid]) -> Mesh:
    sizes = [len(solid.vertices) for solid in solids]
    offsets = np.cumsum(sizes) - sizes
    counts = [len(solid.triangles) for solid in solids]
    triangles = [solid.triangles + offset for solid, offset in zip(solids, offsets, strict=True)]
    return Mesh(
        vertices=np.concatenate([solid.vertices for solid in solids]),
        triangles=np.concatenate(triangles).astype(np.int32),
        face=np.concatenate([solid.face for solid in solids]),
        geom_name=np.repeat(np.arange(len(solids), dtype=np.int32), counts),
        geom_names=tuple(solid.name for solid in solids),
        glass=np.zeros(sum(counts), dtype=bool),
    )


def _footprints(plan: Plan, storeys: Sequence[BuiltStorey]) -> tuple[MultiPolygon, ...]:
    found = {
        part.index: as_multipolygon(
            MultiPolygon([part.built.place_polygon(p, 0.0) for p in part.layout.open_cut.geoms])
        )
        for part in storeys
    }
    return tuple(found.get(index, MultiPolygon()) for index in range(len(plan.storeys)))
