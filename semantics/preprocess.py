"""Mapped planes -> plane pieces: what a room can own of a plane (paper, III-A).

A mapped plane is infinite and may run along several rooms. Its points say where it really is; it is
cut where nothing was seen for long, where a wall of another direction stands on it, on the side it
was seen from, and where a passage narrows to a door: too short to be mapped itself, the wall there
leaves a hole of its thickness in both faces of the passage. What lies behind a plane is of no
matter: that is another face's concern.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import pairwise

import numpy as np
import shapely
from numpy.typing import NDArray

from slam.core import Array, InputError, IntArray, MapPlane, PlanePiece

Pairs = tuple[IntArray, IntArray]
"""Places of pieces, the first and the second of each pair."""
LONGEST = 10_000.0
"""No wall is longer [m]."""
SHORT_OF = 0.06
"""Less than any wall is thick [m]."""
FEW = 150
"""Up to so many pieces, looking at all pairs is faster than a tree."""


@dataclass(frozen=True)
class PreprocessConfig:
    """Metres and radians. bin: along the plane, and min_count points in one for it to be occupied;
    gap: longest hole within a piece (doors are 1 m, an opening that joins rooms 2.5 m); min_length:
    of a piece; seen: least share of it with points; reach: how far a wall that was not seen to its
    end is taken to go on, or across a door, where nothing stands between; inside: how far from both
    ends of a piece a cut may lie; in_front: how far a wall must stand out to cut; crossing: least
    angle between the two; wall: nothing that only stands there is as long, and what is shorter [m]
    cuts if it was seen as_high (share) as what it cuts was about there: furniture does not make two
    pieces of the wall behind it; about: how far along that is; stub: least and largest hole
    of a wall too short to be mapped, between stub_bins that were all seen, and stub_off: how far
    the holes in two faces may be from opposite each other; passage: widest that is looked at;
    duplicate_*: a piece is
    dropped when a longer one that faces the same way lies this near and beside most of it.
    """

    bin: float = 0.1
    min_count: int = 2
    gap: float = 1.8
    min_length: float = 0.35
    seen: float = 0.4
    reach: float = 1.7
    inside: float = 0.25
    in_front: float = 0.3
    crossing: float = np.radians(30.0)
    wall: float = 0.8
    as_high: float = 0.7
    about: float = 1.0
    stub: tuple[float, float] = (0.12, 0.5)
    stub_bins: int = 4
    stub_off: float = 0.2
    passage: float = 10.0
    duplicate_distance: float = 0.12
    duplicate_angle: float = np.radians(8.0)
    duplicate_share: float = 0.6


@dataclass(frozen=True)
class Pieces:
    """M plane pieces in plan view, map frame [m].

    plane_id: (M,); segment: (M, 2, 2), ends in the order of the plane's axis; normal: (M, 2) unit,
    to the side it was seen from; height: (M, 2) where it was seen lowest and highest, on average
    along it [m]; barrier: (B, 2, 2) where a wall must stand across a passage that is too short to
    be mapped.
    """

    plane_id: IntArray
    segment: Array
    normal: Array
    height: Array
    barrier: Array = field(default_factory=lambda: np.zeros((0, 2, 2)))

    def __len__(self) -> int:
        return len(self.plane_id)

    @property
    def centre(self) -> Array:
        """(M, 2)"""
        return self.segment.mean(axis=1)

    @property
    def length(self) -> Array:
        """(M,)"""
        return np.linalg.norm(self.segment[:, 1] - self.segment[:, 0], axis=1)

    def take(self, places: IntArray | NDArray[np.bool_]) -> Pieces:
        """Some of them."""
        return Pieces(
            self.plane_id[places],
            self.segment[places],
            self.normal[places],
            self.height[places],
            self.barrier,
        )

    def piece(self, place: int) -> PlanePiece:
        """One of them, as proposals name it."""
        return PlanePiece(int(self.plane_id[place]), self.segment[place])


class Preprocessor:
    """Cuts planes into pieces; what it found of an unchanged plane is kept."""

    def __init__(self, config: PreprocessConfig = PreprocessConfig()):
        self._config = config
        self._known: dict[int, tuple[int, Pieces, Array]] = {}

    def __call__(self, planes: Sequence[MapPlane]) -> Pieces:
        """Pieces of all upright planes. Raises InputError for a plane that is no plane."""
        upright = [plane for plane in planes if not plane.horizontal and len(plane.points)]
        changed = [plane for plane in upright if not self._is_known(plane)]
        fresh = zip(changed, _runs(changed, self._config), strict=True)
        found = {plane.id: (plane.revision, *seen) for plane, seen in fresh}
        self._known = {p.id: found.get(p.id) or self._known[p.id] for p in upright}
        pieces = joined([self._known[plane.id][1] for plane in upright])
        if len(pieces) == 0:
            return pieces
        reach = max(self._config.reach, self._config.duplicate_distance)
        near = near_pairs(pieces, 0.5 * reach)
        pieces, near = _without_duplicates(pieces, near, self._config)
        bins = _Bins({name: self._known[name][2] for name in np.unique(pieces.plane_id).tolist()})
        which, at = _crossed(pieces, near, bins, self._config)
        holed, hole, barrier = _stubs(pieces, bins, self._config)
        which, at = np.concatenate([which, holed]), np.concatenate([at, hole])
        cut = _cut(pieces, which, at, self._config) if len(which) else pieces
        return self._seen(replace(cut, barrier=barrier), bins)

    def _seen(self, pieces: Pieces, bins: _Bins) -> Pieces:
        """With the heights of what is left of each; without those that a cut has left with hardly
        more than a hole."""
        along = _along(pieces)
        count, height = bins.between(pieces.plane_id, along)
        height = np.where(count[:, None] > 0, height, pieces.height)
        seen = count * self._config.bin > self._config.seen * (along[:, 1] - along[:, 0])
        kept = seen | (along[:, 1] - along[:, 0] >= self._config.gap)
        return replace(pieces, height=height).take(kept)

    def _is_known(self, plane: MapPlane) -> bool:
        known = self._known.get(plane.id)
        return known is not None and known[0] == plane.revision


class _Bins:
    """Every bin of planes where they were seen, B in all. middle: (B,) along the plane [m]."""

    def __init__(self, of_plane: Mapping[int, Array]):
        """of_plane: the bins (K, 3) of each plane, by ascending id."""
        self._ids = np.array(list(of_plane), dtype=np.int64)
        rows = np.concatenate(list(of_plane.values()))
        self.middle = rows[:, 0]
        self._total = np.cumsum(np.vstack([np.zeros(2), rows[:, 1:]]), axis=0)
        self._owner = np.repeat(np.arange(len(of_plane)), [len(k) for k in of_plane.values()])
        # Planes one behind the other on one line, so that one search finds all.
        self._key = self.middle + 4.0 * LONGEST * self._owner

    def places(self, plane_id: IntArray, along: Array) -> tuple[IntArray, IntArray]:
        """The first bin (M,) between two places (M, 2) along planes (M,), and one past the last."""
        shift = 4.0 * LONGEST * np.searchsorted(self._ids, plane_id)
        first, last = np.searchsorted(self._key, along.T + shift)
        return first, last

    def between(self, plane_id: IntArray, along: Array) -> tuple[IntArray, Array]:
        """How many bins (M,) there are between two places (M, 2) along planes (M,), and where they
        were seen lowest and highest on average (M, 2) [m]; 0 where there are none."""
        first, last = self.places(plane_id, along)
        count = last - first
        return count, (self._total[last] - self._total[first]) / np.maximum(count, 1)[:, None]

    def holes(self, config: PreprocessConfig) -> IntArray:
        """Bins after which there is a hole as wide as a wall is thick, all about it being seen."""
        step, reach = np.diff(self._key) - config.bin, config.stub_bins
        low, high = config.stub
        whole = np.append(0, np.cumsum(step < low))
        hole = np.flatnonzero((step > low) & (step < high))
        hole = hole[(hole >= reach) & (hole < len(step) - reach)]
        before = whole[hole] - whole[hole - reach]
        after = whole[hole + 1 + reach] - whole[hole + 1]
        return np.asarray(hole[(before == reach) & (after == reach)])


def joined(parts: Sequence[Pieces]) -> Pieces:
    """All pieces in one."""
    if not parts:
        return Pieces(
            np.zeros(0, np.int64), np.zeros((0, 2, 2)), np.zeros((0, 2)), np.zeros((0, 2))
        )
    return Pieces(
        np.concatenate([part.plane_id for part in parts]),
        np.concatenate([part.segment for part in parts]),
        np.concatenate([part.normal for part in parts]),
        np.concatenate([part.height for part in parts]),
    )


def _runs(planes: Sequence[MapPlane], config: PreprocessConfig) -> list[tuple[Pieces, Array]]:
    """For each plane the stretches along it where it was seen, and every bin along it where it was
    (B, 3): its middle, and its lowest and highest point [m]; all planes' points at once."""
    if not planes:
        return []
    points = np.concatenate([plane.points for plane in planes])
    first = np.cumsum([0] + [len(plane.points) for plane in planes[:-1]])
    owner = np.repeat(np.arange(len(planes)), np.diff(np.append(first, len(points))))
    normal = np.array([plane.normal for plane in planes])
    _check(planes, points, normal, owner)
    steepness = np.hypot(normal[:, 0], normal[:, 1])
    level = normal[:, :2] / steepness[:, None]
    axis = np.column_stack([-level[:, 1], level[:, 0]])
    x, y, z = points.T
    along = x * axis[owner, 0] + y * axis[owner, 1]
    low, high = np.minimum.reduceat(z, first), np.maximum.reduceat(z, first)
    d = np.array([plane.d for plane in planes]) + normal[:, 2] * 0.5 * (low + high)
    plane, start, end, bins = _occupied(along, z, owner, first, planes, config)
    foot = (-d / steepness)[:, None] * level
    ends = np.stack([start, end], axis=1)[:, :, None] * axis[plane][:, None, :]
    everything = Pieces(
        np.array([p.id for p in planes], dtype=np.int64)[plane],
        foot[plane][:, None, :] + ends,
        level[plane],
        np.column_stack([low, high])[plane],
    )
    bounds = np.searchsorted(plane, np.arange(len(planes) + 1)).tolist()
    runs = [everything.take(np.arange(a, b)) for a, b in pairwise(bounds)]
    return list(zip(runs, bins, strict=True))


def _check(planes: Sequence[MapPlane], points: Array, normal: Array, owner: IntArray) -> None:
    """InputError that names the first plane whose numbers are none."""
    broken = ~np.isfinite(normal).all(axis=1)
    broken |= ~np.isfinite([plane.d for plane in planes])
    if not np.isfinite(points.sum()):
        broken[owner[~np.isfinite(points).all(axis=1)]] = True
    if broken.any():
        name = planes[int(broken.argmax())].id
        raise InputError(f"plane {name}: coordinates that are not numbers")


def _occupied(
    along: Array,
    z: Array,
    owner: IntArray,
    first: IntArray,
    planes: Sequence[MapPlane],
    config: PreprocessConfig,
) -> tuple[IntArray, Array, Array, list[Array]]:
    """Plane, start and end [m] of each stretch without a hole wider than the gap, and for each
    plane its bins (B, 3): middle, lowest and highest point [m]; bins with few points count as
    empty, so that no stray point moves an end."""
    lowest = np.minimum.reduceat(along, first)
    span = np.maximum.reduceat(along, first) - lowest
    if span.max() > LONGEST:
        name = planes[int(span.argmax())].id
        raise InputError(f"plane {name}: points {span.max():.0f} m apart, expected a wall")
    width = np.floor(span / config.bin).astype(np.int64) + 1
    offset = np.cumsum(width) - width
    place = offset[owner] + ((along - lowest[owner]) / config.bin).astype(np.int64)
    count = np.bincount(place, minlength=int(width.sum()))
    low, high = _extremes(place, along, len(count))
    kept = np.flatnonzero(count >= config.min_count)
    plane = np.searchsorted(offset, kept, side="right") - 1
    breaks = (low[kept[1:]] - high[kept[:-1]] > config.gap) | (np.diff(plane) > 0)
    begins = np.flatnonzero(np.append(True, breaks)) if len(kept) else np.zeros(0, np.int64)
    ends = np.append(begins[1:] - 1, len(kept) - 1)[: len(begins)]
    start, end = low[kept[begins]], high[kept[ends]]
    long = end - start >= config.min_length
    middle = 0.5 * (low[kept] + high[kept])
    heights = [extreme[kept] for extreme in _extremes(place, z, len(count))]
    bins = np.split(
        np.column_stack([middle, *heights]), np.searchsorted(plane, np.arange(1, len(planes)))
    )
    return plane[begins][long], start[long], end[long], bins


def _extremes(place: IntArray, value: Array, count: int) -> tuple[Array, Array]:
    """(count,) smallest and largest value at each place."""
    low, high = np.full(count, np.inf), np.full(count, -np.inf)
    np.minimum.at(low, place, value)
    np.maximum.at(high, place, value)
    return low, high


def _without_duplicates(
    pieces: Pieces, near: Pairs, config: PreprocessConfig
) -> tuple[Pieces, Pairs]:
    """Drops pieces that lie beside a longer one of the same side; a wall's two faces both stay.
    What is left, and the near pairs of it."""
    i, j = near
    same = row_dots(pieces.normal[i], pieces.normal[j]) > np.cos(config.duplicate_angle)
    i, j = i[same], j[same]
    length, axis = pieces.length, _axes(pieces)
    ends = pieces.segment[j] - pieces.centre[i][:, None, :]  # of j about i
    off = np.abs(np.einsum("pkc,pc->pk", ends, pieces.normal[i])).max(axis=1)
    along = np.einsum("pkc,pc->pk", ends, axis[i])
    half = 0.5 * length[i]
    common = np.minimum(along.max(axis=1), half) - np.maximum(along.min(axis=1), -half)
    longer = (length[i] > length[j]) | ((length[i] == length[j]) & (i < j))
    covers = longer & (off < config.duplicate_distance)
    covers &= common > config.duplicate_share * length[j]
    kept = np.ones(len(pieces), dtype=bool)
    kept[j[covers]] = False
    if kept.all():
        return pieces, near
    both = kept[near[0]] & kept[near[1]]
    place = np.cumsum(kept) - 1
    return pieces.take(kept), (place[near[0][both]], place[near[1][both]])


def _axes(pieces: Pieces) -> Array:
    """(M, 2) unit, from the first to the second end."""
    run = pieces.segment[:, 1] - pieces.segment[:, 0]
    return run / np.maximum(pieces.length, 1e-9)[:, None]


def row_dots(a: Array, b: Array) -> Array:
    """(P,) products of the rows of (P, 2)."""
    return a[:, 0] * b[:, 0] + a[:, 1] * b[:, 1]


def _along(pieces: Pieces) -> Array:
    """(M, 2) the ends along the plane, as its bins are counted, ascending [m]."""
    axis = np.column_stack([-pieces.normal[:, 1], pieces.normal[:, 0]])
    return np.sort(np.einsum("mkc,mc->mk", pieces.segment, axis), axis=1)


def _stubs(pieces: Pieces, bins: _Bins, config: PreprocessConfig) -> tuple[IntArray, Array, Array]:
    """Pieces, and where [m] from their start, that have a hole opposite another face's hole; and
    the lines (B, 2, 2) between the two."""
    hole = bins.holes(config)
    middle = 0.5 * (bins.middle[hole] + bins.middle[hole + 1])
    along, axis = _along(pieces), _axes(pieces)
    first, last = np.searchsorted(hole, np.stack(bins.places(pieces.plane_id, along)))
    holed = np.flatnonzero(first < last)
    i, j = (holed[k] for k in near_pairs(pieces.take(holed), 0.5 * config.passage))
    away = row_dots(pieces.centre[j] - pieces.centre[i], pieces.normal[i])
    opposed = row_dots(axis[i], axis[j]) < -np.cos(config.crossing)
    opposed &= (away > config.in_front) & (away < config.passage)
    which: list[int] = []
    at: list[float] = []
    barrier: list[Array] = []
    for a, b in zip(i[opposed].tolist(), j[opposed].tolist(), strict=True):
        mine = middle[first[a] : last[a]] - along[a, 0]
        others = middle[first[b] : last[b]] - along[b, 0]
        spots = pieces.segment[b, 0] + others[:, None] * axis[b]
        off = np.abs(mine[:, None] - (spots - pieces.segment[a, 0]) @ axis[a])
        found = np.flatnonzero(off.min(axis=1) < config.stub_off)
        which += [a] * len(found)
        at += mine[found].tolist()
        here = pieces.segment[a, 0] + mine[found, None] * axis[a]
        barrier += [np.stack([here, spots[off[found].argmin(axis=1)]], axis=1)] if a < b else []
    lines = np.concatenate([np.zeros((0, 2, 2)), *barrier])
    return np.array(which, dtype=np.int64), np.array(at), lines


def _crossed(
    pieces: Pieces, near: Pairs, bins: _Bins, config: PreprocessConfig
) -> tuple[IntArray, Array]:
    """Pieces, and where [m] from their start, on whose front another one of a different direction
    stands."""
    i, j = near
    axis, length = _axes(pieces), pieces.length
    sine = np.abs(row_dots(axis[j], pieces.normal[i]))
    i, j, sine = (column[sine > np.sin(config.crossing)] for column in (i, j, sine))
    away = pieces.segment[j] - pieces.segment[i, 0][:, None, :]
    height = np.einsum("pkc,pc->pk", away, pieces.normal[i])  # of j's ends above i's line
    along = np.einsum("pkc,pc->pk", away, axis[i])
    rise = height[:, 1] - height[:, 0]
    at = along[:, 0] - height[:, 0] * (along[:, 1] - along[:, 0]) / rise
    least = height.min(axis=1)
    stands = (least < config.reach * sine) & (height.max(axis=1) > config.in_front)
    cut = np.flatnonzero(stands & (at > config.inside) & (at < length[i] - config.inside))
    i, j, at = i[cut], j[cut], at[cut]
    nearest = pieces.segment[j, height[cut].argmin(axis=1)]
    free = (length[j] > config.wall) | _as_high(pieces, i, j, at, bins, config)
    far = np.flatnonzero(free & (least[cut] > config.in_front))
    foot = pieces.segment[i[far], 0] + at[far, None] * axis[i[far]]
    free[far] = _in_sight(pieces, nearest[far], foot)
    return i[free], at[free]


def _as_high(
    pieces: Pieces, i: IntArray, j: IntArray, at: Array, bins: _Bins, config: PreprocessConfig
) -> NDArray[np.bool_]:
    """(P,) was j seen about as high as i is about a place [m] from its start? How high depends on
    how far away the robot was, which differs along a long face."""
    along = _along(pieces)
    middle = along[i, 0] + at
    about = np.column_stack([middle - config.about, middle + config.about])
    count, behind = bins.between(pieces.plane_id[i], about)
    low, high = np.where(count[:, None] > 0, behind, pieces.height[i]).T
    _, there = bins.between(pieces.plane_id[j], along[j])
    return np.asarray(there[:, 1] - low > config.as_high * (high - low))


def _in_sight(pieces: Pieces, start: Array, end: Array) -> NDArray[np.bool_]:
    """(P,) does no piece cross the way from start to end (P, 2)?

    Short of both by less than a wall is thick, so that neither piece is in its own way.
    """
    if len(start) == 0:
        return np.zeros(0, dtype=bool)
    way = end - start
    step = SHORT_OF * way / np.linalg.norm(way, axis=1, keepdims=True)
    lines = shapely.linestrings(np.stack([start + step, end - step], axis=1))
    crossed, _ = shapely.STRtree(shapely.linestrings(pieces.segment)).query(lines, "intersects")
    free = np.ones(len(start), dtype=bool)
    free[crossed] = False
    return free


def near_pairs(pieces: Pieces, reach: float | Array, of: IntArray | None = None) -> Pairs:
    """Pairs (i, j), i one ``of`` the pieces, j any other, whose bounding boxes, each grown by
    ``reach`` (or by its own, (M,)), touch; sorted. All pieces where ``of`` is None."""
    grown = np.reshape(reach, (-1, 1))
    low = pieces.segment.min(axis=1) - grown
    high = pieces.segment.max(axis=1) + grown
    of = np.arange(len(pieces)) if of is None else of
    if len(pieces) <= FEW:
        touch = np.ones((len(of), len(pieces)), dtype=bool)
        for least, most in zip(low.T, high.T, strict=True):
            touch &= least[of, None] <= most
            touch &= most[of, None] >= least
        i, j = np.nonzero(touch)
    else:
        boxes = shapely.box(*low.T, *high.T)
        i, j = shapely.STRtree(boxes).query(boxes[of])
        order = np.lexsort((j, i))
        i, j = i[order], j[order]
    other = of[i] != j
    return of[i[other]], j[other]


def _cut(pieces: Pieces, which: IntArray, at: Array, config: PreprocessConfig) -> Pieces:
    """The pieces, each cut at all of its places; what becomes too short is dropped."""
    count = len(pieces)
    everyone = np.arange(count)
    owner = np.concatenate([everyone, which])
    start = np.concatenate([np.zeros(count), at])
    order = np.lexsort((start, owner))
    owner, start = owner[order], start[order]
    last = np.append(owner[1:] != owner[:-1], True)
    end = np.where(last, pieces.length[owner], np.append(start[1:], 0.0))
    long = end - start >= config.min_length
    owner, ends = owner[long], np.column_stack([start, end])[long]
    chosen, axis = pieces.take(owner), _axes(pieces)[owner]
    segment = chosen.segment[:, :1] + ends[:, :, None] * axis[:, None, :]
    return Pieces(chosen.plane_id, segment, chosen.normal, chosen.height)
