"""Point clouds as messages, whatever fields they have."""

from __future__ import annotations

import numpy as np
import pytest
from bagfiles import SECONDS, Cloud, cloud_of, ring_of_points

from eval.recordings.clouds import (
    BadCloud,
    azimuth_fraction,
    read_cloud,
    ring_by_elevation,
    scan_of,
)
from slam.core import Array, Scan


def scan_from(cloud: Cloud, stamp: float = 100.0) -> Scan:
    return scan_of(read_cloud(cloud), 0, stamp, 0.1, np.eye(4))


@pytest.mark.parametrize("order", ["<", ">"])
def test_a_cloud_becomes_a_scan(order: str) -> None:
    columns = ring_of_points()
    scan = scan_from(
        cloud_of(
            order,
            height=4,
            padding=5,
            **columns,
            intensity=np.full(360, 51, dtype=np.uint8),
            ring=np.full(360, 9, dtype=np.uint16),
            time=SECONDS.astype(np.float32),
        )
    )
    assert scan.points == pytest.approx(np.column_stack(list(columns.values())))
    assert scan.stamp == pytest.approx(100.0999, abs=1e-6)
    assert scan.times == pytest.approx(SECONDS - 0.0999, abs=1e-7)
    assert set(scan.ring) == {9}
    assert scan.intensity == pytest.approx(0.2)


@pytest.mark.parametrize(
    ("column", "end"),
    [
        ((SECONDS * 1e9).astype(np.uint32), 100.0999),
        ((SECONDS * 1e9).astype(np.float64), 100.0999),
        ((SECONDS * 1e6).astype(np.float32), 100.0999),
        ((SECONDS - 0.0999).astype(np.float32), 100.0),
        (SECONDS + 1.7e9, 1.7e9 + 0.0999),
        ((SECONDS + 1.7e9) * 1e9, 1.7e9 + 0.0999),
        (np.zeros(360, dtype=np.float32), 100.0),
    ],
)
@pytest.mark.parametrize("name", ["time", "t", "timestamp", "offset_time"])
def test_times_in_any_unit_end_with_the_last_point(name: str, column: Array, end: float) -> None:
    scan = scan_from(cloud_of(**ring_of_points(), **{name: column}))
    assert scan.stamp == pytest.approx(end, abs=1e-6)
    assert scan.times.max() <= 0.0
    if column.any():
        assert scan.times == pytest.approx(SECONDS - 0.0999, abs=1e-6)


def test_without_times_points_are_spread_by_azimuth() -> None:
    columns = ring_of_points()
    scan = scan_from(cloud_of(**columns))
    assert scan.stamp == 100.0
    assert scan.times == pytest.approx(0.1 * (np.arange(360) / 360.0 - 1.0), abs=4e-4)
    backwards = {name: column[::-1].copy() for name, column in columns.items()}
    assert (np.diff(scan_from(cloud_of(**backwards)).times) > 0.0).all()


def test_azimuth_fraction_is_in_the_unit_interval() -> None:
    points = np.random.default_rng(0).normal(size=(100, 3))
    fraction = azimuth_fraction(points)
    assert (fraction >= 0.0).all()
    assert (fraction < 1.0).all()


def test_without_rings_elevation_tells_beams_apart() -> None:
    elevation = np.radians([-15.0, 7.0, -1.0, 1.0, -15.0])
    points = np.column_stack([np.cos(elevation), np.zeros(5), np.sin(elevation)])
    assert ring_by_elevation(points).tolist() == [0, 3, 1, 2, 0]


def test_rings_counted_from_the_top_are_turned_round() -> None:
    parts = [ring_of_points(90, elevation) for elevation in (0.2, 0.0, -0.2)]
    columns = {name: np.concatenate([part[name] for part in parts]) for name in "xyz"}
    scan = scan_from(cloud_of(**columns, ring=np.repeat([0, 1, 2], 90).astype(np.uint8)))
    assert scan.ring.tolist() == [2] * 90 + [1] * 90 + [0] * 90


def test_points_that_are_not_finite_are_dropped_with_all_that_belongs_to_them() -> None:
    columns = ring_of_points()
    columns["x"][::2] = np.nan
    columns["y"][1] = np.inf
    for column in columns.values():
        column[3] = 0.0
    ring = np.arange(360).astype(np.uint16)
    scan = scan_from(cloud_of(**columns, ring=ring, t=(SECONDS * 1e9).astype(np.uint32)))
    assert len(scan) == len(scan.times) == len(scan.ring) == 178
    assert scan.times == pytest.approx(SECONDS[5::2] - SECONDS[-1], abs=1e-8)


def bad_clouds() -> dict[str, Cloud]:
    good = ring_of_points()
    short = cloud_of(**good)
    short.data = short.data[:-8]
    nan = {name: np.full(360, np.nan, dtype=np.float32) for name in "xyz"}
    jumbled = np.where(np.arange(360) == 7, np.nan, SECONDS)
    return {
        "do not fit": short,
        "expected x, y and z": cloud_of(x=good["x"], y=good["y"]),
        "finite coordinates": cloud_of(**nan),
        "time is not finite": cloud_of(**good, time=jumbled),
        "more than a sweep": cloud_of(**good, t=np.linspace(0, 4e9, 360).astype(np.uint32)),
    }


@pytest.mark.parametrize("message", bad_clouds())
def test_bad_clouds_say_what_is_wrong(message: str) -> None:
    with pytest.raises(BadCloud, match=message):
        scan_from(bad_clouds()[message])
