import numpy as np
import pytest

from semantics import near
from semantics.near import boxes, near_pairs, touching


def random_segments(count, seed=0, side=30.0):
    rng = np.random.default_rng(seed)
    start = rng.uniform(0.0, side, (count, 1, 2))
    return np.concatenate([start, start + rng.uniform(-4.0, 4.0, (count, 1, 2))], axis=1)


def by_hand(first, second):
    low, high = first[..., None]
    return np.nonzero(
        (low <= second[1][:, None]).all(axis=0) & (high >= second[0][:, None]).all(axis=0)
    )


@pytest.mark.parametrize(("few", "most"), [(10**9, 10**9), (0, 10**9), (0, 1)])
def test_however_it_is_found_out_the_same_boxes_touch(monkeypatch, few, most):
    monkeypatch.setattr(near, "FEW", few)
    monkeypatch.setattr(near, "MOST", most)
    segments = random_segments(120)
    segments[:40] = np.round(segments[:40])  # boxes that only just touch
    first, second = boxes(segments[:50], 0.5), boxes(segments[30:], 0.5)
    for found, expected in zip(touching(first, second), by_hand(first, second), strict=True):
        assert np.array_equal(found, expected)


@pytest.mark.parametrize(("a", "b"), [(0, 3), (3, 0), (0, 0)])
def test_none_touch_none(a, b):
    i, j = touching(boxes(random_segments(a)), boxes(random_segments(b)))
    assert len(i) == len(j) == 0


def test_each_box_grows_by_its_own_reach():
    segments = np.array([[[0.0, 0.0], [1.0, 0.0]], [[3.0, 0.0], [4.0, 0.0]]])
    box = boxes(segments, np.array([0.5, 1.5]))
    assert box[0].tolist() == [[-0.5, 1.5], [-0.5, -1.5]]
    assert [side.tolist() for side in touching(box[:, :, :1], box[:, :, 1:])] == [[0], [0]]


def test_near_pairs_go_both_ways_and_nobody_is_near_itself():
    i, j = near_pairs(random_segments(40), 1.0)
    pairs = set(zip(i.tolist(), j.tolist(), strict=True))
    assert pairs == {(b, a) for a, b in pairs}
    assert not any(a == b for a, b in pairs)
