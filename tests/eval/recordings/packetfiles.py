"""VLP-16 packets and captures of them, written from the manual and not from the decoder."""

from __future__ import annotations

import struct
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

FIRING, LASER = 55.296e-6, 2.304e-6
SINGLE, DUAL = 0x37, 0x39


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
