"""The noise of mapped planes, from planes that were put off by a known amount."""

from __future__ import annotations

import numpy as np
import pytest

from eval.studies.plane_noise import Mapped, noise_csv, plane_noise
from slam.core import pose, so3_exp
from worlds.catalogue import load_scene
from worlds.conditions import conditions_named
from worlds.world import true_world

TRUTH = true_world(load_scene("SE1"), np.random.SeedSequence(0), conditions_named("ideal"))
T_WORLD_MAP = pose(so3_exp(np.array([0.0, 0.0, 0.7])), np.array([3.0, -2.0, 0.5]))


@pytest.mark.parametrize(("turn", "shift"), [(0.0, 0.0), (0.01, 0.0), (-0.02, 0.03), (0.0, -0.05)])
def test_what_was_put_in_comes_out(turn: float, shift: float) -> None:
    rows = plane_noise([_mapped(k, turn, shift) for k in range(4)], TRUTH, T_WORLD_MAP)
    assert rows[:, 1] == pytest.approx(np.full(4, turn), abs=1e-6)
    assert rows[:, 2] == pytest.approx(np.full(4, shift), abs=1e-6)
    lengths = [np.linalg.norm(np.diff(TRUTH.faces[k].segment, axis=0)) for k in range(4)]
    assert rows[:, 0] == pytest.approx(sorted(lengths), rel=0.01)


def test_a_plane_that_is_nothing_like_its_surface_does_not_count() -> None:
    assert len(plane_noise([_mapped(0, 1.0, 0.0)], TRUTH, T_WORLD_MAP)) == 0


def test_the_file_is_what_the_training_set_reads() -> None:
    rows = np.array([[0.5, -0.01, 0.002], [3.0, 0.001, -0.003]])
    read = np.loadtxt(noise_csv(rows).splitlines(), delimiter=",", skiprows=1)
    assert np.allclose(read, rows)


def _mapped(face: int, turn: float, shift: float) -> Mapped:
    """A face's plane in the map frame, turned about its middle and shifted."""
    true = TRUTH.faces[face]
    middle, half = true.segment.mean(axis=0), 0.5 * (true.segment[1] - true.segment[0])
    c, s = np.cos(turn), np.sin(turn)
    R = np.array([[c, -s], [s, c]])
    ends = middle + shift * true.normal[:2] + np.array([-half, half]) @ R.T
    normal = np.append(R @ true.normal[:2], 0.0)
    R_map = T_WORLD_MAP[:3, :3].T
    height = np.full((2, 1), np.mean(true.z_range))
    ends_map = (np.column_stack([ends, height]) - T_WORLD_MAP[:3, 3]) @ R_map.T
    normal_map = R_map @ normal
    return Mapped(normal_map, -float(normal_map @ ends_map[0]), ends_map[:, :2], true.surface)
