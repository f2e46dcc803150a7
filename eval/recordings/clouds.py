"""sensor_msgs/PointCloud2 messages as scans."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from slam.core import Array, Scan

TIME_FIELDS = ("time", "t", "timestamp", "timestamps", "offset_time", "time_offset")
RING_FIELDS = ("ring", "channel", "line")
INTENSITY_FIELDS = ("intensity", "reflectivity", "i")

TYPES = {1: "i1", 2: "u1", 3: "i2", 4: "u2", 5: "i4", 6: "u4", 7: "f4", 8: "f8"}
"""PointField.datatype."""

LONGEST_SWEEP = 2.0
"""Seconds that the points of one scan may span."""
NEAREST_RINGS = np.radians(0.4)
"""Elevations closer than this belong to one beam, where a cloud does not name its rings."""


FARTHEST = 10_000.0
"""Of a return [m]: no LiDAR sees as far."""


class BadCloud(Exception):
    """One cloud that no scan can be made of: to be counted and skipped."""


class PointField(Protocol):
    """sensor_msgs/PointField."""

    name: str
    offset: int
    datatype: int
    count: int


class PointCloud2(Protocol):
    """sensor_msgs/PointCloud2, as far as it is read."""

    height: int
    width: int
    fields: Sequence[PointField]
    is_bigendian: bool
    point_step: int
    row_step: int
    data: NDArray[np.uint8]


@dataclass(frozen=True)
class Cloud:
    """points: (N, 3) lidar frame [m], all finite. ring, intensity and seconds run parallel or are
    None where the message has no such field; seconds: as sent, in seconds, relative or absolute."""

    points: Array
    seconds: Array | None
    ring: NDArray[np.int16] | None
    intensity: Array | None


def read_cloud(message: PointCloud2) -> Cloud:
    """The fields of a message that a scan needs, without points that are not finite.

    Raises BadCloud.
    """
    table = _table(message)
    names = table.dtype.names or ()
    if not {"x", "y", "z"} <= set(names):
        raise BadCloud(f"fields {', '.join(names) or 'none'}: expected x, y and z")
    points = np.column_stack([table[axis].astype(np.float64) for axis in "xyz"])
    # Some drivers send (0, 0, 0) for a shot without a return.
    finite = (np.abs(points) < FARTHEST).all(axis=1) & (points != 0.0).any(axis=1)
    if not finite.any():
        raise BadCloud("no point with finite coordinates")
    table = table[finite]
    time, ring = _first(table, TIME_FIELDS), _first(table, RING_FIELDS)
    brightness = _first(table, INTENSITY_FIELDS)
    return Cloud(
        points=points[finite],
        seconds=None if time is None else _in_seconds(time),
        ring=None if ring is None else _from_lowest(ring.astype(np.int16), points[finite]),
        intensity=None if brightness is None else _in_unit_range(brightness),
    )


def scan_of(
    cloud: Cloud, index: int, header_stamp: float, period: float, T_base_lidar: Array
) -> Scan:
    """A scan that ends with its last point.

    Times all <= 0 count back from the header's stamp, which is then the sweep's end; other small
    times count on from it; large ones are instants themselves. A cloud without times is spread
    evenly by azimuth over ``period`` [s] up to the header's stamp. Raises BadCloud.
    """
    if cloud.seconds is None:
        end, times = header_stamp, period * (azimuth_fraction(cloud.points) - 1.0)
    else:
        end, times = _since_end(cloud.seconds, header_stamp)
    rings = ring_by_elevation(cloud.points) if cloud.ring is None else cloud.ring
    bright = np.zeros(len(times)) if cloud.intensity is None else cloud.intensity
    return Scan(index, end, cloud.points, times, rings, bright, T_base_lidar)


def azimuth_fraction(points: Array) -> Array:
    """(N,) in [0, 1): how far round the sensor each point is from the first, in the sense in which
    the points follow each other."""
    azimuth = np.arctan2(points[:, 1], points[:, 0])
    steps = np.angle(np.exp(1j * np.diff(azimuth)))
    sense = -1.0 if np.sign(steps).sum() < 0.0 else 1.0
    # A little slack: other beams may stand slightly behind the first point.
    return ((sense * (azimuth - azimuth[0]) + 0.005) / (2.0 * np.pi)) % 1.0


def ring_by_elevation(points: Array) -> NDArray[np.int16]:
    """(N,) beams counted from the lowest: elevations without a gap between them are one beam."""
    elevation = np.arctan2(points[:, 2], np.hypot(points[:, 0], points[:, 1]))
    order = np.argsort(elevation, kind="stable")
    ring = np.empty(len(points), dtype=np.int16)
    ring[order] = np.cumsum(np.diff(elevation[order], prepend=elevation[order[0]]) > NEAREST_RINGS)
    return ring


def _from_lowest(ring: NDArray[np.int16], points: Array) -> NDArray[np.int16]:
    """Rings counted from the lowest beam; some makers count from the top."""
    steepness = points[:, 2] / np.maximum(np.hypot(points[:, 0], points[:, 1]), 1e-9)
    centred = ring - ring.mean()
    downwards = float(centred @ np.clip(steepness, -2.0, 2.0)) < 0.0
    return (ring.max() - ring).astype(np.int16) if downwards else ring


def _table(message: PointCloud2) -> NDArray[np.void]:
    """(N,) records of a message."""
    try:
        used = [f for f in message.fields if f.datatype in TYPES and f.count == 1]
        order = ">" if message.is_bigendian else "<"
        record = np.dtype(
            {
                "names": [f.name for f in used],
                "formats": [order + TYPES[f.datatype] for f in used],
                "offsets": [f.offset for f in used],
                "itemsize": message.point_step,
            }
        )
        rows = np.frombuffer(message.data, dtype=np.uint8)
        rows = rows[: message.height * message.row_step].reshape(message.height, message.row_step)
        packed = np.ascontiguousarray(rows[:, : message.width * message.point_step])
        return packed.view(record).reshape(-1)
    except (ValueError, TypeError, AttributeError, OverflowError, MemoryError) as error:
        raise BadCloud(f"fields and data do not fit: {error}") from error


def _first(table: NDArray[np.void], names: Sequence[str]) -> NDArray[np.generic] | None:
    """The first of these fields that there is."""
    there = [name for name in names if name in (table.dtype.names or ())]
    return table[there[0]] if there else None


def _in_seconds(values: NDArray[np.generic]) -> Array:
    """Whole numbers are nanoseconds; floats are seconds, or what makes a sweep last under 2 s."""
    numbers = values.astype(np.float64)
    if not np.isfinite(numbers).all():
        raise BadCloud("a point time is not finite")
    if np.issubdtype(values.dtype, np.integer):
        return numbers * 1e-9
    span = float(np.ptp(numbers))
    units = [unit for unit in (1.0, 1e-3, 1e-6, 1e-9) if span * unit < LONGEST_SWEEP]
    if not units:
        raise BadCloud(f"point times span {span:.3g}: no unit makes that a sweep")
    return numbers * units[0]


def _since_end(seconds: Array, header_stamp: float) -> tuple[float, Array]:
    """The sweep's end, and times (N,) <= 0 since then."""
    if np.ptp(seconds) > LONGEST_SWEEP:
        raise BadCloud(f"points span {np.ptp(seconds):.3f} s: more than a sweep")
    last = float(seconds.max())
    if last <= 0.0:
        return header_stamp, seconds
    absolute = last > 10.0 * LONGEST_SWEEP
    return (last if absolute else header_stamp + last), seconds - last


def _in_unit_range(values: NDArray[np.generic]) -> Array:
    """Brightness in [0, 1]: as sent where it fits, else as a byte's share, else a 16-bit one's."""
    numbers = np.nan_to_num(values.astype(np.float64), nan=0.0, posinf=0.0, neginf=0.0)
    top = float(numbers.max(initial=0.0))
    full = next((full for full in (1.0, 255.0, 65535.0) if top <= full), max(top, 1.0))
    return np.clip(numbers / full, 0.0, 1.0)
