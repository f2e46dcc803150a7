"""Velodyne VLP-16 data packets (user manual 63-9243, sections 9.3 to 9.5) as sweeps.

Frame of the points: x ahead (azimuth 0), y to the left, z up. Azimuth counts clockwise seen from
above. Rings count from the lowest beam.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, fields

import numpy as np
from numpy.typing import NDArray

from slam.core import Array, Scan

PACKET_BYTES = 1206
BEAMS = 16
BLOCKS = 12
FIRING_PERIOD = 55.296e-6
"""From one firing sequence (all 16 lasers) to the next [s]."""
LASER_PERIOD = 2.304e-6
"""From one laser to the next [s]."""
RANGE_UNIT = 0.002
HOUR = 3600.0

FLAG = 0xEEFF
PRODUCT = 0x22
STRONGEST, LAST, DUAL = 0x37, 0x38, 0x39

RING_OF_LASER = np.array([0, 8, 1, 9, 2, 10, 3, 11, 4, 12, 5, 13, 6, 14, 7, 15])
LASER_OF_RING = np.argsort(RING_OF_LASER)
ELEVATIONS = np.radians(-15.0 + 2.0 * np.arange(BEAMS))
"""(16,) by ring [rad]."""
HEIGHTS = -1e-3 * np.array(
    [-11.2, -9.7, -8.1, -6.6, -5.1, -3.7, -2.2, -0.7, 0.7, 2.2, 3.7, 5.1, 6.6, 8.1, 9.7, 11.2]
)
"""(16,) by ring [m]: the manual's vertical correction, where a beam's origin lies above the
sensor's; it is applied to every point."""

_PACKET = np.dtype(
    [
        (
            "blocks",
            [
                ("flag", "<u2"),
                ("azimuth", "<u2"),
                ("shots", [("distance", "<u2"), ("reflectivity", "u1")], (2, BEAMS)),
            ],
            (BLOCKS,),
        ),
        ("microseconds", "<u4"),
        ("mode", "u1"),
        ("product", "u1"),
    ]
)


@dataclass(frozen=True)
class Firings:
    """F firing sequences; tables are (F, 16), by ring.

    azimuth [rad] in [0, 2 pi); times [s], rising, in the sensor's clock (since the full hour);
    ranges [m], 0 where the shot gave no return; intensity in [0, 1], 100/255 is a white surface
    and more a retroreflector.
    """

    azimuth: Array
    times: Array
    ranges: Array
    intensity: Array

    def __len__(self) -> int:
        return len(self.azimuth)

    def __getitem__(self, rows: slice) -> Firings:
        return Firings(*(getattr(self, item.name)[rows] for item in fields(self)))

    @property
    def directions(self) -> Array:
        """(F, 16, 3) unit vectors along the shots, lidar frame."""
        level = np.cos(ELEVATIONS)
        z = np.broadcast_to(np.sin(ELEVATIONS), self.azimuth.shape)
        return np.stack([level * np.cos(self.azimuth), -level * np.sin(self.azimuth), z], axis=-1)

    @property
    def points(self) -> Array:
        """(F, 16, 3) lidar frame [m]; meaningless where there was no return."""
        points = self.ranges[..., None] * self.directions
        points[..., 2] += HEIGHTS
        return points


@dataclass(frozen=True)
class Sweep:
    """One turn of the head: the scan, and every shot of it beside, returned or not."""

    scan: Scan
    firings: Firings

    @property
    def shots(self) -> NDArray[np.int64]:
        """(16,) shots by ring."""
        return np.full(BEAMS, len(self.firings), dtype=np.int64)

    @property
    def returns(self) -> NDArray[np.int64]:
        """(16,) shots that gave a return, by ring."""
        return (self.firings.ranges > 0.0).sum(axis=0)


def concatenate(parts: Iterable[Firings]) -> Firings:
    """Firings one after the other."""
    parts = tuple(parts)
    names = [item.name for item in fields(Firings)]
    return Firings(*(np.concatenate([getattr(p, name) for p in parts]) for name in names))


# --- packets --------------------------------------------------------------------------------------


def good_packets(raw: NDArray[np.uint8]) -> NDArray[np.bool_]:
    """Which of the packets (P, 1206) are a VLP-16's: flags, azimuths, return mode and product."""
    packets = _view(raw)
    blocks = packets["blocks"]
    whole = ((blocks["flag"] == FLAG) & (blocks["azimuth"] < 36000)).all(axis=1)
    known = np.isin(packets["mode"], (STRONGEST, LAST, DUAL)) & (packets["product"] == PRODUCT)
    return whole & known & (packets["microseconds"] < HOUR * 1e6)


def decode(raw: NDArray[np.uint8]) -> Firings:
    """Firings of good packets (P, 1206) of one kind, all single or all dual return.

    In dual-return mode a packet holds each firing sequence twice: even blocks the last return, odd
    ones the strongest, or the second strongest where the strongest is the last. The brighter of
    the two is taken.
    """
    packets = _view(raw)
    dual = bool(is_dual(raw).any())
    blocks = packets["blocks"][:, ::2] if dual else packets["blocks"]
    shots = _brighter(packets["blocks"]["shots"]) if dual else blocks["shots"]
    start = np.radians(blocks["azimuth"] / 100.0)[..., None, None]
    into_block = np.arange(2)[:, None] * FIRING_PERIOD + np.arange(BEAMS) * LASER_PERIOD
    azimuth = start + _gaps(start) * into_block / (2.0 * FIRING_PERIOD)
    block_times = np.arange(blocks.shape[1])[:, None, None] * (2.0 * FIRING_PERIOD)
    packet_times = packets["microseconds"][:, None, None, None] * 1e-6
    return Firings(
        azimuth=_by_ring(azimuth % (2.0 * np.pi)),
        times=_by_ring(packet_times + block_times + into_block),
        ranges=_by_ring(shots["distance"] * RANGE_UNIT),
        intensity=_by_ring(shots["reflectivity"] / 255.0),
    )


def is_dual(raw: NDArray[np.uint8]) -> NDArray[np.bool_]:
    """Which packets (P, 1206) hold two returns a shot."""
    return _view(raw)["mode"] == DUAL


def _view(raw: NDArray[np.uint8]) -> NDArray[np.void]:
    return np.ascontiguousarray(raw).view(_PACKET)[:, 0]


def _brighter(shots: NDArray[np.void]) -> NDArray[np.void]:
    """(P, 6, 2, 16) of (P, 12, 2, 16): of each pair of blocks the return that shone brighter."""
    last, other = shots[:, ::2], shots[:, 1::2]
    return np.where(other["reflectivity"] > last["reflectivity"], other, last)


def _gaps(start: Array) -> Array:
    """(P, B, 1, 1) how far the head turned from each block's start to the next [rad].

    The last block takes the gap before it, so that a packet stands alone and a lost neighbour
    does no harm.
    """
    gaps = np.diff(start, axis=1) % (2.0 * np.pi)
    return np.concatenate([gaps, gaps[:, -1:]], axis=1)


def _by_ring(table: Array) -> Array:
    """(P, B, 2, 16) by laser -> (F, 16) by ring."""
    return np.ascontiguousarray(table.reshape(-1, BEAMS)[:, LASER_OF_RING])
