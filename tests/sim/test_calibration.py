"""Shots at a room in closed form, with known faults; then two recordings of real units."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from boxworld import single_room
from scipy.spatial import KDTree

from sim.calibration.beams import (
    BeamConfig,
    Calibration,
    calibrate,
    calibrate_at,
    mixed_pixels,
)
from sim.calibration.shots import Shots, shots_of_scans
from sim.calibration.twin import Twin, simulated_twin
from sim.calibration.walls import WallConfig, fit_planes
from sim.caster import RayCaster, Rays
from sim.lidar import Lidar
from sim.motion import Motion
from sim.sensorfile import sensor_named
from slam.core import Array, InputError

RECORDINGS = Path(__file__).parents[3] / "shared" / "data" / "vlp16"
COLUMNS, BEAMS, TURNS = 901, 8, 5
ELEVATIONS = np.radians(np.linspace(-7.0, 7.0, BEAMS))
WALLS = np.array([[1, 0, 0, 3.0], [-1, 0, 0, 2.2], [0, 1, 0, 1.7], [0, -1, 0, 4.1]])
"""n and d: a room of 5.2 by 5.8 m round the sensor."""


def room(yaw: float = 0.0) -> Shots:
    """Exact ranges of a sensor at rest between the four walls, turned by yaw."""
    turn = -2.0 * np.pi * (np.arange(COLUMNS * TURNS) + 0.3) / COLUMNS
    azimuth = turn[:, None] + np.zeros(BEAMS)
    level = np.cos(ELEVATIONS)
    z = np.broadcast_to(np.sin(ELEVATIONS), azimuth.shape)
    directions = np.stack([level * np.cos(azimuth), level * np.sin(azimuth), z], axis=-1)
    heading = np.arctan2(WALLS[:, 1], WALLS[:, 0]) + yaw
    normals = np.column_stack([np.cos(heading), np.sin(heading), np.zeros(4)])
    along = -(directions @ normals.T)
    reach = np.where(along > 1e-9, WALLS[:, 3] / np.maximum(along, 1e-9), np.inf)
    times = np.arange(COLUMNS * TURNS)[:, None] * 110.592e-6 + 2.304e-6 * np.arange(BEAMS)
    bright = np.full(azimuth.shape, 0.25)
    return Shots(directions, reach.min(axis=-1), times, bright, np.zeros(BEAMS))


QUICK = BeamConfig(WallConfig(sample=2000, trials=200))
OFFSETS = np.array([12.0, -7.0, 3.0, -20.0, 25.0, -4.0, 0.0, -9.0]) * 1e-3


def flawed(shots: Shots, seed: int = 1, noise: float = 0.007) -> Shots:
    """With offsets, white noise, and 2 % dropout."""
    rng = np.random.default_rng(seed)
    ranges = shots.ranges + OFFSETS + noise * rng.standard_normal(shots.ranges.shape)
    ranges[rng.random(ranges.shape) < 0.02] = 0.0
    return replace(shots, ranges=ranges)


def fitted(shots: Shots) -> Calibration:
    return calibrate(shots, np.random.default_rng(0), QUICK)


def azimuth_step(shots: Shots) -> float:
    """Mean turn between two firings [degrees]."""
    steps = np.diff(shots.azimuth[:, 0])
    return float(np.degrees(np.abs(np.mean(np.angle(np.exp(1j * steps))))))


def test_what_was_put_in_comes_out() -> None:
    found = fitted(flawed(room()))
    assert found.offset == pytest.approx(OFFSETS - OFFSETS.mean(), abs=0.7e-3)
    assert found.noise == pytest.approx(0.007, rel=0.05)
    assert found.spread == pytest.approx(0.007, rel=0.05)
    assert found.dropout == pytest.approx(0.02, abs=0.006)
    assert found.lost == pytest.approx(0.02, abs=0.006)
    assert azimuth_step(room()) == pytest.approx(360.0 / COLUMNS, rel=1e-6)


def test_the_walls_are_found_where_they_are() -> None:
    planes = fitted(flawed(room(yaw=0.3))).planes
    assert len(planes) == 4
    assert sorted(planes[:, 3]) == pytest.approx(sorted(WALLS[:, 3]), abs=3e-3)
    assert np.linalg.norm(planes[:, :3], axis=1) == pytest.approx(1.0)


def test_turning_the_room_changes_no_beam() -> None:
    one, other = (fitted(flawed(room(yaw))) for yaw in (0.0, 0.9))
    assert other.offset == pytest.approx(one.offset, abs=1e-3)
    assert other.noise == pytest.approx(one.noise, rel=0.1)


def test_an_error_common_to_all_beams_is_not_seen() -> None:
    shots = flawed(room())
    longer = replace(shots, ranges=np.where(shots.ranges > 0.0, shots.ranges + 0.05, 0.0))
    assert fitted(longer).offset == pytest.approx(fitted(shots).offset, abs=0.5e-3)


def test_what_repeats_with_the_direction_is_spread_but_no_noise() -> None:
    shots = flawed(room())
    bumps = 0.008 * np.sin(60.0 * shots.azimuth + np.arange(BEAMS))
    beams = fitted(replace(shots, ranges=shots.ranges + bumps * shots.returned))
    assert beams.noise == pytest.approx(0.007, rel=0.1)
    assert beams.spread == pytest.approx(np.hypot(0.007, 0.008 / np.sqrt(2)), rel=0.1)


def test_a_window_is_lost_but_no_dropout() -> None:
    shots = flawed(room())
    glass = np.abs(shots.azimuth) < 0.25
    beams = fitted(replace(shots, ranges=np.where(glass, 0.0, shots.ranges)))
    assert beams.lost.min() > 0.08
    assert beams.dropout == pytest.approx(0.02, abs=0.006)


def test_things_before_a_wall_do_not_count() -> None:
    shots = flawed(room())
    clutter = (np.abs(shots.azimuth - 1.2) < 0.15) & shots.returned
    rough = 0.04 * np.sin(90.0 * shots.azimuth) - 0.02
    beams = fitted(replace(shots, ranges=shots.ranges + rough * clutter))
    assert beams.offset == pytest.approx(OFFSETS - OFFSETS.mean(), abs=2e-3)
    assert beams.noise == pytest.approx(0.007, rel=0.1)


def test_a_beam_that_saw_no_wall_has_no_numbers() -> None:
    shots = flawed(room())
    shots.ranges[:, 2] = 0.0
    beams = fitted(shots)
    for table in (beams.offset, beams.spread, beams.noise, beams.dropout):
        assert np.flatnonzero(np.isnan(table)).tolist() == [2]
    assert beams.lost[2] == 1.0
    rest = np.delete(OFFSETS, 2)
    assert np.delete(beams.offset, 2) == pytest.approx(rest - rest.mean(), abs=0.7e-3)


def test_the_same_generator_gives_the_same_numbers() -> None:
    shots = flawed(room())
    one, other = fitted(shots), fitted(shots)
    assert np.array_equal(one.offset, other.offset)
    assert np.array_equal(one.planes, other.planes)


def test_rings_on_walls_all_round_are_no_level_plane() -> None:
    planes = fit_planes(room().points, np.random.default_rng(0), WallConfig())
    assert np.abs(planes[:, 2]).max() < 0.06


@pytest.mark.parametrize("kind", ["nothing", "a cloud of dust"])
def test_without_walls_there_is_no_calibration(kind: str) -> None:
    shots = room()
    dust = np.random.default_rng(0).uniform(0.5, 20.0, shots.ranges.shape)
    shots = replace(shots, ranges=np.zeros_like(dust) if kind == "nothing" else dust)
    with pytest.raises(InputError, match="no wall"):
        fitted(shots)


def edge(*ranges: float) -> Shots:
    shots = room()
    table = np.array(ranges)[:, None]
    shape = table.shape
    return Shots(shots.directions[: len(table), :1], table, np.zeros(shape), table, np.zeros(1))


@pytest.mark.parametrize(
    ("ranges", "share"),
    [
        ((2.0, 2.0, 2.0, 4.0, 4.0, 4.0), 0.0),
        ((2.0, 2.0, 3.0, 4.0, 4.0), 1.0),
        ((4.0, 4.0, 2.0, 2.0, 3.1, 4.0, 4.0), 0.5),
        ((2.0, 0.0, 4.0, 4.0, 4.0), np.nan),
    ],
)
def test_mixed_pixels_are_counted_per_edge(ranges: tuple[float, ...], share: float) -> None:
    found = mixed_pixels(edge(*ranges), BeamConfig())
    assert found == pytest.approx(share, nan_ok=True)


# --- simulated ------------------------------------------------------------------------------------


def standing(sensor_name: str, sweeps: int) -> tuple[Shots, list[int], Array]:
    """Shots of a simulated sensor at rest; returns of each scan; points of all."""
    sensor = sensor_named(sensor_name)
    T = np.eye(4)
    T[:3, 3] = 2.5, 1.6, 1.2
    rng = np.random.default_rng(7)
    lidar = Lidar(sensor, RayCaster(single_room().mesh), rng, np.eye(4))
    ends = sensor.period * (1 + np.arange(sweeps))
    motions = [Motion(np.array([end - 0.11, end]), np.stack([T, T])) for end in ends]
    scans = [lidar.sweep(i, *pair)[0] for i, pair in enumerate(zip(ends, motions, strict=True))]
    shots = shots_of_scans(scans, sensor)
    return shots, [len(scan) for scan in scans], np.concatenate([scan.points for scan in scans])


def test_simulated_scans_get_their_lost_shots_back() -> None:
    shots, returns, points = standing("vlp16", 2)
    sensor = sensor_named("vlp16")
    assert shots.ranges.shape == (2 * sensor.columns, sensor.beams)
    halves = np.split(shots.returned, 2)
    assert [int(half.sum()) for half in halves] == returns
    assert sum(returns) < shots.ranges.size
    apart, partner = KDTree(points).query(shots.points)
    assert apart.max() < 1e-5
    assert len(set(partner)) == len(points)
    assert np.linalg.norm(shots.directions, axis=-1) == pytest.approx(1.0)


def test_the_simulated_sensor_is_calibrated_to_its_own_numbers() -> None:
    sensor = sensor_named("vlp16")
    beams = fitted(standing("vlp16", 6)[0])
    true = np.asarray(sensor.range_offsets)
    both = np.isfinite(beams.offset)
    assert both.sum() >= 12
    assert beams.offset[both] - beams.offset[both].mean() == pytest.approx(
        true[both] - true[both].mean(), abs=2.5e-3
    )
    dropout = np.asarray(sensor.dropout)[both]
    assert beams.dropout[both] == pytest.approx(dropout, rel=0.35, abs=0.01)


# --- the twin of a scene --------------------------------------------------------------------------


def rays_along(directions: Array) -> Rays:
    return np.hstack([np.zeros_like(directions), directions]).astype(np.float32)


def test_the_twin_answers_with_the_recorded_ranges_without_the_beams_offsets() -> None:
    shots = flawed(room(), noise=0.002)
    twin = Twin(shots, OFFSETS)
    exact = room()
    hits = twin.cast(rays_along(exact.directions[:COLUMNS, 3]))
    error = hits.distance - exact.ranges[:COLUMNS, 3]
    assert np.median(np.abs(error)) < 2e-3
    assert np.mean(np.abs(error) < 0.01) > 0.95  # but for the corners


def test_a_hole_stays_a_hole_and_an_edge_an_edge() -> None:
    shots = room()
    shots.ranges[np.abs(shots.azimuth) < 0.3] = 0.0
    shots.ranges[np.abs(shots.azimuth - 1.5) < 0.3] = 1.0
    directions = np.array([[1.0, 0.0, 0.0], [np.cos(1.5), np.sin(1.5), 0.0], [-1.0, 0.0, 0.0]])
    hits = Twin(shots, np.zeros(BEAMS)).cast(rays_along(directions))
    assert hits.distance[:2].tolist() == [np.inf, 1.0]
    table = Twin(shots, np.zeros(BEAMS)).cast(rays_along(shots.directions[:, 0])).distance
    near_edge = np.abs(shots.azimuth[:, 0] - 1.8) < 0.02
    assert set(np.round(table[near_edge & (table < 1.2)], 6)) == {1.0}


def test_a_sensor_of_other_beams_is_refused() -> None:
    with pytest.raises(InputError, match="os1-32 has 32 beams, the recording 8"):
        simulated_twin(room(), OFFSETS, sensor_named("os1-32"), np.random.default_rng(0))


# --- real units -----------------------------------------------------------------------------------


def recorded(name: str) -> Shots:
    from eval.recordings.packets import PacketRecording

    path = RECORDINGS / name
    if not path.is_file():
        pytest.skip(f"no recordings in {RECORDINGS}")
    return PacketRecording(path).shots()


@pytest.mark.parametrize("name", ["office_1000_packets.bin", "room_293_packets.pcap"])
def test_the_preset_measures_as_real_units_do(name: str) -> None:
    """Where a unit stood, the preset has its spread, its noise and its lost shots, beam by beam."""
    shots = recorded(name)
    real = calibrate(shots, np.random.default_rng(0))
    preset = sensor_named("vlp16")
    twin = simulated_twin(shots, real.offset, preset, np.random.default_rng(1))
    ours = calibrate_at(real.planes, twin)
    assert azimuth_step(shots) == pytest.approx(0.2, rel=0.01)
    solid = np.isfinite(real.spread)
    assert solid.sum() >= 11
    assert ours.spread[solid] == pytest.approx(real.spread[solid], rel=0.2)
    assert np.median(ours.noise[solid] / real.noise[solid]) == pytest.approx(1.0, abs=0.15)
    assert ours.lost == pytest.approx(real.lost, rel=0.2)
    assert np.nanmedian(real.dropout) < 0.01
    assert np.nanmedian(ours.dropout) < 0.01
    assert 0.005 < np.nanstd(real.offset) < 0.02
