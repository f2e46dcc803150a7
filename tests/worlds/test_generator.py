"""Random buildings are valid, whatever the seed."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st
from shapely.ops import unary_union

from worlds.generator import GeneratorConfig, random_plan
from worlds.plan import Plan

SHEARED = GeneratorConfig(shear=1.0)


def _plan(seed: int, config: GeneratorConfig | None = None) -> Plan:
    return random_plan(np.random.default_rng(seed), config)


@pytest.mark.parametrize("config", [None, SHEARED], ids=["square", "sheared"])
@settings(max_examples=40, deadline=None)
@given(seed=st.integers(0, 2**32 - 1))
def test_rooms_and_walls_share_no_area(config: GeneratorConfig | None, seed: int) -> None:
    storey = _plan(seed, config).storeys[0]
    rooms = [room.outline for room in storey.rooms]
    assert rooms
    assert all(room.is_valid and room.area > 0.5 for room in rooms)
    assert sum(r.area for r in rooms) == pytest.approx(unary_union(rooms).area, abs=1e-5)
    assert unary_union(rooms).intersection(storey.walls).area < 1e-5


@settings(max_examples=40, deadline=None)
@given(seed=st.integers(0, 2**32 - 1))
@example(seed=501120)  # a corner cut off left a line of no width beside a wall
def test_doors_lie_in_walls_and_join_two_rooms(seed: int) -> None:
    storey = _plan(seed).storeys[0]
    for door in storey.openings:
        assert door.footprint.intersection(storey.walls).area > 0.6 * door.footprint.area
        touched = [r for r in storey.rooms if r.outline.intersection(door.footprint).area > 1e-4]
        assert len(touched) == 2


def test_the_seed_decides_everything() -> None:
    assert _plan(7) == _plan(7)
    assert _plan(7) != _plan(8)


def test_every_kind_of_building_is_drawn_and_turned() -> None:
    plans = [_plan(seed) for seed in range(60)]
    assert {plan.name for plan in plans} == {f"random-{kind}" for kind in GeneratorConfig().kinds}
    corners = [len(r.outline.exterior.coords) for p in plans for r in p.storeys[0].rooms]
    assert max(corners) > 5  # rooms that are not rectangles


HARD = GeneratorConfig(
    kinds=("wings", "corridor", "spine"), join=0.4, taper=0.5, cross=1.0, piers=1.0, pillars=1.0
)


@settings(max_examples=30, deadline=None)
@given(seed=st.integers(0, 2**32 - 1))
def test_with_piers_and_pillars_rooms_and_walls_share_no_area_but_pillars(seed: int) -> None:
    storey = _plan(seed, HARD).storeys[0]
    rooms = [room.outline for room in storey.rooms]
    assert all(room.is_valid and room.area > 0.5 for room in rooms)
    pillars = unary_union(rooms).intersection(storey.walls).buffer(-1e-3)
    for part in [] if pillars.is_empty else getattr(pillars, "geoms", [pillars]):
        assert part.area < 1.0
        assert all(part.distance(door.footprint) > 0.8 for door in storey.openings)
    for door in storey.openings:
        touched = [r for r in storey.rooms if r.outline.intersection(door.footprint).area > 1e-4]
        assert len(touched) == 2


def test_corridors_open_into_one_another() -> None:
    config = GeneratorConfig(kinds=("blocks", "wings"), cross=0.5, opening=1.0)
    plans = [_plan(seed, config) for seed in range(20)]
    assert {plan.name for plan in plans} == {"random-blocks", "random-wings"}
    found = [(p.storeys[0], o) for p in plans for o in p.storeys[0].openings if o.kind == "opening"]
    assert len(found) > 10
    for storey, opening in found:
        rooms = [r for r in storey.rooms if r.outline.intersection(opening.footprint).area > 1e-4]
        assert [room.kind for room in rooms] == ["corridor", "corridor"]
        assert 2.0 <= opening.z_max < storey.z_ceiling - storey.z_floor


def test_corridors_go_round_corners_and_one_stands_behind_the_other() -> None:
    plans = [_plan(seed, HARD) for seed in range(20)]
    wings = [plan for plan in plans if plan.name == "random-wings"]
    outlines = [room.outline for plan in wings for room in plan.storeys[0].rooms]
    assert any(outline.area < 0.8 * outline.convex_hull.area for outline in outlines)
    halls = [sum(room.kind == "corridor" for room in plan.storeys[0].rooms) for plan in plans]
    assert max(halls) >= 2
