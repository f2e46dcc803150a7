"""Statistics: against closed forms, and against what they promise on data with a known answer."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.stats import ttest_1samp, ttest_ind, wilcoxon

from eval.comparing.stats import bootstrap, holm, mean_over_scenes, paired, unpaired
from slam.core import InputError


def rng(seed: int = 0) -> np.random.Generator:
    return np.random.default_rng(seed)


def samples(*scenes: list[float]) -> dict[str, np.ndarray]:
    return {f"scene {place}": np.array(values) for place, values in enumerate(scenes)}


def test_the_mean_is_over_seeds_and_then_over_scenes() -> None:
    assert mean_over_scenes(samples([1.0, 1.0, 1.0, 1.0], [4.0])) == 2.5


def test_pairs_are_compared_by_their_differences() -> None:
    b = samples([1.0, 2.0, 3.0], [10.0, 20.0])
    a = {
        scene: values + [[0.1, 0.2, 0.3], [-0.1, 0.0]][i]
        for i, (scene, values) in enumerate(b.items())
    }
    found = paired(a, b, rng())
    assert found.count == 5
    assert found.base == pytest.approx((2.0 + 15.0) / 2)
    assert found.mean == pytest.approx((0.2 - 0.05) / 2)
    assert found.percent == pytest.approx(100.0 * 0.075 / 8.5)
    assert found.pairs == (1, 3)
    assert found.scenes == (1, 1)


def test_the_tests_are_scipys_where_there_is_one_scene() -> None:
    x, y = rng(1).normal(0.5, 1.0, 12), rng(2).normal(0.0, 1.0, 12)
    pair = paired(samples(list(x)), samples(list(y)), rng())
    assert pair.p_mean == pytest.approx(ttest_1samp(x - y, 0.0).pvalue)
    assert pair.p_rank == pytest.approx(wilcoxon(x - y).pvalue)
    assert pair.effect == pytest.approx((x - y).mean() / (x - y).std(ddof=1))
    assert pair.across_scenes is None
    apart = unpaired(samples(list(x)), samples(list(y)), rng())
    assert apart.p_mean == pytest.approx(ttest_ind(x, y, equal_var=False).pvalue)


def test_pairing_sees_what_is_lost_between_seeds() -> None:
    between = rng(3).normal(1.0, 0.5, 10)
    a, b = samples(list(between + 0.02 + 0.005 * rng(4).normal(size=10))), samples(list(between))
    assert paired(a, b, rng()).interval.clear_of_zero  # type: ignore[union-attr]
    assert not unpaired(a, b, rng()).interval.clear_of_zero  # type: ignore[union-attr]


@pytest.mark.parametrize(("scenes", "seeds"), [(5, 4), (1, 10)])
def test_the_interval_holds_the_truth_as_often_as_it_says(scenes: int, seeds: int) -> None:
    draw, held = rng(5), 0
    for _ in range(120):
        drawn = {str(i): draw.normal(3.0, 1.0 + i, seeds) for i in range(scenes)}
        interval = bootstrap(drawn, draw)
        assert interval is not None
        held += interval.low <= 3.0 <= interval.high
    assert 0.88 <= held / 120 <= 0.99


def test_without_spread_there_is_no_interval() -> None:
    found = paired(samples([1.0], [2.0]), samples([0.5], [1.5]), rng())
    assert found.interval is None
    assert found.p_mean is None
    assert found.effect is None
    constant = paired(samples([2.0, 3.0]), samples([1.0, 2.0]), rng())
    assert constant.p_mean == 0.0
    assert constant.interval is not None
    assert constant.interval.low == constant.interval.high == 1.0
    same = paired(samples([2.0, 3.0]), samples([2.0, 3.0]), rng())
    assert (same.p_mean, same.p_rank, same.p_sign) == (1.0, None, None)


@settings(deadline=None, max_examples=15)
@given(st.lists(st.floats(-10, 10), min_size=2, max_size=8), st.floats(-5, 5))
def test_a_shift_of_one_side_is_found(values: list[float], shift: float) -> None:
    b = samples(values)
    a = {scene: v + shift for scene, v in b.items()}
    assert paired(a, b, rng()).mean == pytest.approx(shift, abs=1e-6)
    forth, back = paired(a, b, rng()), paired(b, a, rng())
    assert forth.mean == -back.mean
    assert forth.pairs == back.pairs[::-1]


def test_rounding_is_no_difference() -> None:
    b = samples([0.01, 0.02, 0.03], [0.04, 0.05])
    found = paired({scene: values + 3e-9 for scene, values in b.items()}, b, rng())
    assert (found.mean, found.pairs, found.p_rank) == (0.0, (0, 0), None)


def test_what_does_not_pair_is_refused() -> None:
    with pytest.raises(InputError, match="no pairs"):
        paired(samples([1.0, 2.0]), samples([1.0]), rng())
    with pytest.raises(InputError, match="no pairs"):
        paired({}, {}, rng())
    with pytest.raises(InputError, match="no scene in common"):
        unpaired({"a": np.ones(2)}, {"b": np.ones(2)}, rng())


def test_many_questions_make_each_answer_weaker() -> None:
    assert holm([0.01, None, 0.04, 0.03]) == [pytest.approx(0.03), None, 0.06, 0.06]
    assert holm([0.9, 0.8]) == [1.0, 1.0]
    assert holm([]) == []
