"""Packets, captures and bags made here and read back; then two recordings of real units."""

from __future__ import annotations

import struct
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from eval.outputs import write_tum
from eval.recordings import RecordingOptions, is_recording, open_recording, poses_at
from eval.recordings.clouds import (
    BadCloud,
    azimuth_fraction,
    read_cloud,
    ring_by_elevation,
    scan_of,
)
from eval.recordings.packets import BATCH, PacketRecording
from eval.recordings.vlp16 import ELEVATIONS, HEIGHTS, RING_OF_LASER, decode, good_packets
from eval.trajectory import Trajectory
from slam.core import Array, InputError, Scan

SHARED = Path(__file__).parents[3] / "shared" / "data" / "vlp16"
OFFICE, ROOM = SHARED / "office_1000_packets.bin", SHARED / "room_293_packets.pcap"

needs_recordings = pytest.mark.skipif(
    not (OFFICE.is_file() and ROOM.is_file()), reason=f"no recordings in {SHARED.parent}"
)

FIRING, LASER = 55.296e-6, 2.304e-6
SINGLE, DUAL = 0x37, 0x39


# --- an encoder, written from the manual and not from the decoder ---------------------------------


def encode(
    units: NDArray[np.int64], azimuth: NDArray[np.int64], start_us: float = 1e6, mode: int = SINGLE
) -> list[bytes]:
    """Packets of firings. units: (F, 16) distances in 2 mm by laser; azimuth: (F,) in 0.01 degrees.

    Reflectivity is the distance modulo 256. In dual mode the last return is 500 units farther than
    the strongest, and darker.
    """
    dual = mode == DUAL
    per_packet = 12 if dual else 24
    packets = []
    for first in range(0, len(units) - per_packet + 1, per_packet):
        blocks = b""
        for pair in range(first, first + per_packet, 2):
            head = struct.pack("<HH", 0xEEFF, azimuth[pair] % 36000)
            near = shots(units[pair : pair + 2], 0, 0)
            blocks += (
                head + shots(units[pair : pair + 2], 500, 1) + head + near if dual else head + near
            )
        microseconds = int(start_us + first * FIRING * 1e6) % 3_600_000_000
        packets.append(blocks + struct.pack("<IBB", microseconds, mode, 0x22))
    return packets


def shots(units: NDArray[np.int64], farther: int, darker: int) -> bytes:
    pairs = ((int(u) + farther, max(int(u) % 256 - darker, 0)) for u in units.ravel())
    return b"".join(struct.pack("<HB", *pair) for pair in pairs)


def turning(firings: int, start: int = 0) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Distances that differ from shot to shot, and a head that turns 0.2 degrees a firing."""
    units = 1000 + (np.arange(firings * 16).reshape(-1, 16) * 7) % 3001
    return units, start + 20 * np.arange(firings)


def write_packets(path: Path, packets: list[bytes]) -> Path:
    path.write_bytes(b"".join(packets))
    return path


def stacked(packets: list[bytes]) -> NDArray[np.uint8]:
    return np.frombuffer(b"".join(packets), dtype=np.uint8).reshape(-1, 1206)


# --- packets --------------------------------------------------------------------------------------


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


# --- sweeps ---------------------------------------------------------------------------------------


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


# --- pcap -----------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Capture:
    """A pcap writer. magic decides the byte order and the unit of time."""

    magic: bytes = b"\xd4\xc3\xb2\xa1"
    link: int = 1
    records: list[bytes] = field(default_factory=list)

    @property
    def order(self) -> str:
        return "<" if self.magic[0] in (0xD4, 0x4D) else ">"

    def frame(
        self, payload: bytes, port: int = 2368, sender: int = 201, protocol: int = 17
    ) -> bytes:
        udp = struct.pack("!HHHH", 2368, port, 8 + len(payload), 0) + payload
        address = bytes([192, 168, 1, sender]) + b"\xff" * 4
        ip = struct.pack("!BBHHHBBH", 0x45, 0, 20 + len(udp), 7, 0x4000, 64, protocol, 0) + address
        head = {1: 14, 113: 16, 276: 20, 101: 0, 0: 4}[self.link]
        return b"\x08" * head + ip + udp

    def add(self, frame: bytes) -> None:
        times = struct.pack(f"{self.order}II", 1_450_000_000, 0)
        lengths = struct.pack(f"{self.order}II", len(frame), len(frame))
        self.records.append(times + lengths + frame)

    def write(self, path: Path) -> Path:
        head = self.magic + struct.pack(f"{self.order}HHiIII", 2, 4, 0, 0, 65535, self.link)
        path.write_bytes(head + b"".join(self.records))
        return path


def capture_of(packets: list[bytes], capture: Capture) -> Capture:
    for packet in packets:
        capture.add(capture.frame(packet))
    return capture


@pytest.mark.parametrize(
    "magic", [b"\xd4\xc3\xb2\xa1", b"\xa1\xb2\xc3\xd4", b"\x4d\x3c\xb2\xa1", b"\xa1\xb2\x3c\x4d"]
)
@pytest.mark.parametrize("link", [0, 1, 101, 113, 276])
def test_pcap_gives_what_the_bare_packets_give(tmp_path: Path, magic: bytes, link: int) -> None:
    packets = encode(*turning(1800))
    bare = list(open_recording(write_packets(tmp_path / "a.bin", packets)))
    path = capture_of(packets, Capture(magic, link)).write(tmp_path / "a.pcap")
    (scan,) = open_recording(path)
    assert np.array_equal(scan.points, bare[0].points)
    assert scan.stamp == bare[0].stamp


def test_other_traffic_is_ignored_and_bad_packets_are_counted(tmp_path: Path) -> None:
    capture = Capture()
    for number, packet in enumerate(encode(*turning(1800))):
        capture.add(capture.frame(packet))
        if number % 10 == 0:
            capture.add(capture.frame(b"\0" * 512, port=8308))
            capture.add(capture.frame(b"\0" * 512))
            capture.add(capture.frame(packet, sender=202))  # a second sensor
            capture.add(capture.frame(packet, protocol=6))
            capture.add(b"\x08" * 20)
    capture.add(capture.frame(b"\0" * 1000))
    recording = PacketRecording(capture.write(tmp_path / "a.pcap"))
    (scan,) = recording
    assert len(scan) == 1800 * 16
    assert recording.bad_packets == 1


def test_vlan_tags_are_seen_through(tmp_path: Path) -> None:
    capture = Capture()
    for packet in encode(*turning(1800)):
        frame = capture.frame(packet)
        capture.add(frame[:12] + b"\x81\x00\x00\x05\x08\x00" + frame[14:])
    assert len(list(open_recording(capture.write(tmp_path / "a.pcap")))) == 1


def test_a_truncated_pcap_gives_what_is_whole(tmp_path: Path) -> None:
    path = capture_of(encode(*turning(2 * 1800)), Capture()).write(tmp_path / "a.pcap")
    path.write_bytes(path.read_bytes()[:-700])
    recording = PacketRecording(path)
    assert len(list(recording)) == 2  # of the second, 24 of 1,800 firings are gone
    assert recording.bad_packets == 1


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (b"\xd4\xc3\xb2\xa1\x02\x00", "cut off"),
        (b"\x0a\x0d\x0d\x0a" + b"\0" * 60, "pcapng"),
        (b"GIF89a" + b"\0" * 5000, "no VLP-16 data packet"),
        (b"", "no VLP-16 data packet"),
        (Capture(link=1).magic + struct.pack("<HHiIII", 2, 4, 0, 0, 65535, 195), "link type 195"),
        (Capture().magic + struct.pack("<HHiIII", 2, 4, 0, 0, 65535, 1), "no VLP-16 data packet"),
    ],
)
def test_foreign_captures_are_refused(tmp_path: Path, content: bytes, message: str) -> None:
    path = tmp_path / "a.pcap"
    path.write_bytes(content)
    with pytest.raises(InputError, match=message) as caught:
        list(open_recording(path))
    assert "a.pcap" in str(caught.value)
    assert "\n" not in str(caught.value)


def test_what_is_no_recording_is_refused(tmp_path: Path) -> None:
    other = tmp_path / "plan.json"
    other.write_text("{}")
    for path in (other, tmp_path, tmp_path / "absent.pcap"):
        with pytest.raises(InputError, match=path.name):
            open_recording(path)
    assert not is_recording(other)
    assert not is_recording("SE1")
    assert is_recording("drive.PCAP")


# --- point clouds ---------------------------------------------------------------------------------


@dataclass
class Field:
    name: str
    offset: int
    datatype: int
    count: int = 1


@dataclass
class Cloud:
    height: int
    width: int
    fields: list[Field]
    is_bigendian: bool
    point_step: int
    row_step: int
    data: NDArray[np.uint8]


CODES = {"i1": 1, "u1": 2, "i2": 3, "u2": 4, "i4": 5, "u4": 6, "f4": 7, "f8": 8}


def cloud_of(order: str = "<", height: int = 1, padding: int = 0, **columns: Array) -> Cloud:
    """A message with these columns; their types are kept."""
    record = np.dtype([(name, order + c.dtype.str[1:]) for name, c in columns.items()])
    table = np.empty(len(columns["x"]), dtype=record)
    for name, column in columns.items():
        table[name] = column
    fields = [Field(n, record.fields[n][1], CODES[c.dtype.str[1:]]) for n, c in columns.items()]
    width = len(table) // height
    rows = np.frombuffer(table.tobytes(), np.uint8).reshape(height, -1)
    rows = np.pad(rows, ((0, 0), (0, padding)))
    return Cloud(height, width, fields, order == ">", record.itemsize, rows.shape[1], rows.ravel())


def ring_of_points(n: int = 360, elevation: float = 0.1) -> dict[str, Array]:
    """A clockwise turn at 3 m, from behind."""
    azimuth = np.pi - 2.0 * np.pi * np.arange(n) / n
    level = 3.0 * np.cos(elevation)
    xyz = level * np.cos(azimuth), level * np.sin(azimuth), np.full(n, 3.0 * np.sin(elevation))
    return dict(zip("xyz", (c.astype(np.float32) for c in xyz), strict=True))


def scan_from(cloud: Cloud, stamp: float = 100.0) -> Scan:
    return scan_of(read_cloud(cloud), 0, stamp, 0.1, np.eye(4))


SECONDS = np.linspace(0.0, 0.0999, 360)


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


# --- bags -----------------------------------------------------------------------------------------


@dataclass
class Bag:
    """What a bag is made of: (topic, stamp, message) of clouds and of poses (4, 4)."""

    clouds: list[tuple[str, float, Cloud]]
    odometry: list[tuple[str, float, Array]] = field(default_factory=list)
    poses: list[tuple[str, float, Array]] = field(default_factory=list)

    def write(self, path: Path, kind: str) -> Path:
        """kind: ros1, sqlite3 or mcap. Returns what to open."""
        rosbag1 = pytest.importorskip("rosbags.rosbag1")
        from rosbags.rosbag2 import StoragePlugin, Writer
        from rosbags.typesys import Stores, get_typestore

        ros1 = kind == "ros1"
        store = get_typestore(Stores.ROS1_NOETIC if ros1 else Stores.ROS2_HUMBLE)
        path = path.with_suffix(".bag") if ros1 else path
        plugins = {"sqlite3": StoragePlugin.SQLITE3, "mcap": StoragePlugin.MCAP}
        writer = (
            rosbag1.Writer(path) if ros1 else Writer(path, version=9, storage_plugin=plugins[kind])
        )
        serialize = store.serialize_ros1 if ros1 else store.serialize_cdr
        with writer:
            links = {}
            for topic, stamp, message in self._messages(store, ros1):
                name = message.__msgtype__
                if topic not in links:
                    links[topic] = writer.add_connection(topic, name, typestore=store)
                writer.write(links[topic], round(stamp * 1e9), serialize(message, name))
        return path

    def _messages(self, store: object, ros1: bool) -> list[tuple[str, float, object]]:
        types = store.types
        header = {"seq": 0} if ros1 else {}

        def head(stamp: float) -> object:
            time = types["builtin_interfaces/msg/Time"](int(stamp), round(stamp % 1 * 1e9))
            return types["std_msgs/msg/Header"](stamp=time, frame_id="lidar", **header)

        def posed(T: Array) -> object:
            from slam.core import quaternion_xyzw

            point = types["geometry_msgs/msg/Point"](*T[:3, 3])
            turn = types["geometry_msgs/msg/Quaternion"](*quaternion_xyzw(T[:3, :3]))
            return types["geometry_msgs/msg/Pose"](point, turn)

        out: list[tuple[str, float, object]] = []
        for topic, stamp, c in self.clouds:
            fields = [
                types["sensor_msgs/msg/PointField"](f.name, f.offset, f.datatype, f.count)
                for f in c.fields
            ]
            shape = (c.is_bigendian, c.point_step, c.row_step, c.data, True)
            message = types["sensor_msgs/msg/PointCloud2"](
                head(stamp), c.height, c.width, fields, *shape
            )
            out.append((topic, stamp, message))
        for topic, stamp, T in self.poses:
            out.append(
                (topic, stamp, types["geometry_msgs/msg/PoseStamped"](head(stamp), posed(T)))
            )
        for topic, stamp, T in self.odometry:
            zero = types["geometry_msgs/msg/Vector3"](0.0, 0.0, 0.0)
            twist = types["geometry_msgs/msg/Twist"](zero, zero)
            spread = np.zeros(36)
            message = types["nav_msgs/msg/Odometry"](
                head(stamp),
                "base",
                types["geometry_msgs/msg/PoseWithCovariance"](posed(T), spread),
                types["geometry_msgs/msg/TwistWithCovariance"](twist, spread),
            )
            out.append((topic, stamp, message))
        return sorted(out, key=lambda item: item[1])


def timed_cloud(shift: float = 0.0) -> Cloud:
    columns = ring_of_points()
    columns["x"] = columns["x"] + np.float32(shift)
    ring = np.full(360, 9, dtype=np.uint16)
    return cloud_of(**columns, ring=ring, time=(SECONDS - 0.1).astype(np.float32))


def drive(n: int = 5) -> list[tuple[str, float, Cloud]]:
    return [("/points", 100.0 + 0.1 * i, timed_cloud(0.01 * i)) for i in range(n)]


def shifted(x: float) -> Array:
    T = np.eye(4)
    T[0, 3] = x
    return T


@pytest.mark.parametrize("kind", ["ros1", "sqlite3", "mcap"])
def test_a_bag_is_read_back(tmp_path: Path, kind: str) -> None:
    bag = Bag(drive(), odometry=[("/odom", 100.0 + 0.1 * i, shifted(i)) for i in range(5)])
    recording = open_recording(bag.write(tmp_path / "drive", kind))
    assert recording.count == 5
    assert recording.duration == pytest.approx(0.4, abs=1e-6)
    assert recording.truth is None  # odometry is no truth
    for _ in range(2):
        scans = list(recording)
        assert [scan.index for scan in scans] == list(range(5))
        assert [scan.stamp for scan in scans] == pytest.approx([100.0 + 0.1 * i for i in range(5)])
        assert scans[3].points[:, 0] - scans[0].points[:, 0] == pytest.approx(0.03, abs=1e-6)
        assert scans[0].times == pytest.approx(SECONDS - 0.1, abs=1e-7)
    assert recording.skipped == 0


@pytest.mark.parametrize(("kind", "pattern"), [("sqlite3", "*.db3"), ("mcap", "*.mcap")])
def test_a_bag_s_only_file_will_do(tmp_path: Path, kind: str, pattern: str) -> None:
    folder = Bag(drive()).write(tmp_path / "drive", kind)
    (file,) = folder.glob(pattern)
    assert len(list(open_recording(file))) == 5


def test_bad_scans_in_a_bag_are_skipped(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    nan = {name: np.full(360, np.nan, dtype=np.float32) for name in "xyz"}
    clouds = drive(4)
    clouds.insert(2, ("/points", 100.15, cloud_of(**nan)))
    clouds[3] = ("/points", 100.2, cloud_of(**ring_of_points(), t=np.full(360, 7, dtype=np.uint32)))
    bag = Bag(clouds)
    recording = open_recording(bag.write(tmp_path / "drive", "mcap"))
    assert len(list(recording)) == 4
    assert recording.skipped == 1
    assert "finite" in caplog.text


def test_stamps_that_run_backwards_are_skipped(tmp_path: Path) -> None:
    clouds = drive(4)
    path = Bag(clouds).write(tmp_path / "drive", "mcap")
    recording = open_recording(path)
    messages = recording._scans  # the third scan is delivered twice
    scans = list(messages())
    recording._scans = lambda: iter([*scans[:3], scans[1], scans[3]])
    assert [scan.stamp for scan in recording] == [scans[i].stamp for i in (0, 1, 2, 3)]
    assert recording.skipped == 1


def test_missing_times_are_said_once(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    clouds = [("/points", 100.0 + 0.1 * i, cloud_of(**ring_of_points())) for i in range(3)]
    scans = list(open_recording(Bag(clouds).write(tmp_path / "drive", "mcap")))
    assert caplog.text.count("without times") == 1
    assert caplog.text.count("without rings") == 1
    assert np.ptp(scans[2].times) == pytest.approx(0.1, rel=0.01)


def test_several_topics_need_a_choice(tmp_path: Path) -> None:
    clouds = [*drive(3), ("/rear", 100.05, timed_cloud())]
    path = Bag(clouds).write(tmp_path / "drive", "sqlite3")
    with pytest.raises(InputError, match="/points, /rear"):
        open_recording(path)
    with pytest.raises(InputError, match="/front: expected one of /points, /rear"):
        open_recording(path, RecordingOptions(topic="/front"))
    assert len(list(open_recording(path, RecordingOptions(topic="/rear")))) == 1


def test_a_bag_without_point_clouds_is_refused(tmp_path: Path) -> None:
    bag = Bag([], poses=[("/pose", 1.0, np.eye(4))])
    with pytest.raises(InputError, match="no sensor_msgs/PointCloud2 topic, it holds /pose"):
        open_recording(bag.write(tmp_path / "drive", "mcap"))


def test_a_bag_of_bad_scans_only_is_refused(tmp_path: Path) -> None:
    good = ring_of_points()
    clouds = [("/points", 1.0 + i, cloud_of(x=good["x"], y=good["y"])) for i in range(2)]
    recording = open_recording(Bag(clouds).write(tmp_path / "drive", "mcap"))
    with pytest.raises(InputError, match="no good scan in /points: .* expected x, y and z"):
        list(recording)
    assert recording.skipped == 2


@pytest.mark.parametrize("name", ["a.bag", "a.db3", "a.mcap"])
@pytest.mark.parametrize("keep", [0, 7, 600])
def test_damaged_bags_are_refused(tmp_path: Path, name: str, keep: int) -> None:
    kind = {"a.bag": "ros1", "a.db3": "sqlite3", "a.mcap": "mcap"}[name]
    bag = Bag(drive()).write(tmp_path / "drive", kind)
    source = bag if bag.is_file() else next(bag.glob(f"*{Path(name).suffix}"))
    path = tmp_path / name
    path.write_bytes(source.read_bytes()[:keep])
    with pytest.raises(InputError, match=name) as caught:
        list(open_recording(path))
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("word", ["odometry", "poses"])
def test_truth_comes_from_a_topic(tmp_path: Path, word: str) -> None:
    truth = [("/ground_truth", 99.95 + 0.1 * i, shifted(0.1 * i)) for i in range(6)]
    recording = open_recording(Bag(drive(), **{word: truth}).write(tmp_path / "drive", "mcap"))
    assert recording.truth is not None
    assert recording.truth.positions[:, 0] == pytest.approx(0.1 * np.arange(6))
    poses, known = poses_at(recording.truth, np.array([scan.stamp for scan in recording]))
    assert known.all()
    assert poses[:, 0, 3] == pytest.approx(0.05 + 0.1 * np.arange(5), abs=1e-6)


def test_truth_comes_from_a_file_or_a_named_topic(tmp_path: Path) -> None:
    bag = Bag(drive(), odometry=[("/odom", 100.0 + 0.1 * i, shifted(i)) for i in range(5)])
    path = bag.write(tmp_path / "drive", "mcap")
    named = open_recording(path, RecordingOptions(truth="/odom")).truth
    assert named is not None
    assert named.positions[:, 0] == pytest.approx(np.arange(5))
    with pytest.raises(InputError, match="/absent: expected a .tum file or one of: /odom"):
        open_recording(path, RecordingOptions(truth="/absent"))
    write_tum(Trajectory(np.array([100.0, 101.0]), np.array([np.eye(4)] * 2)), path / "truth.tum")
    beside = open_recording(path).truth
    assert beside is not None
    assert len(beside) == 2


def test_packets_take_truth_from_a_file_only(tmp_path: Path) -> None:
    path = write_packets(tmp_path / "a.bin", encode(*turning(1800)))
    write_tum(Trajectory(np.array([1.0, 1.2]), np.array([np.eye(4)] * 2)), tmp_path / "a.tum")
    truth = open_recording(path).truth
    assert truth is not None
    assert len(truth) == 2
    with pytest.raises(InputError, match="expected a .tum file"):
        open_recording(path, RecordingOptions(truth="/odom"))


def test_truth_is_not_made_up_across_gaps() -> None:
    truth = Trajectory(np.array([0.0, 1.0, 3.0]), np.array([shifted(x) for x in (0, 1, 3)]))
    _, known = poses_at(truth, np.array([-0.1, 0.5, 2.0, 3.5]), longest_gap=1.5)
    assert known.tolist() == [False, True, False, False]
    assert not poses_at(truth, np.array([100.0]))[1].any()


# --- real units -----------------------------------------------------------------------------------


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
