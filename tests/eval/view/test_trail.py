"""A path in parts that join."""

from __future__ import annotations

import numpy as np

from eval.view.trail import PART, Trail


def test_parts_join_and_stay_short() -> None:
    trail = Trail((1, 2, 3))
    ends: dict[int, list[list[float]]] = {}
    for i in range(3 * PART):
        trail.add(np.array([float(i), 0.0, 0.0]))
        ends[trail.part] = trail.strip().strips.as_arrow_array().to_pylist()[0]
    assert list(ends) == [0, 1, 2, 3]
    assert all(len(strip) <= PART for strip in ends.values())
    for part in range(3):
        assert ends[part][-1] == ends[part + 1][0]
    assert ends[3][-1] == [3.0 * PART - 1.0, 0.0, 0.0]
