"""UDP payloads out of a classic pcap file."""

from __future__ import annotations

import logging
import struct
from collections.abc import Iterator
from pathlib import Path
from typing import BinaryIO

from slam.core import InputError
from slam.plainfile import size_of

logger = logging.getLogger(__name__)

DATA_PORT = 2368
"""Where a Velodyne sends its data packets; its position packets go to 8308."""

BYTE_ORDER = {
    b"\xd4\xc3\xb2\xa1": "<",
    b"\xa1\xb2\xc3\xd4": ">",
    b"\x4d\x3c\xb2\xa1": "<",
    b"\xa1\xb2\x3c\x4d": ">",
}
"""By magic number: microseconds first, then nanoseconds. Capture times are not used: a sensor's
packets carry its own, better ones."""

PCAPNG = b"\x0a\x0d\x0d\x0a"
LONGEST_RECORD = 1 << 18

ETHERNET, RAW_BSD, RAW, RAW_OPENBSD, COOKED, IPV4, COOKED_2 = 1, 12, 101, 14, 113, 228, 276
NULL = 0
IP_OFFSET = {NULL: 4, ETHERNET: 14, RAW_BSD: 0, RAW_OPENBSD: 0, RAW: 0, COOKED: 16, IPV4: 0}
IP_OFFSET[COOKED_2] = 20
VLAN = b"\x81\x00"
UDP = 17


class PcapPayloads:
    """Payloads of the UDP packets to ``port`` in a capture, in file order.

    Packets of a second sender are left out: two sensors in one stream of packets make no sweep.
    ``damaged``: records that were cut off or could not be taken apart, as far as read. Raises
    InputError for what is no classic pcap.
    """

    def __init__(self, path: Path, port: int = DATA_PORT) -> None:
        self.path = path
        self.port = port
        self.damaged = 0
        with opened(path) as file:
            self._order, self._ip_offset = _header(file, path)

    def __iter__(self) -> Iterator[bytes]:
        self.damaged = 0
        sender: bytes | None = None
        with opened(self.path) as file:
            file.seek(24)
            for frame in self._frames(file):
                source, payload = udp_payload(frame, self._ip_offset, self.port)
                sender = sender or source
                if payload is not None and source == sender:
                    yield payload

    def _frames(self, file: BinaryIO) -> Iterator[bytes]:
        """The captured frames, up to the end or the first record that makes no sense."""
        while head := file.read(16):
            captured, original = struct.unpack(f"{self._order}II", head[8:].ljust(8, b"\0"))
            frame = file.read(captured) if captured <= LONGEST_RECORD else b""
            if len(head) < 16 or captured > original or len(frame) < captured:
                self._stop(file.tell())
                return
            yield frame

    def _stop(self, place: int) -> None:
        self.damaged += 1
        logger.warning("%s: damaged or cut off near byte %d: read up to there", self.path, place)


def udp_payload(frame: bytes, ip_offset: int, port: int) -> tuple[bytes | None, bytes | None]:
    """(sender's address, payload) of a frame that carries a whole UDP packet to ``port``.

    (None, None) for anything else: other protocols and ports, IPv6, fragments.
    """
    if ip_offset == IP_OFFSET[ETHERNET] and frame[12:14] == VLAN:
        ip_offset += 4
    ip = frame[ip_offset:]
    if len(ip) < 28 or ip[0] >> 4 != 4 or ip[9] != UDP:
        return None, None
    fragment = struct.unpack("!H", ip[6:8])[0] & 0x3FFF
    udp = ip[4 * (ip[0] & 0x0F) :]
    if fragment or len(udp) < 8:
        return None, None
    target, length = struct.unpack("!HH", udp[2:6])
    if target != port:
        return None, None
    return ip[12:16], udp[8:length]


def is_pcap(start: bytes) -> bool:
    """Whether a file that starts so is a capture (pcapng, too: it is refused with a hint)."""
    return start[:4] in BYTE_ORDER or start[:4] == PCAPNG


def opened(path: Path) -> BinaryIO:
    """A file to read from. Raises InputError where it cannot be read."""
    size_of(path)
    try:
        return path.open("rb")
    except OSError as error:
        raise InputError(f"{path}: cannot be read: {error.strerror or error}") from error


def _header(file: BinaryIO, path: Path) -> tuple[str, int]:
    """Byte order, and where the IP packet begins in a frame."""
    head = file.read(24)
    if head[:4] == PCAPNG:
        raise InputError(f"{path}: pcapng, expected classic pcap (editcap -F pcap converts it)")
    order = BYTE_ORDER.get(head[:4])
    if order is None:
        raise InputError(f"{path}: not a pcap file")
    if len(head) < 24:
        raise InputError(f"{path}: cut off within the pcap header")
    link = struct.unpack(f"{order}I", head[20:24])[0] & 0xFFFF
    if link not in IP_OFFSET:
        known = ", ".join(map(str, sorted(IP_OFFSET)))
        raise InputError(f"{path}: link type {link}, expected one of {known}")
    return order, IP_OFFSET[link]
