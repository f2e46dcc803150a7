"""What stands and walks in a building: where it may, as much as asked for, the same every time."""

import numpy as np
import pytest
import shapely
from hypothesis import given, settings
from hypothesis import strategies as st
from shapely.geometry import Point, box

from sim.route import plan_route
from slam.core import InputError
from worlds.catalogue import load_scene
from worlds.conditions import AS_BUILT, CONDITIONS, IDEAL, conditions_named
from worlds.furniture import FURNITURE as FURNITURE_KINDS
from worlds.furniture import SITE
from worlds.generator import random_plan
from worlds.redrawn import partitions, redrawn
from worlds.roomspace import BEFORE_DOOR, RoomSpace
from worlds.truth import CEILING, CLUTTER, FURNITURE, GLASS, LEAF, Door
from worlds.world import build_world

SEED = np.random.SeedSequence(5)


def built(conditions, scene="SE1", seed=SEED):
    return build_world(load_scene(scene), seed, conditions_named(conditions))


# --- names ---------------------------------------------------------------------------------------


def test_presets_are_joined_by_plus_in_any_order():
    both = conditions_named("furniture+people")
    assert both.furniture == CONDITIONS["furniture"].furniture
    assert both.people == CONDITIONS["people"].people
    assert both.yaw == AS_BUILT.yaw
    other = conditions_named("people + furniture")
    assert vars(other) | {"name": ""} == vars(both) | {"name": ""}
    ideal = conditions_named("ideal+clutter")
    assert (ideal.yaw, ideal.thickness, ideal.clutter) == (0.0, 0.0, CONDITIONS["clutter"].clutter)
    assert conditions_named("office") is CONDITIONS["office"]


@pytest.mark.parametrize(
    ("name", "match"),
    [
        ("furnitur+people", "unknown preset 'furnitur'.* \\(did you mean 'furniture'"),
        ("people+", "unknown"),
        ("idel", "ideal"),
        ("", "expected one of: as-built"),
    ],
)
def test_unknown_presets_are_refused(name, match):
    with pytest.raises(InputError, match=match):
        conditions_named(name)


# --- what is built -------------------------------------------------------------------------------


@settings(max_examples=8, deadline=None)
@given(st.integers(0, 100_000), st.sampled_from(["office", "clutter", "furniture", "open-doors"]))
def test_whatever_stands_stands_free_and_every_room_stays_reachable(seed, name):
    plan = random_plan(np.random.default_rng(seed))
    seeds = np.random.SeedSequence(seed)
    world = build_world(plan, seeds, conditions_named(name))
    # The same building without what stands in it.
    bare = build_world(plan, seeds, IDEAL)
    assert set(plan_route(world).unreachable) <= set(plan_route(bare).unreachable)
    rooms = [room.polygon for room in world.truth.rooms]
    prints = [fitting.footprint for fitting in world.fittings]
    for footprint in prints:
        assert any(room.covers(footprint) for room in rooms)
    first, second = shapely.STRtree(prints).query(prints, "intersects") if prints else ([], [])
    assert all(i == j for i, j in zip(first, second, strict=True))
    height = plan.storeys[0].z_ceiling - plan.storeys[0].z_floor
    for fitting in world.fittings:
        z = np.concatenate([block.corners[:, 2] for block in fitting.blocks])
        assert plan.storeys[0].z_floor - 1e-9 <= z.min()
        assert z.max() <= plan.storeys[0].z_floor + height


@pytest.mark.parametrize("name", sorted(CONDITIONS))
def test_the_same_seed_builds_the_same(name):
    first, second = built(name), built(name)
    assert np.array_equal(first.mesh.vertices, second.mesh.vertices)
    assert np.array_equal(first.mesh.face, second.mesh.face)
    assert first.people == second.people
    other = built(name, seed=np.random.SeedSequence(6))
    alike = np.array_equal(first.mesh.vertices, other.mesh.vertices)
    assert alike == (name == "ideal")


def test_furniture_does_not_move_the_walls():
    bare, full = built("as-built"), built("furniture+people+open-doors+no-ceiling")
    for a, b in zip(bare.truth.faces, full.truth.faces, strict=True):
        assert np.array_equal(a.normal, b.normal)
        assert a.d == b.d


def test_labels_tell_what_a_return_is_from():
    world = built("office+clutter+glass")
    found = set(np.unique(world.mesh.face).tolist())
    assert {CLUTTER, FURNITURE, GLASS, LEAF} <= found
    assert np.array_equal(world.mesh.glass, world.mesh.face == GLASS)
    by_kind = {fitting.kind: fitting.label for fitting in world.fittings}
    assert by_kind["cabinet"] == FURNITURE
    assert by_kind["pallet"] == CLUTTER
    assert {maker.__name__ for maker in (*FURNITURE_KINDS, *SITE)} | {"leaf"} >= set(by_kind)
    names = set(world.mesh.geom_names)
    assert all(f"{fitting.name}_0" in names for fitting in world.fittings)
    model = world.spec.copy().compile()
    assert model.ngeom == len(names) + 4 * len(world.people)


def test_rooms_without_a_ceiling_are_open_to_the_sky():
    world = built("no-ceiling")
    corners = world.mesh.vertices[world.mesh.triangles[world.mesh.face == CEILING]]
    under = [shapely.Polygon(t[:, :2]) for t in corners if np.ptp(t[:, 2]) < 1e-9]
    ceiling = shapely.union_all(shapely.set_precision(under, 1e-9))
    covered = [ceiling.intersection(r.polygon).area / r.polygon.area for r in world.truth.rooms]
    assert {round(share, 3) for share in covered} == {0.0, 1.0}


def test_unfinished_walls_are_in_the_truth():
    gaps = 0
    for seed in range(4):
        seeds = np.random.SeedSequence(seed)
        whole, world = built("as-built", seed=seeds), built("unfinished", seed=seeds)
        length = sum(face.length for face in whole.truth.faces)
        assert sum(face.length for face in world.truth.faces) < length
        assert len(world.truth.rooms) == len(whole.truth.rooms)
        gaps += len(world.truth.doors) - len(whole.truth.doors)
        storey = load_scene("SE1").storeys[0]
        again = redrawn(storey, CONDITIONS["unfinished"], np.random.default_rng(seed))
        assert len(again.openings) > len(storey.openings)
    assert gaps > 2


def test_a_wall_that_is_half_high_all_along_ends_early_in_the_truth():
    from test_shapes import two_rooms

    from worlds.plan import Opening

    parapet = Opening("window", box(3.95, -0.05, 4.25, 4.05), 1.1, 2.7)
    truth = build_world(two_rooms(parapet), SEED, IDEAL).truth
    tops = sorted(face.z_range[1] for face in truth.faces)
    assert tops[:2] == [1.1, 1.1]
    assert set(tops[2:]) == {2.7}


def test_a_pane_closes_an_opening_and_nobody_drives_through():
    from test_shapes import two_rooms

    from worlds.plan import Opening

    pane = Opening("door", box(3.95, 1.0, 4.25, 3.0), 0.0, 2.2, glass=True)
    world = build_world(two_rooms(pane), SEED, IDEAL)
    assert world.truth.doors == ()
    assert len(world.truth.rooms) == 2
    of_glass = world.mesh.vertices[world.mesh.triangles[world.mesh.glass]].reshape(-1, 3)
    assert np.ptp(of_glass, axis=0) == pytest.approx([0.02, 2.0, 2.22])
    assert of_glass[:, 0].mean() == pytest.approx(4.1)
    assert world.footprints[0].covers(Point(4.1, 2.0))


def test_partitions_are_the_walls_between_two_rooms():
    found = partitions(load_scene("SE1").storeys[0])
    rooms = [room.outline for room in load_scene("SE1").storeys[0].rooms]
    assert found
    for partition in found:
        middle = partition.start + partition.length / 2.0 * partition.along
        sides = [middle - 0.2 * partition.across, middle + 0.5 * partition.across]
        inside = [{k for k, room in enumerate(rooms) if room.covers(Point(p))} for p in sides]
        assert inside[0] != inside[1]
        assert 0.09 < partition.thickness < 0.31


# --- one room ------------------------------------------------------------------------------------


def room_with_doors():
    doors = [Door(np.array([x, 2.0]), (0, 1), 0.9, 2.0) for x in (0.0, 6.0)]
    return RoomSpace(box(0.0, 0.0, 6.0, 4.0), doors)


def test_nothing_stands_before_a_door_or_in_a_wall_or_in_something_else():
    space = room_with_doors()
    assert not space.take(box(0.3, 1.8, 0.8, 2.2))
    leaf = box(0.05, 1.5, 0.9, 1.54)
    assert not space.take(leaf)
    assert space.take(leaf, in_doorway=True)
    assert not space.take(box(-0.1, 0.0, 0.5, 0.5))
    assert space.take(box(2.0, 0.1, 3.0, 0.6))
    assert not space.take(box(2.5, 0.3, 3.5, 0.9))
    assert not space.take(Point(0.0, 2.0).buffer(0.45 + BEFORE_DOOR).intersection(space.polygon))


def test_the_way_from_door_to_door_stays_open():
    space = room_with_doors()
    assert space.take(box(2.8, 0.1, 3.0, 3.2))  # 0.8 m are left
    assert not space.take(box(2.8, 3.3, 3.0, 3.9))
    assert not room_with_doors().take(box(2.8, 0.1, 3.0, 3.6))  # 0.4 m would be left
