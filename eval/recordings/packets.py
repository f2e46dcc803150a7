"""VLP-16 data packets in a file, as sweeps: a pcap, or nothing but packets one after another."""

from __future__ import annotations

import logging
from collections.abc import Iterable, Iterator
from itertools import pairwise
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from eval.recordings.pcap import PcapPayloads, is_pcap, opened
from eval.recordings.recording import RecordingOptions, is_tum, truth_beside
from eval.recordings.vlp16 import (
    FIRING_PERIOD,
    HEIGHTS,
    HOUR,
    PACKET_BYTES,
    RING_OF_LASER,
    Firings,
    Sweep,
    concatenate,
    decode,
    good_packets,
    is_dual,
)
from sim.calibration.shots import Shots
from slam.core import Array, InputError, Scan

logger = logging.getLogger(__name__)

POSITION_BYTES = 512
"""Length of the GPS packets."""
BATCH = 256
"""Packets decoded at a time: about a third of a second."""
PACKET_PERIOD = 24 * FIRING_PERIOD
WHOLE = 0.985
"""Share of a turn that the first and the last sweep of a recording must have."""
USEFUL = 0.5
"""Share of a turn below which any other sweep is bad."""


class PacketRecording:
    """Sweeps of one VLP-16, cut where its azimuth passes 0, straight ahead.

    Stamps are the sensor's clock: seconds since the full hour before the first packet. The turns
    under way when the recording began and ended are left out. ``bad_packets``: how many so far
    were of another length, product or return mode, or damaged. Raises InputError for a file without
    any data packet of a VLP-16.
    """

    def __init__(self, path: Path, options: RecordingOptions = RecordingOptions()) -> None:  # noqa: B008
        self.path = path
        if options.truth is not None and not is_tum(options.truth):
            raise InputError(f"{path}: truth {options.truth}: expected a .tum file")
        self.truth = truth_beside(path, options)
        self.count: int | None = None
        self.skipped = 0
        self.bad_packets = 0
        T_base_lidar = options.T_base_lidar
        self._T_base_lidar = np.eye(4) if T_base_lidar is None else T_base_lidar
        self._payloads = _payloads(path)
        self._dual = self._first_is_dual()
        period = PACKET_PERIOD / 2.0 if self._dual else PACKET_PERIOD
        self.duration: float | None = path.stat().st_size / PACKET_BYTES * period

    def __iter__(self) -> Iterator[Scan]:
        for sweep in self.sweeps():
            yield sweep.scan

    def sweeps(self) -> Iterator[Sweep]:
        """The scans, each beside all of its shots."""
        self.skipped = 0
        index, last = 0, -np.inf
        for turn in self._good_turns():
            sweep = sweep_of(index, turn, self._T_base_lidar)
            if len(sweep.scan) and sweep.scan.stamp > last:
                yield sweep
                index, last = index + 1, sweep.scan.stamp
            else:
                self.skipped += 1
        if index == 0:
            raise InputError(f"{self.path}: no whole sweep with a return in it")

    def firings(self) -> Iterator[Firings]:
        """Everything in the recording, in batches; unfinished turns as well."""
        self.bad_packets = 0
        return unwrap_hours(map(decode, self._batches()))

    def shots(self) -> Shots:
        """Everything in the recording, as it is for calibration: returned or not."""
        all_firings = concatenate(self.firings())
        return Shots(
            directions=all_firings.directions,
            ranges=all_firings.ranges,
            times=all_firings.times,
            intensity=all_firings.intensity,
            heights=HEIGHTS,
        )

    def _good_turns(self) -> Iterator[Firings]:
        held: Firings | None = None
        first = True
        for turn in cut_turns(self.firings()):
            if held is not None:
                yield from self._checked(held, first)
                first = False
            held = turn
        if held is not None:
            yield from self._checked(held, at_edge=True)

    def _checked(self, turn: Firings, at_edge: bool) -> Iterator[Firings]:
        share = coverage(turn)
        if share >= (WHOLE if at_edge else USEFUL):
            yield turn
        elif not at_edge:
            self.skipped += 1

    def _batches(self) -> Iterator[NDArray[np.uint8]]:
        """Good packets (P, 1206) of the kind that came first."""
        for raw in _stacked(self._data_packets()):
            good = good_packets(raw) & (is_dual(raw) == self._dual)
            self.bad_packets += int(np.count_nonzero(~good))
            if good.any():
                yield raw[good]
        if self.bad_packets:
            logger.warning("%s: %d bad packets left out", self.path, self.bad_packets)

    def _data_packets(self) -> Iterator[bytes]:
        for payload in self._payloads:
            if len(payload) == PACKET_BYTES:
                yield payload
            elif len(payload) != POSITION_BYTES:
                self.bad_packets += 1
        self.bad_packets += self._payloads.damaged

    def _first_is_dual(self) -> bool:
        seen = 0
        for raw in _stacked(self._data_packets()):
            seen += len(raw)
            good = good_packets(raw)
            if good.any():
                return bool(is_dual(raw[good])[0])
        raise InputError(f"{self.path}: no VLP-16 data packet among {seen} of {PACKET_BYTES} bytes")


class PackedPayloads:
    """Data packets one after another, with nothing between them. ``damaged``: 1 if the last one is
    cut off."""

    def __init__(self, path: Path) -> None:
        self.path = path
        self.damaged = 0

    def __iter__(self) -> Iterator[bytes]:
        self.damaged = 0
        with opened(self.path) as file:
            while payload := file.read(PACKET_BYTES):
                if len(payload) < PACKET_BYTES:
                    self.damaged = 1
                    return
                yield payload


def holds_packets(path: Path) -> bool:
    """Whether a file begins like a capture or like a Velodyne data packet, or is named like one."""
    if path.is_dir():
        return False
    with opened(path) as file:
        start = file.read(4)
    return is_pcap(start) or start[:2] == b"\xff\xee" or path.suffix in (".pcap", ".bin")


def _payloads(path: Path) -> PcapPayloads | PackedPayloads:
    with opened(path) as file:
        start = file.read(4)
    return PcapPayloads(path) if is_pcap(start) else PackedPayloads(path)


def _stacked(payloads: Iterable[bytes]) -> Iterator[NDArray[np.uint8]]:
    """(up to BATCH, 1206) at a time."""
    batch: list[bytes] = []
    for payload in payloads:
        batch.append(payload)
        if len(batch) == BATCH:
            yield _stack(batch)
            batch = []
    if batch:
        yield _stack(batch)


def _stack(batch: list[bytes]) -> NDArray[np.uint8]:
    return np.frombuffer(b"".join(batch), dtype=np.uint8).reshape(-1, PACKET_BYTES)


# --- from firings to sweeps -----------------------------------------------------------------------


def unwrap_hours(batches: Iterable[Firings]) -> Iterator[Firings]:
    """Times that go on where the sensor's clock begins a new hour."""
    hours, last = 0, -np.inf
    for batch in batches:
        starts = np.append(last, batch.times[:, 0])
        passed = hours + np.cumsum(np.diff(starts) < -0.5 * HOUR)
        last, hours = float(starts[-1]), int(passed[-1])
        yield Firings(
            batch.azimuth, batch.times + HOUR * passed[:, None], batch.ranges, batch.intensity
        )


def cut_turns(batches: Iterable[Firings]) -> Iterator[Firings]:
    """One piece a turn of the head; the first and the last are what the recording has of theirs."""
    open_turn: Firings | None = None
    for batch in batches:
        held = batch if open_turn is None else concatenate([open_turn, batch])
        cuts = [0, *turn_starts(held)]
        for start, end in pairwise(cuts):
            yield held[start:end]
        open_turn = held[cuts[-1] :]
    if open_turn is not None:
        yield open_turn


def turn_starts(firings: Firings) -> NDArray[np.int64]:
    """Rows that begin a new turn: the azimuth passed 0, packets of a whole turn are missing, or the
    clock was set back."""
    turned = np.diff(firings.azimuth[:, 0])
    passed = np.diff(firings.times[:, 0])
    period = 2.0 * np.pi * FIRING_PERIOD / max(float(np.median(turned)), 1e-9) if len(turned) else 0
    return np.flatnonzero((turned < 0.0) | (passed >= period) | (passed <= 0.0)) + 1


def coverage(turn: Firings) -> float:
    """Share of the whole turn, in degrees, that a piece has."""
    return len(np.unique(np.degrees(turn.azimuth[:, 0]).astype(int))) / 360.0


def sweep_of(index: int, turn: Firings, T_base_lidar: Array) -> Sweep:
    """A turn as a scan: its returns in firing order; it ends when its last firing does."""
    end = float(turn.times[-1, 0]) + FIRING_PERIOD
    returned = turn.ranges[:, RING_OF_LASER] > 0.0
    ring = np.broadcast_to(RING_OF_LASER, returned.shape)
    scan = Scan(
        index=index,
        stamp=end,
        points=turn.points[:, RING_OF_LASER][returned],
        times=turn.times[:, RING_OF_LASER][returned] - end,
        ring=ring[returned].astype(np.int16),
        intensity=turn.intensity[:, RING_OF_LASER][returned],
        T_base_lidar=T_base_lidar,
    )
    return Sweep(scan, turn)
