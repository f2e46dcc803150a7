"""What was seen of planes, each for itself: the stretches along it, and every bin of those."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from semantics.pieces import Pieces, PreprocessConfig, joined
from slam.core import Array, InputError, IntArray, MapPlane

LONGEST = 10_000.0
"""No wall is longer [m]."""


@dataclass(frozen=True)
class Runs:
    """P planes, by ascending id (P,). stretches: of each plane, one plane after the other; bins:
    (3, B) middle along the plane, lowest and highest point [m] of each bin, likewise; stretch_count
    and bin_count: (P,) how many of them are each plane's.
    """

    plane_id: IntArray
    stretches: Pieces
    stretch_count: IntArray
    bins: Array
    bin_count: IntArray

    def __len__(self) -> int:
        return len(self.plane_id)

    def take(self, places: IntArray) -> Runs:
        """Some of the planes."""
        stretch, each = _members(self.stretch_count, places), _members(self.bin_count, places)
        return Runs(
            self.plane_id[places],
            self.stretches.take(stretch),
            self.stretch_count[places],
            self.bins.take(each, axis=1),
            self.bin_count[places],
        )

    def only(self, plane_id: IntArray) -> Runs:
        """Those of the planes that are named at all."""
        named = np.zeros(len(self), dtype=bool)
        named[self.places(plane_id)] = True
        return self if named.all() else self.take(np.flatnonzero(named))

    def stretches_of(self, plane_id: IntArray) -> Pieces:
        """Of those of the planes (Q,) that are here, in that order."""
        if np.array_equal(plane_id, self.plane_id):
            return self.stretches
        return self.stretches.take(_members(self.stretch_count, self.places(plane_id)))

    def places(self, plane_id: IntArray) -> IntArray:
        """(Q,) of those of the planes (Q,) that are here."""
        place = np.searchsorted(self.plane_id, plane_id)
        place = np.minimum(place, max(len(self) - 1, 0))
        return place[self.plane_id[place] == plane_id] if len(self) else place[:0]

    def updated(self, fresh: Runs, kept: IntArray) -> Runs:
        """With the fresh planes, and of those that are here the ones at these places."""
        both = Runs(
            np.concatenate([self.plane_id, fresh.plane_id]),
            joined([self.stretches, fresh.stretches]),
            np.concatenate([self.stretch_count, fresh.stretch_count]),
            np.concatenate([self.bins, fresh.bins], axis=1),
            np.concatenate([self.bin_count, fresh.bin_count]),
        )
        chosen = np.concatenate([kept, len(self) + np.arange(len(fresh))])
        return both.take(chosen[np.argsort(both.plane_id[chosen], kind="stable")])


def _members(count: IntArray, places: IntArray) -> IntArray:
    """Where what belongs to these planes stands, of arrays that have so many of each."""
    first, number = (np.cumsum(count) - count)[places], count[places]
    shift = first - (np.cumsum(number) - number)
    return np.repeat(shift, number) + np.arange(number.sum())


def no_runs() -> Runs:
    """Of no planes."""
    none = np.zeros(0, dtype=np.int64)
    return Runs(none, joined([]), none, np.zeros((3, 0)), none)


def runs_of(planes: Sequence[MapPlane], config: PreprocessConfig) -> Runs:
    """Of planes that have points, in their order; all points are looked at at once. Raises
    InputError for a plane that is no plane."""
    if not planes:
        return no_runs()
    points = np.concatenate([plane.points for plane in planes])
    number = np.array([len(plane.points) for plane in planes])
    normal = np.array([plane.normal for plane in planes])
    d = np.array([plane.d for plane in planes])
    _check(planes, points, normal, d, number)
    x, y, z = np.ascontiguousarray(points.T)
    first = np.cumsum(number) - number
    lowest, highest = np.minimum.reduceat(z, first), np.maximum.reduceat(z, first)
    steepness = np.hypot(normal[:, 0], normal[:, 1])
    level = normal[:, :2] / steepness[:, None]
    axis = np.column_stack([-level[:, 1], level[:, 0]])
    along = x * np.repeat(axis[:, 0], number) + y * np.repeat(axis[:, 1], number)
    owner, low, high, heights = _occupied(along, z, number, planes, config)
    plane, start, end = _stretches(owner, low, high, config)
    d = d + normal[:, 2] * 0.5 * (lowest + highest)
    foot = (-d / steepness)[:, None] * level
    ends = np.stack([start, end], axis=1)[:, :, None] * axis[plane][:, None, :]
    names = np.array([plane.id for plane in planes], dtype=np.int64)
    stretches = Pieces(
        names[plane],
        foot[plane][:, None, :] + ends,
        level[plane],
        np.column_stack([lowest, highest])[plane],
    )
    return Runs(
        names,
        stretches,
        np.bincount(plane, minlength=len(planes)),
        np.stack([0.5 * (low + high), *heights]),
        np.bincount(owner, minlength=len(planes)),
    )


def _check(
    planes: Sequence[MapPlane], points: Array, normal: Array, d: Array, number: IntArray
) -> None:
    """InputError that names the first plane whose numbers are none."""
    broken = ~np.isfinite(normal).all(axis=1) | ~np.isfinite(d)
    if not np.isfinite(points.sum()):
        owner = np.repeat(np.arange(len(planes)), number)
        broken[owner[~np.isfinite(points).all(axis=1)]] = True
    if broken.any():
        name = planes[int(broken.argmax())].id
        raise InputError(f"plane {name}: coordinates that are not numbers")


def _occupied(
    along: Array,
    z: Array,
    number: IntArray,
    planes: Sequence[MapPlane],
    config: PreprocessConfig,
) -> tuple[IntArray, Array, Array, list[Array]]:
    """Of each bin with enough points: its plane, its first and its last point along that, and its
    lowest and highest one [m]; bins with few points count as empty, so that no stray point moves an
    end. number: (P,) of the points of each plane."""
    first = np.cumsum(number) - number
    lowest = np.minimum.reduceat(along, first)
    span = np.maximum.reduceat(along, first) - lowest
    if span.max() > LONGEST:
        name = planes[int(span.argmax())].id
        raise InputError(f"plane {name}: points {span.max():.0f} m apart, expected a wall")
    width = np.floor(span / config.bin).astype(np.int64) + 1
    offset = np.cumsum(width) - width
    place = ((along - np.repeat(lowest, number)) / config.bin).astype(np.int64)
    place += np.repeat(offset, number)
    count = np.bincount(place, minlength=int(width.sum()))
    kept = np.flatnonzero(count >= config.min_count)
    low, high, *heights = (
        extreme[kept] for value in (along, z) for extreme in _extremes(place, value, len(count))
    )
    return np.searchsorted(offset, kept, side="right") - 1, low, high, heights


def _extremes(place: IntArray, value: Array, count: int) -> tuple[Array, Array]:
    """(count,) smallest and largest value at each place."""
    low, high = np.full(count, np.inf), np.full(count, -np.inf)
    np.minimum.at(low, place, value)
    np.maximum.at(high, place, value)
    return low, high


def _stretches(
    owner: IntArray, low: Array, high: Array, config: PreprocessConfig
) -> tuple[IntArray, Array, Array]:
    """Plane, start and end [m] of each stretch without a hole wider than the gap, from the bins."""
    breaks = (low[1:] - high[:-1] > config.gap) | (owner[1:] > owner[:-1])
    begins = np.flatnonzero(np.append(len(owner) > 0, breaks))
    start, end = low[begins], high[np.append(begins[1:], len(owner))[: len(begins)] - 1]
    long = end - start >= config.min_length
    return owner[begins][long], start[long], end[long]
