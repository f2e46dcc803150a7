"""Packets are decoded as the manual has it, and cut into sweeps."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from packetfiles import DUAL, FIRING, LASER, SINGLE, encode, stacked, turning, write_packets

from eval.recordings import open_recording
from eval.recordings.packets import BATCH, PacketRecording
from eval.recordings.vlp16 import ELEVATIONS, HEIGHTS, RING_OF_LASER, decode, good_packets
from slam.core import InputError


def test_decoding_gives_exact_ranges_angles_and_times() -> None:
    units, azimuth = turning(48, start=35800)
    firings = decode(stacked(encode(units, azimuth)))
    laser = np.arange(16)
    for ring in range(16):
        k = int(laser[ring == RING_OF_LASER][0])
        assert firings.ranges[:, ring] == pytest.approx(units[:, k] * 0.002, abs=1e-12)
        degrees = (azimuth / 100.0 + 0.2 * k * LASER / FIRING) % 360.0
        assert np.degrees(firings.azimuth[:, ring]) == pytest.approx(degrees, abs=1e-9)
        seconds = 1.0 + np.arange(48) * FIRING + k * LASER
        assert firings.times[:, ring] == pytest.approx(seconds, abs=1e-6)  # whole microseconds
        assert firings.intensity[:, ring] == pytest.approx(units[:, k] % 256 / 255.0)


def test_lasers_and_rings_are_those_of_the_manual() -> None:
    table = [-15, 1, -13, 3, -11, 5, -9, 7, -7, 9, -5, 11, -3, 13, -1, 15]
    assert np.degrees(ELEVATIONS[RING_OF_LASER]) == pytest.approx(table)
    assert (np.diff(ELEVATIONS) > 0.0).all()
    assert HEIGHTS[0] == pytest.approx(0.0112)
    # All beams cross the axis in one point's neighbourhood: the correction grows with the slope.
    assert pytest.approx(-0.0419 * np.tan(ELEVATIONS), abs=1.5e-4) == HEIGHTS


@pytest.mark.parametrize(("degrees", "xy"), [(0, (1, 0)), (90, (0, -1)), (180, (-1, 0))])
def test_azimuth_turns_clockwise_from_ahead(degrees: int, xy: tuple[int, int]) -> None:
    units = np.full((24, 16), 5000)
    firings = decode(stacked(encode(units, np.full(24, degrees * 100))))
    point = firings.points[0, 0]
    assert point[:2] == pytest.approx(10.0 * np.cos(np.radians(15.0)) * np.array(xy), abs=1e-9)
    assert point[2] == pytest.approx(-10.0 * np.sin(np.radians(15.0)) + 0.0112)


def test_dual_returns_give_the_brighter_at_single_timing() -> None:
    units, azimuth = turning(48)
    single, dual = (decode(stacked(encode(units, azimuth, mode=mode))) for mode in (SINGLE, DUAL))
    assert dual.ranges.shape == (48, 16)
    tie = units % 256 == 0  # equally dark: the last return is taken
    by_ring = units[:, np.argsort(RING_OF_LASER)]
    assert np.array_equal(
        np.round(dual.ranges / 0.002), by_ring + 500 * tie[:, np.argsort(RING_OF_LASER)]
    )
    assert dual.azimuth == pytest.approx(single.azimuth)
    assert dual.times == pytest.approx(single.times, abs=2e-6)


@settings(max_examples=25, deadline=None)
@given(st.integers(0, 1199), st.integers(0, 255))
def test_a_packet_with_a_foreign_flag_or_azimuth_is_told(place: int, value: int) -> None:
    raw = stacked(encode(*turning(24))).copy()
    assert good_packets(raw).tolist() == [True]
    raw[0, place] = value
    block = raw[0, : 12 * 100].reshape(12, 100)[:, :4].copy().view("<u2")
    assert good_packets(raw).tolist() == [
        bool((block[:, 0] == 0xEEFF).all() and (block[:, 1] < 36000).all())
    ]


def test_sweeps_are_cut_at_the_wrap_and_partial_ones_left_out(tmp_path: Path) -> None:
    units, azimuth = turning(4 * 1800, start=9000)  # from 90 degrees on: three whole turns
    recording = PacketRecording(write_packets(tmp_path / "a.bin", encode(units, azimuth)))
    sweeps = list(recording.sweeps())
    assert [len(sweep.firings) for sweep in sweeps] == [1800] * 3
    for sweep in sweeps:
        scan = sweep.scan
        assert sweep.firings.azimuth[0, 0] == pytest.approx(0.0, abs=1e-9)
        assert scan.times.max() <= 0.0
        assert (np.diff(scan.times) > 0.0).all()
        assert scan.times[0] == pytest.approx(-1800 * FIRING, abs=3e-6)
        assert scan.times[-1] == pytest.approx(15 * LASER - FIRING, abs=1e-9)
        assert sweep.shots.tolist() == sweep.returns.tolist() == [1800] * 16
        assert set(scan.ring) == set(range(16))
    stamps = [sweep.scan.stamp for sweep in sweeps]
    assert np.diff(stamps) == pytest.approx(1800 * FIRING, abs=3e-6)
    assert stamps[0] == pytest.approx(1.0 + (1350 + 1800) * FIRING, abs=3e-6)
    assert [scan.index for scan in recording] == [0, 1, 2]
    assert (recording.skipped, recording.bad_packets) == (0, 0)


def test_shots_without_a_return_are_counted_and_no_points(tmp_path: Path) -> None:
    units, azimuth = turning(1800)
    units[::3, 4] = 0  # laser 4 is ring 2
    path = write_packets(tmp_path / "a.bin", encode(units, azimuth))
    (sweep,) = PacketRecording(path).sweeps()
    assert sweep.returns.tolist() == [1200 if ring == 2 else 1800 for ring in range(16)]
    assert len(sweep.scan) == 16 * 1800 - 600
    assert np.linalg.norm(sweep.scan.points, axis=1).min() > 1.9


def test_points_do_not_depend_on_how_packets_are_batched(tmp_path: Path) -> None:
    units, azimuth = turning(24 * (BATCH + 50))
    path = write_packets(tmp_path / "a.bin", encode(units, azimuth))
    whole = decode(stacked(encode(units, azimuth)))
    recording = PacketRecording(path)
    assert np.concatenate([part.points for part in recording.firings()]) == pytest.approx(
        whole.points
    )
    first, again = list(recording), list(recording)
    assert all(np.array_equal(a.points, b.points) for a, b in zip(first, again, strict=True))


def test_the_clock_goes_on_over_the_full_hour(tmp_path: Path) -> None:
    units, azimuth = turning(3 * 1800)
    path = write_packets(tmp_path / "a.bin", encode(units, azimuth, start_us=3600e6 - 150_000))
    stamps = [scan.stamp for scan in PacketRecording(path)]
    assert np.diff(stamps) == pytest.approx([1800 * FIRING] * 2, abs=3e-6)
    assert stamps[-1] > 3600.0


def test_bad_packets_and_bad_sweeps_are_counted(tmp_path: Path) -> None:
    units, azimuth = turning(4 * 1800)
    units[1800:3600] = 0  # the second turn returns nothing
    packets = encode(units, azimuth)
    packets[200] = b"\0" * 1206
    packets[210] = packets[210][:1204] + bytes([SINGLE, 0x28])  # another product
    packets[211] = packets[211][:1204] + bytes([DUAL, 0x22])  # another return mode
    recording = PacketRecording(write_packets(tmp_path / "a.bin", [*packets, b"cut off"]))
    assert len(list(recording)) == 3
    assert (recording.skipped, recording.bad_packets) == (1, 4)


def test_a_long_silence_makes_a_bad_sweep(tmp_path: Path) -> None:
    packets = encode(*turning(5 * 1800))
    del packets[80:145]  # most of the second turn
    del packets[-80:-75]  # a little of the fourth
    recording = PacketRecording(write_packets(tmp_path / "a.bin", packets))
    assert len(list(recording)) == 4
    assert recording.skipped == 1


def test_a_silence_of_a_whole_turn_does_not_join_two(tmp_path: Path) -> None:
    packets = encode(*turning(6 * 1800))
    del packets[95:180]  # from one third of the second turn to two fifths of the third
    recording = PacketRecording(write_packets(tmp_path / "a.bin", packets))
    scans = list(recording)
    assert recording.skipped == 1
    assert len(scans) == 5
    assert max(np.ptp(scan.times) for scan in scans) < 0.1


def test_less_than_a_sweep_is_refused(tmp_path: Path) -> None:
    path = write_packets(tmp_path / "a.bin", encode(*turning(900)))
    with pytest.raises(InputError, match="no whole sweep"):
        list(open_recording(path))


# --- recordings of real units ---------------------------------------------------------------------

SHARED = Path(__file__).parents[4] / "shared" / "data" / "vlp16"
OFFICE, ROOM = SHARED / "office_1000_packets.bin", SHARED / "room_293_packets.pcap"

needs_recordings = pytest.mark.skipif(
    not (OFFICE.is_file() and ROOM.is_file()), reason=f"no recordings in {SHARED.parent}"
)


@needs_recordings
@pytest.mark.parametrize(
    ("path", "sweeps", "first_azimuth"), [(OFFICE, 12, 103.42), (ROOM, 3, 118.88)]
)
def test_real_recordings(path: Path, sweeps: int, first_azimuth: float) -> None:
    recording = open_recording(path)
    scans = list(recording)
    assert isinstance(recording, PacketRecording)
    assert len(scans) == sweeps
    assert (recording.skipped, recording.bad_packets) == (0, 0)
    assert np.diff([scan.stamp for scan in scans]) == pytest.approx(0.1, rel=0.005)
    firings = list(recording.firings())
    assert np.degrees(firings[0].azimuth[0, 0]) == pytest.approx(first_azimuth)
    azimuth = np.unwrap(np.concatenate([part.azimuth[:, 0] for part in firings]))
    assert np.degrees(np.diff(azimuth)).mean() == pytest.approx(0.2, rel=0.01)
    ranges = np.linalg.norm(np.concatenate([scan.points for scan in scans]), axis=1)
    assert ranges.min() > 0.49
    assert ranges.max() < 15.0
