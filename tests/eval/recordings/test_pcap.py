"""Captures of packets, and what is none."""

from __future__ import annotations

import struct
from pathlib import Path

import numpy as np
import pytest
from packetfiles import Capture, capture_of, encode, turning, write_packets

from eval.recordings import is_recording, open_recording
from eval.recordings.packets import PacketRecording
from slam.core import InputError


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
