"""A building as built from a plan: its geometry, its MuJoCo model and its truth."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import mujoco
import numpy as np
import shapely
from numpy.typing import NDArray
from shapely.geometry import MultiPolygon, Polygon

from slam.core import Array, InputError
from worlds.conditions import AS_BUILT, Conditions
from worlds.drafting import as_multipolygon
from worlds.fittings import Fitting
from worlds.furnishing import furnished
from worlds.layout import lay_out
from worlds.model import Slab, building_spec, slabs, with_holes
from worlds.people import Person, add_people, gathered
from worlds.plan import Plan, Ramp, Storey
from worlds.ramps import down_to_ceiling, ramp_holes, ramp_solids
from worlds.redrawn import redrawn
from worlds.solids import Solid, wall_solids
from worlds.survey import BuiltStorey, as_built, survey
from worlds.truth import CEILING, GLASS, Truth


@dataclass(frozen=True)
class Mesh:
    """All surfaces of a world, the same as in its MuJoCo model.

    vertices: (V, 3) float64, world frame [m]; triangles: (T, 3), outward; face: (T,) the face id or
    negative label of ``worlds.truth``; geom_name: (T,) index into geom_names, the MuJoCo geom that
    holds the triangle; glass: (T,) whether it is a pane. People move, and are not in it.
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

    spec: the building and its people; whoever adds a base does so to a copy. footprints: per storey
    of the plan, what nobody drives through: the walls at floor level with the passable openings
    taken out, and what stands there (empty if it was not built); ramps: those that were built;
    fittings: what stands there; people: who walk about (where they walk is up to the simulation).
    """

    plan: Plan
    truth: Truth
    spec: mujoco.MjSpec
    mesh: Mesh
    footprints: tuple[MultiPolygon, ...]
    ramps: tuple[Ramp, ...] = ()
    fittings: tuple[Fitting, ...] = ()
    people: tuple[Person, ...] = ()


@dataclass(frozen=True)
class _Content:
    """What a building is made of, people apart. parts: the storeys that are built."""

    truth: Truth
    parts: tuple[BuiltStorey, ...]
    solids: tuple[Solid, ...]
    plates: tuple[Slab, ...]
    fittings: tuple[Fitting, ...]
    footprints: tuple[MultiPolygon, ...]


def build_world(
    plan: Plan,
    seed: np.random.SeedSequence,
    conditions: Conditions = AS_BUILT,
    storey: int | None = None,
) -> World:
    """The world that a plan becomes; ``storey`` builds that one only, without ramps.

    The same seed builds the same world, and a storey does not depend on the others.
    """
    ramps = plan.ramps if storey is None else ()
    content = _content(plan, seed, conditions, _wanted(plan, storey), ramps)
    people: list[Person] = []
    for part in content.parts:
        people += gathered(
            [room for room in content.truth.rooms if room.storey == part.index],
            content.footprints[part.index],
            (part.layout.storey.z_floor, part.layout.storey.z_ceiling),
            conditions.people,
            _rng(seed, part.index, _PEOPLE),
        )
    spec = building_spec(plan.name, content.solids, content.plates, content.fittings)
    add_people(spec, people)
    return World(
        plan=plan,
        truth=content.truth,
        spec=spec,
        mesh=_mesh_of(content),
        footprints=content.footprints,
        ramps=ramps,
        fittings=content.fittings,
        people=tuple(people),
    )


def _content(
    plan: Plan,
    seed: np.random.SeedSequence,
    conditions: Conditions,
    wanted: Sequence[int],
    ramps: tuple[Ramp, ...],
) -> _Content:
    parts = [_built(plan, index, seed, conditions) for index in wanted]
    truth, labels = survey(parts)
    solids: list[Solid] = []
    plates: list[Slab] = []
    fittings: list[Fitting] = []
    footprints = [MultiPolygon()] * len(plan.storeys)
    for part, label in zip(parts, labels, strict=True):
        prefix = f"s{part.index}_"
        drawn = part.layout.storey
        solids += wall_solids(part.layout, part.built, label, prefix)
        missing = _holes(part, truth, conditions, _rng(seed, part.index, _CEILINGS))
        for plate in slabs(_bounds(drawn), drawn.z_floor, drawn.z_ceiling, prefix):
            holes = ramp_holes(part.index, plate, ramps)
            if plate.label == CEILING:
                holes += missing
            elif holes:
                plate = down_to_ceiling(plan, part.index, plate)
            solids += with_holes(plate, holes) if holes else []
            plates += [] if holes else [plate]
        standing = furnished(part, truth, conditions, _rng(seed, part.index, _FITTINGS))
        footprints[part.index] = _footprint(part, standing)
        fittings += standing
    solids += ramp_solids(plan, ramps)
    return _Content(
        truth, tuple(parts), tuple(solids), tuple(plates), tuple(fittings), tuple(footprints)
    )


def _mesh_of(content: _Content) -> Mesh:
    boxes = [plate.solid() for plate in content.plates]
    boxes += [solid for fitting in content.fittings for solid in fitting.solids()]
    return _mesh([*content.solids, *boxes])


def true_mesh(
    plan: Plan, seed: np.random.SeedSequence, conditions: Conditions, storey: int | None = None
) -> tuple[Truth, Mesh]:
    """Truth and surfaces of ``build_world`` without the rest: what training sets are made from."""
    ramps = plan.ramps if storey is None else ()
    content = _content(plan, seed, conditions, _wanted(plan, storey), ramps)
    return content.truth, _mesh_of(content)


def true_world(plan: Plan, seed: np.random.SeedSequence, conditions: Conditions) -> Truth:
    """The truth of ``build_world`` without the world."""
    return survey([_built(plan, index, seed, conditions) for index in _wanted(plan, None)])[0]


def _wanted(plan: Plan, storey: int | None) -> Sequence[int]:
    if storey is None:
        return range(len(plan.storeys))
    if not 0 <= storey < len(plan.storeys):
        raise InputError(
            f'plan "{plan.name}": storey {storey}: expected {_places(len(plan.storeys))}'
        )
    return [storey]


def _places(storeys: int) -> str:
    return f"0 to {storeys - 1}" if storeys > 1 else "0, its only one"


def _built(
    plan: Plan, index: int, seed: np.random.SeedSequence, conditions: Conditions
) -> BuiltStorey:
    layout = lay_out(redrawn(plan.storeys[index], conditions, _rng(seed, index, _PLAN)))
    return as_built(index, layout, conditions, _rng(seed, index))


_PLAN, _CEILINGS, _FITTINGS, _PEOPLE = range(4)
"""What else than the walls of a storey is drawn at random."""


def _rng(seed: np.random.SeedSequence, *key: int) -> np.random.Generator:
    """Not seed.spawn(): that would make a second call with the same seed build another world."""
    own = np.random.SeedSequence(seed.entropy, spawn_key=(*seed.spawn_key, *key))
    return np.random.default_rng(own)


def _holes(
    part: BuiltStorey, truth: Truth, conditions: Conditions, rng: np.random.Generator
) -> list[Polygon]:
    """The rooms of a storey that have no ceiling."""
    rooms = [room for room in truth.rooms if room.storey == part.index]
    open_ = rng.random(len(rooms)) < conditions.no_ceiling
    return [room.polygon for room, above in zip(rooms, open_, strict=True) if above]


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
    face = np.concatenate([solid.face for solid in solids])
    return Mesh(
        vertices=np.concatenate([solid.vertices for solid in solids]),
        triangles=np.concatenate(triangles).astype(np.int32),
        face=face,
        geom_name=np.repeat(np.arange(len(solids), dtype=np.int32), counts),
        geom_names=tuple(solid.name for solid in solids),
        glass=face == GLASS,
    )


def _footprint(part: BuiltStorey, fittings: Sequence[Fitting]) -> MultiPolygon:
    walls = [part.built.place_polygon(p, 0.0) for p in part.layout.open_cut.geoms]
    if not fittings:
        return as_multipolygon(MultiPolygon(walls))
    standing = [fitting.footprint for fitting in fittings]
    return as_multipolygon(shapely.union_all([*walls, *standing]))
