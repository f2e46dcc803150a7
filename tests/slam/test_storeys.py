"""Storeys, told by the height of the base: ramps, landings, drift."""

from __future__ import annotations

import numpy as np

from slam.core import Array, pose, so3_exp
from slam.storeys import Storeys


def _at(z: float, slope: float = 0.0) -> Array:
    return pose(so3_exp(np.array([0.0, -slope, 0.3])), np.array([1.0, 2.0, z]))


def _told(heights: list[tuple[float, float]]) -> tuple[list[int], Storeys]:
    """The storey of each keyframe at a height, on a slope."""
    storeys = Storeys()
    for z, slope in heights:
        storeys.add(storeys.at(_at(z, slope)), _at(z, slope))
    return [storeys.of(k) for k in range(len(heights))], storeys


def test_up_a_ramp_and_down_again() -> None:
    ramp = [(z, 0.1) for z in (0.3, 1.0, 1.4, 1.6, 2.2, 2.8)]
    way = [(0.0, 0.0), *ramp, (2.9, 0.0), *[(z, -0.1) for z, _ in ramp[::-1]], (0.0, 0.0)]
    told, storeys = _told(way)
    assert storeys.at(_at(2.8, 0.1)) == 1
    assert storeys.at(_at(5.8)) == 2
    assert storeys.at(_at(5.8, 0.1)) == 1
    # The first time up nothing is known of the storey above until the base stands on it.
    assert told == [0] * 7 + [1] + [1, 1, 1, 0, 0, 0] + [0]


def test_a_landing_half_way_is_no_storey_and_does_not_raise_one() -> None:
    told, _ = _told([(0.0, 0.0), (1.4, 0.0), (1.4, 0.0), (1.4, 0.0), (2.9, 0.0), (1.6, 0.0)])
    assert told == [0, 0, 0, 0, 1, 1]


def test_a_cellar_and_three_storeys() -> None:
    told, _ = _told([(0.0, 0.0), (-2.6, 0.0), (2.9, 0.0), (5.8, 0.0), (0.1, 0.0), (-2.5, 0.0)])
    assert told == [0, 1, 2, 3, 0, 1]


def test_a_floor_that_drifts_slowly_stays_the_floor() -> None:
    rng = np.random.default_rng(0)
    drift = np.linspace(0.0, 3.0, 400)
    way = [(float(z), float(t)) for z, t in zip(drift, rng.normal(0.0, 0.005, 400), strict=True)]
    assert set(_told(way)[0]) == {0}
