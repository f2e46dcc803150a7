import numpy as np
import pytest

from slam.charts import Chart, Charts
from slam.core import InputError, plane_axes


def direction(rng):
    n = rng.normal(size=3)
    return n / np.linalg.norm(n)


def plane_of(chart, x):
    """Normal and d of w = h + a u + b v."""
    u, v, w = chart.frame
    n = w - x[0] * u - x[1] * v
    n /= np.linalg.norm(n)
    return n, -n @ (chart.origin + x[2] * w)


@pytest.mark.parametrize("seed", range(4))
def test_a_plane_comes_back_from_its_coordinates(seed):
    rng = np.random.default_rng(seed)
    normal, d = direction(rng), rng.normal()
    near = normal + rng.normal(0.0, 0.2, 3)
    chart = Chart.at(rng.normal(0.0, 50.0, 3), near / np.linalg.norm(near))
    n, back = plane_of(chart, chart.coordinates(normal, d))
    assert n == pytest.approx(normal, abs=1e-12)
    assert back == pytest.approx(d, abs=1e-9)


def test_the_numbers_are_heights_over_the_chart():
    chart = Chart.at(np.array([3.0, 1.0, 0.5]), np.array([0.0, -1.0, 0.0]))
    x = np.array([0.02, -0.01, 0.1])
    n, d = plane_of(chart, x)
    for u, v in ((0.0, 0.0), (2.0, 0.0), (-1.0, 3.0)):
        w = x[2] + x[0] * u + x[1] * v
        point = chart.origin + np.array([u, v, w]) @ chart.frame
        assert n @ point + d == pytest.approx(0.0, abs=1e-12)
        assert chart.place(point[None])[0] == pytest.approx([u, v], abs=1e-12)


@pytest.mark.parametrize("seed", range(4))
def test_planes_of_several_charts_and_their_derivatives(seed):
    rng = np.random.default_rng(seed)
    charts = [Chart.at(rng.normal(0.0, 5.0, 3), direction(rng)) for _ in range(3)]
    x = rng.normal(0.0, 0.2, (3, 3))
    n, d, by_n, by_d = Charts.of(charts).planes(x)
    for place, chart in enumerate(charts):
        normal, offset = plane_of(chart, x[place])
        assert n[place] == pytest.approx(normal, abs=1e-12)
        assert d[place] == pytest.approx(offset, abs=1e-12)
        for k, step in enumerate(1e-6 * np.eye(3)):
            (n1, d1), (n0, d0) = plane_of(chart, x[place] + step), plane_of(chart, x[place] - step)
            assert by_n[place, :, k] == pytest.approx((n1 - n0) / 2e-6, abs=1e-7)
            assert by_d[place, k] == pytest.approx((d1 - d0) / 2e-6, abs=1e-6)


@pytest.mark.parametrize("normal", [np.zeros(3), np.array([np.nan, 0, 1]), np.array([1.0, 1, 0])])
def test_a_chart_needs_a_direction(normal):
    with pytest.raises(InputError, match="unit normal"):
        Chart.at(np.zeros(3), normal)


@pytest.mark.parametrize("seed", range(4))
def test_axes_of_a_plane_are_right_handed_and_level(seed):
    normal = direction(np.random.default_rng(seed))
    first, second = plane_axes(normal)
    assert np.stack([first, second, normal]) @ np.stack([first, second, normal]).T == pytest.approx(
        np.eye(3), abs=1e-12
    )
    assert np.cross(normal, first) == pytest.approx(second)
    assert abs(normal[2]) > 0.7 or first[2] == 0.0
