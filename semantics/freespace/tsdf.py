"""Free space from scans: a truncated signed distance field (TSDF) on a grid that grows."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import product

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import maximum_filter1d

from slam.core import Array

Floats = NDArray[np.float32]

LEAST_WEIGHT = 1e-4
MOST_WEIGHT = 1e5
OBSERVED = 1e-6
"""A voxel with less weight was never seen."""

MARGIN = 16
"""Voxels by which the grid grows beyond what is asked for, so that it seldom grows."""


@dataclass(frozen=True)
class TsdfConfig:
    """Free space from scans (Hydra's uhumans2 geometry with its model of a 16-beam sensor).

    voxel, truncation, window (how far from the sensor a scan is integrated), nearest [m];
    step [rad]: of the range image, horizontally and vertically; jump [m]: neighbouring ranges that
    differ by more are not interpolated; coarser: voxels a side that become one for the places.
    """

    voxel: float = 0.1
    truncation: float = 0.3
    window: float = 8.0
    nearest: float = 0.4
    column: float = 0.01745
    row: float = 0.03491
    jump: float = 0.2
    coarser: int = 2


@dataclass(frozen=True)
class Volume:
    """distance (X, Y, Z) to the surface along the rays [m], positive in free space, truncated;
    observed (X, Y, Z); low: (3,) the first voxel's centre, map frame [m]; voxel [m]."""

    distance: Floats
    observed: NDArray[np.bool_]
    low: Array
    voxel: float

    def observed_part(self) -> Volume:
        """The smallest box that holds all observed voxels: what reads the field takes time for the
        others, too. The whole if there are none."""
        if not self.observed.any():
            return self
        axes = [np.flatnonzero(self.observed.any(axis=other)) for other in ((1, 2), (0, 2), (0, 1))]
        part = tuple(slice(places[0], places[-1] + 1) for places in axes)
        low = self.low + self.voxel * np.array([places[0] for places in axes])
        return Volume(self.distance[part], self.observed[part], low, self.voxel)


class Tsdf:
    """Integrates scans; each voxel holds the weighted mean of what the scans say of it."""

    def __init__(self, config: TsdfConfig = TsdfConfig()):
        self._config = config
        self._first = np.zeros(3, np.int64)  # index of the grid's first voxel on the endless grid
        self._distance = np.zeros((0, 0, 0), np.float32)
        self._weight = np.zeros((0, 0, 0), np.float32)

    def integrate(self, T_map_sensor: Array, points: Array) -> None:
        """One scan: points (M, 3) in the sensor's frame at the scan's end [m]."""
        image = RangeImage.of(points, self._config)
        if image is None:
            return
        reach = min(self._config.window, image.farthest + self._config.truncation)
        box = self._box(T_map_sensor[:3, 3], reach, image)
        self._grow(box)
        start = box[0] - self._first
        stop = box[1] - self._first
        part = tuple(slice(a, b) for a, b in zip(start, stop, strict=True))
        axes = [
            (np.arange(a, b) * self._config.voxel).astype(np.float32)
            for a, b in zip(box[0], box[1], strict=True)
        ]
        place, measured, weight = _projected(axes, T_map_sensor, image, reach, self._config)
        distance, total = self._distance[part].ravel(), self._weight[part].ravel()
        before = total.take(place)
        after = np.minimum(before + weight, np.float32(MOST_WEIGHT))
        mean = (distance.take(place) * before + measured * weight) / (before + weight)
        distance[place], total[place] = mean, after
        shape = tuple(stop - start)
        self._distance[part], self._weight[part] = distance.reshape(shape), total.reshape(shape)

    def volume(self) -> Volume:
        """As far as it was observed, the field on voxels ``coarser`` times as large: weighted means
        of the fine ones."""
        n = self._config.coarser
        first = -(-self._first // n) * n  # whole coarse voxels of the endless grid
        skip = first - self._first
        shape = np.maximum((np.array(self._weight.shape) - skip) // n, 0)
        total, moment = np.zeros(shape, np.float32), np.zeros(shape, np.float32)
        for corner in product(range(n), repeat=3):
            starts = skip + corner
            part = tuple(slice(s, s + c * n, n) for s, c in zip(starts, shape, strict=True))
            total += self._weight[part]
            moment += self._distance[part] * self._weight[part]
        observed = total / n**3 >= OBSERVED
        distance = np.where(observed, moment / np.where(observed, total, 1), 0)
        low = np.asarray((first + (n - 1) / 2.0) * self._config.voxel)
        whole = Volume(distance.astype(np.float32), observed, low, n * self._config.voxel)
        return whole.observed_part()

    def _box(self, centre: Array, reach: float, image: RangeImage) -> NDArray[np.int64]:
        """(2, 3) first and last-but-one voxel that a scan can reach."""
        rise = reach * np.sin(max(abs(image.lowest), abs(image.highest)) + 0.15)
        spread = np.array([reach, reach, min(rise, reach)])
        low = np.floor((centre - spread) / self._config.voxel).astype(np.int64)
        return np.array([low, np.ceil((centre + spread) / self._config.voxel).astype(np.int64)])

    def _grow(self, box: NDArray[np.int64]) -> None:
        """Makes the grid hold a box of voxels."""
        shape = np.array(self._weight.shape)
        if not shape.size or not self._weight.size:
            self._first, shape = box[0].copy(), np.zeros(3, np.int64)
        last = self._first + shape
        if (box[0] >= self._first).all() and (box[1] <= last).all():
            return
        first = np.where(box[0] < self._first, box[0] - MARGIN, self._first)
        last = np.where(box[1] > last, box[1] + MARGIN, last)
        at = tuple(slice(a, a + n) for a, n in zip(self._first - first, shape, strict=True))
        for name in ("_distance", "_weight"):
            grown = np.zeros(last - first, np.float32)
            grown[at] = getattr(self, name)
            setattr(self, name, grown)
        self._first = first


@dataclass(frozen=True)
class RangeImage:
    """ranges (H, W) [m], 0 where nothing came back; rows upwards from ``lowest`` [rad]."""

    ranges: Floats
    lowest: float
    highest: float
    farthest: float

    @staticmethod
    def of(points: Array, config: TsdfConfig) -> RangeImage | None:
        """The nearest return of each pixel; None if there is no return beyond ``nearest``."""
        r = np.linalg.norm(points, axis=1)
        kept = points[r >= config.nearest]
        r = r[r >= config.nearest]
        if not len(r):
            return None
        elevation = np.arcsin(kept[:, 2] / r)
        lowest, highest = (float(e) for e in np.percentile(elevation, [0.2, 99.8]))
        rows = round((highest - lowest) / config.row) + 1
        columns = round(2 * np.pi / config.column)
        row = np.clip(np.rint((elevation - lowest) / config.row), 0, rows - 1).astype(np.int64)
        azimuth = np.arctan2(kept[:, 1], kept[:, 0])
        column = np.floor((azimuth / (2 * np.pi) % 1.0) * columns).astype(np.int64) % columns
        ranges = np.full((rows, columns), np.inf, np.float32)
        np.minimum.at(ranges, (row, column), r.astype(np.float32))
        ranges[~np.isfinite(ranges)] = 0.0
        return RangeImage(ranges, lowest, highest, float(r.max()))

    def at(self, azimuth: Floats, elevation: Floats, config: TsdfConfig) -> Floats:
        """Ranges (N,) in these directions: bilinear, but the nearest pixel's where neighbours jump
        or one of them is empty; 0 where that is empty."""
        rows, columns = self.ranges.shape
        u = (azimuth / np.float32(2 * np.pi) % 1.0) * columns - np.float32(0.5)
        v = np.clip((elevation - np.float32(self.lowest)) / np.float32(config.row), 0, rows - 1)
        left, below = np.floor(u).astype(np.int32), np.floor(v).astype(np.int32)
        du, dv = u - left, v - below
        right, above = (left + 1) % columns, np.minimum(below + 1, rows - 1)
        left %= columns
        flat = self.ranges.ravel()
        corners = [flat.take(b * columns + a) for b in (below, above) for a in (left, right)]
        low, high = np.minimum.reduce(corners), np.maximum.reduce(corners)
        smooth = (
            (corners[0] * (1 - du) + corners[1] * du) * (1 - dv)
            + (corners[2] * (1 - du) + corners[3] * du) * dv
        )  # fmt: skip
        near = np.where(
            dv < 0.5,
            np.where(du < 0.5, corners[0], corners[1]),
            np.where(du < 0.5, corners[2], corners[3]),
        )
        return np.where((low > 0.0) & (high - low <= config.jump), smooth, near)


def _projected(
    axes: list[Floats], T_map_sensor: Array, image: RangeImage, reach: float, config: TsdfConfig
) -> tuple[NDArray[np.intp], Floats, Floats]:
    """Voxels (flat places in the box of ``axes``) that a scan speaks of, the distances that it
    measures there and their weights."""
    R = T_map_sensor[:3, :3].astype(np.float32)
    offset = [a - np.float32(c) for a, c in zip(axes, T_map_sensor[:3, 3], strict=True)]
    columns, level = _columns(offset[0], offset[1], R, image, reach, config)
    x, y, z = (
        (level[0] * R[0, i] + level[1] * R[1, i])[:, None] + offset[2] * R[2, i] for i in range(3)
    )
    r2 = x * x + y * y + z * z
    half = np.float32(config.row / 2)
    low, high = np.sin(image.lowest - half), np.sin(image.highest + half)
    inside = (r2 <= np.float32(reach**2)) & (r2 >= np.float32(config.nearest**2))
    signed = z * np.abs(z)  # of sin(elevation) squared, times r2
    inside &= (signed >= np.float32(low * abs(low)) * r2) & (
        signed <= np.float32(high * abs(high)) * r2
    )
    row, above = np.nonzero(inside)
    x, y, z = (c[row, above] for c in (x, y, z))
    r = np.sqrt(r2[row, above])
    ranges = image.at(np.arctan2(y, x), np.arcsin(np.clip(z / r, -1, 1)), config)
    sdf = ranges - r
    truncation = np.float32(config.truncation)
    spoken = np.flatnonzero((ranges > 0.0) & (sdf >= -truncation))
    sdf, r = sdf.take(spoken), r.take(spoken)
    weight = (config.voxel / (config.column * r)) * (config.voxel / (config.row * r)) / (r * r)
    fading = (truncation + sdf) / np.float32(config.truncation - config.voxel)
    weight *= np.where(sdf < -config.voxel, fading, np.float32(1))
    weight = np.maximum(weight, np.float32(LEAST_WEIGHT))
    place = columns.take(row.take(spoken)) * len(axes[2]) + above.take(spoken)
    return place, np.minimum(sdf, truncation), weight.astype(np.float32)


def _columns(
    x: Floats, y: Floats, R: Floats, image: RangeImage, reach: float, config: TsdfConfig
) -> tuple[NDArray[np.intp], tuple[Floats, Floats]]:
    """Columns of voxels (flat places in the grid of ``x`` and ``y``, offsets from the sensor in the
    map's axes) that are not behind all returns of their azimuth, and where they are."""
    across, along = (c.ravel() for c in np.broadcast_arrays(x[:, None], y[None, :]))
    azimuth = np.arctan2(across * R[0, 1] + along * R[1, 1], across * R[0, 0] + along * R[1, 0])
    tilt = np.hypot(R[2, 0], R[2, 1])
    steepest = np.tan(min(max(abs(image.lowest), abs(image.highest)) + np.arcsin(tilt) + 0.15, 1.5))
    bins = image.ranges.shape[1]
    spread = int(np.ceil(np.arctan(steepest * tilt) / (2 * np.pi) * bins)) + 2
    farthest = maximum_filter1d(image.ranges.max(axis=0), 2 * spread + 1, mode="wrap")
    at = np.floor((azimuth / np.float32(2 * np.pi) % 1.0) * bins).astype(np.int32) % bins
    limit = np.minimum(farthest.take(at) + np.float32(config.truncation), np.float32(reach))
    kept = np.flatnonzero(across * across + along * along <= limit * limit)
    return kept, (across.take(kept), along.take(kept))
