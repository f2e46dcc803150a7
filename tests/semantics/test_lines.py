import numpy as np
import pytest
import shapely
from hypothesis import given, settings
from hypothesis import strategies as st

from semantics.lines import crossings, segment_gaps

COARSE = st.lists(st.integers(0, 4), min_size=4, max_size=4)
FINE = st.lists(st.floats(-5, 5).map(lambda x: round(x, 3)), min_size=4, max_size=4)


def segments(numbers):
    """(M, 2, 2), without those that are points."""
    every = np.array(numbers, dtype=np.float64).reshape(-1, 2, 2)
    return every[np.ptp(every, axis=1).max(axis=1) > 1e-3]


@settings(deadline=None)
@given(st.lists(FINE, min_size=2, max_size=6))
def test_gaps_are_shapelys(numbers):
    every = segments(numbers)
    i, j = np.nonzero(np.ones((len(every), len(every))))
    shapes = shapely.linestrings(every)
    assert segment_gaps(every, i, j) == pytest.approx(
        shapely.distance(shapes[i], shapes[j]), abs=1e-6
    )


@settings(deadline=None)
@given(st.lists(st.one_of(COARSE, FINE), min_size=1, max_size=12), st.lists(COARSE, max_size=12))
def test_crossings_are_shapelys_also_where_ends_touch_and_lines_coincide(numbers, others):
    lines, every = segments(numbers), segments(others)
    found = set(zip(*(side.tolist() for side in crossings(lines, every)), strict=True))
    shapes = shapely.linestrings(lines)[:, None], shapely.linestrings(every)[None, :]
    assert found == set(zip(*np.nonzero(shapely.intersects(*shapes)), strict=True))


def test_an_end_that_just_touches_is_decided_exactly():
    """A third of the way along, where no sum of doubles comes out as it should."""
    start, end = np.array([0.1, 0.3]), np.array([3.7, 2.9])
    on = start + (end - start) / 3.0
    up = np.array([0.0, 1.0])
    above = np.array([[on + shift * up, on + up] for shift in (-1e-15, 0.0, 1e-15, 1e-9)])
    found = crossings(np.array([[start, end]]), above)[1].tolist()
    shapes = shapely.linestrings(above)
    meet = shapely.intersects(shapely.linestrings([start, end]), shapes)
    assert found == np.flatnonzero(meet).tolist()
    assert 0 in found
    assert 3 not in found
