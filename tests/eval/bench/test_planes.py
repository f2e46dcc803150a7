"""The benchmark of plane extraction: what is right, mixed or missing is told apart."""

from __future__ import annotations

import numpy as np
import pytest

from eval.bench.planes import METHODS, Look, Patch, bench_planes, looks_at, ours
from sim.sensorfile import sensor_named
from slam.core import inverse, transform_plane
from worlds.conditions import AS_BUILT
from worlds.generator import random_plan
from worlds.world import World, build_world

pytest.importorskip("open3d")


@pytest.fixture(scope="module")
def world() -> World:
    plan = random_plan(np.random.default_rng(3))
    return build_world(plan, np.random.SeedSequence(0), AS_BUILT)


@pytest.fixture(scope="module")
def looks(world: World) -> list[Look]:
    return looks_at(world, sensor_named("vlp16"), 3, seed=1)


def true_patches(look: Look, world: World) -> list[Patch]:
    """Every face with returns, exactly."""
    patches = []
    for face in np.unique(look.face[look.face >= 0]).tolist():
        true = world.truth.faces[face]
        normal, d = transform_plane(inverse(look.T_world_base), true.normal, true.d)
        patches.append(Patch(normal, d, np.flatnonzero(look.face == face)))
    return patches


def test_ours_finds_the_walls(looks: list[Look], world: World) -> None:
    score = bench_planes(looks, world.truth, "ours")
    assert score.found > 0.9
    assert score.mixed < 0.05
    assert score.tilt[0] < 0.2
    assert score.offset[0] < 0.005


def test_the_truth_scores_full(
    looks: list[Look], world: World, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(METHODS, "truth", lambda look: true_patches(look, world))
    score = bench_planes(looks, world.truth, "truth")
    assert (score.found, score.mixed) == (1.0, 0.0)
    assert score.tilt == pytest.approx((0.0, 0.0), abs=1e-5)
    assert score.offset == pytest.approx((0.0, 0.0), abs=1e-9)


def test_half_of_two_walls_is_mixed_and_finds_neither(
    looks: list[Look], world: World, monkeypatch: pytest.MonkeyPatch
) -> None:
    def paired(look: Look) -> list[Patch]:
        a, b, *_ = sorted(true_patches(look, world), key=lambda patch: -len(patch.places))
        return [Patch(a.normal, a.d, np.concatenate([a.places[::2], b.places[::2]]))]

    monkeypatch.setitem(METHODS, "paired", paired)
    score = bench_planes(looks, world.truth, "paired")
    assert (score.found, score.mixed, score.planes) == (0.0, 1.0, 1.0)
    assert np.isnan(score.tilt[0])


@pytest.mark.parametrize("method", list(METHODS))
def test_all_methods_find_planes_that_face_the_sensor(method: str, looks: list[Look]) -> None:
    patches = METHODS[method](looks[0])
    assert len(patches) >= 4
    for patch in patches:
        assert patch.normal @ looks[0].origin + patch.d > 0.0
        off = looks[0].points[patch.places] @ patch.normal + patch.d
        assert np.median(np.abs(off)) < 0.06


def test_a_sweep_is_seen_from_where_the_base_was(looks: list[Look]) -> None:
    assert len(ours(looks[0])) > 0
    for look in looks:
        assert len(look.points) == len(look.ring) == len(look.face) == len(look.surface)
        assert (look.surface[look.face >= 0] >= 0).all()
        assert (look.surface[look.face < 0] < 0).all()
