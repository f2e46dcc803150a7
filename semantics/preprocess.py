"""Mapped planes -> plane pieces: what a room can own of a plane (paper, III-A).

A mapped plane is infinite and may run along several rooms. Its points say where it really is; it is
cut where nothing was seen for long, and where a wall of another direction stands on it, on the side
it was seen from. What lies behind it is of no matter: that is another face's concern.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from slam.core import Array, InputError, IntArray, MapPlane, PlanePiece


@dataclass(frozen=True)
class PreprocessConfig:
    """Metres and radians. bin: along the plane, and min_count points in one for it to be occupied;
    gap: longest hole within a piece (doors are 1 m, an opening that joins rooms 2.5 m); min_length:
    of a piece; reach: how far a wall that was not seen to its end is taken to go on; inside: how
    far from both ends of a piece a cut may lie; in_front: how far a wall must stand out to cut;
    crossing: least angle between the two; duplicate_*: a piece is dropped when a longer one that
    faces the same way lies this near and beside most of it.
    """

    bin: float = 0.1
    min_count: int = 2
    gap: float = 1.8
    min_length: float = 0.35
    reach: float = 0.5
    inside: float = 0.25
    in_front: float = 0.3
    crossing: float = np.radians(30.0)
    duplicate_distance: float = 0.12
    duplicate_angle: float = np.radians(8.0)
    duplicate_share: float = 0.6


@dataclass(frozen=True)
class Pieces:
    """M plane pieces in plan view, map frame [m].

    plane_id: (M,); segment: (M, 2, 2), ends in the order of the plane's axis; normal: (M, 2) unit,
    to the side it was seen from; height: (M, 2) lowest and highest point [m].
    """

    plane_id: IntArray
    segment: Array
    normal: Array
    height: Array

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
            self.plane_id[places], self.segment[places], self.normal[places], self.height[places]
        )

    def piece(self, place: int) -> PlanePiece:
        """One of them, as proposals name it."""
        return PlanePiece(int(self.plane_id[place]), self.segment[place])


class Preprocessor:
    """Cuts planes into pieces; what it found of an unchanged plane is kept."""

    def __init__(self, config: PreprocessConfig = PreprocessConfig()):
        self._config = config
        self._runs: dict[int, tuple[int, Array]] = {}

    def __call__(self, planes: Sequence[MapPlane]) -> Pieces:
        """Pieces of all upright planes. Raises InputError for a plane that is no plane."""
        upright = [plane for plane in planes if not plane.horizontal and len(plane.points)]
        self._runs = {plane.id: (plane.revision, self._run_of(plane)) for plane in upright}
        pieces = _pieces_of(upright, [self._runs[plane.id][1] for plane in upright])
        pieces = _without_duplicates(pieces, self._config)
        return _split(pieces, self._config)

    def _run_of(self, plane: MapPlane) -> Array:
        known = self._runs.get(plane.id)
        if known is not None and known[0] == plane.revision:
            return known[1]
        return _runs(plane, self._config)


def _runs(plane: MapPlane, config: PreprocessConfig) -> Array:
    """(R, 2) the stretches along the plane's axis where it was seen."""
    if not (np.isfinite(plane.points).all() and np.isfinite(plane.normal).all()):
        raise InputError(f"plane {plane.id}: coordinates that are not numbers")
    along = plane.points[:, :2] @ plane.axis
    along = np.sort(along)
    bins = np.floor((along - along[0]) / config.bin).astype(np.int64)
    kept = along[np.bincount(bins)[bins] >= config.min_count]
    if len(kept) == 0:
        return np.zeros((0, 2))
    breaks = np.flatnonzero(np.diff(kept) > config.gap)
    runs = np.column_stack([kept[np.append(0, breaks + 1)], kept[np.append(breaks, len(kept) - 1)]])
    return runs[runs[:, 1] - runs[:, 0] >= config.min_length]


def _pieces_of(planes: Sequence[MapPlane], runs: Sequence[Array]) -> Pieces:
    ids = [plane.id for plane, r in zip(planes, runs, strict=True) for _ in r]
    segments = [
        _foot(plane) + np.outer(ends, plane.axis)
        for plane, r in zip(planes, runs, strict=True)
        for ends in r
    ]
    normals = [
        plane.normal[:2] / np.linalg.norm(plane.normal[:2])
        for plane, r in zip(planes, runs, strict=True)
        for _ in r
    ]
    heights = [plane.z_range for plane, r in zip(planes, runs, strict=True) for _ in r]
    return Pieces(
        np.array(ids, dtype=np.int64),
        np.array(segments).reshape(-1, 2, 2),
        np.array(normals).reshape(-1, 2),
        np.array(heights).reshape(-1, 2),
    )


def _foot(plane: MapPlane) -> Array:
    """(2,) the point of the plane's line, at the height of its points, nearest to the origin."""
    start = plane.segment[0]
    return start - (start @ plane.axis) * plane.axis


def _without_duplicates(pieces: Pieces, config: PreprocessConfig) -> Pieces:
    """Drops pieces that lie beside a longer one of the same side; a wall's two faces both stay."""
    if len(pieces) < 2:
        return pieces
    length, axis = pieces.length, _axes(pieces)
    same = pieces.normal @ pieces.normal.T > np.cos(config.duplicate_angle)
    ends = pieces.segment[None, :, :, :] - pieces.centre[:, None, None, :]  # of j about i
    off = np.abs(np.einsum("ijkc,ic->ijk", ends, pieces.normal)).max(axis=2)
    along = np.einsum("ijkc,ic->ijk", ends, axis)
    half = 0.5 * length[:, None]
    common = np.minimum(along.max(axis=2), half) - np.maximum(along.min(axis=2), -half)
    longer = (length[:, None] > length[None, :]) | (
        (length[:, None] == length[None, :])
        & (np.arange(len(pieces))[:, None] < np.arange(len(pieces)))
    )
    covers = same & longer & (off < config.duplicate_distance)
    covers &= common > config.duplicate_share * length[None, :]
    return pieces.take(~covers.any(axis=0))


def _axes(pieces: Pieces) -> Array:
    """(M, 2) unit, from the first to the second end."""
    run = pieces.segment[:, 1] - pieces.segment[:, 0]
    return run / np.maximum(np.linalg.norm(run, axis=1), 1e-9)[:, None]


def _split(pieces: Pieces, config: PreprocessConfig) -> Pieces:
    """Cuts each piece where another one of a different direction stands on its front."""
    if len(pieces) < 2:
        return pieces
    axis, length = _axes(pieces), pieces.length
    start = pieces.segment[:, 0]
    i, j = _near_pairs(pieces, config.reach)
    away = pieces.segment[j] - start[i][:, None, :]
    height = np.einsum("pkc,pc->pk", away, pieces.normal[i])  # of j's ends above i's line
    along = np.einsum("pkc,pc->pk", away, axis[i])
    sine = np.abs(np.einsum("pc,pc->p", axis[j], pieces.normal[i]))
    rise = height[:, 1] - height[:, 0]
    steep = sine > np.sin(config.crossing)
    with np.errstate(divide="ignore", invalid="ignore"):
        at = along[:, 0] - height[:, 0] * (along[:, 1] - along[:, 0]) / rise
    stands = (height.min(axis=1) < config.reach * sine) & (height.max(axis=1) > config.in_front)
    inside = (at > config.inside) & (at < length[i] - config.inside)
    cut = steep & stands & inside
    return _cut(pieces, i[cut], at[cut], config)


def _near_pairs(pieces: Pieces, reach: float) -> tuple[IntArray, IntArray]:
    """Ordered pairs whose bounding boxes, grown by ``reach``, touch."""
    low = pieces.segment.min(axis=1) - reach
    high = pieces.segment.max(axis=1) + reach
    touch = (low[:, None] <= high[None]).all(axis=2) & (high[:, None] >= low[None]).all(axis=2)
    np.fill_diagonal(touch, False)
    i, j = np.nonzero(touch)
    return i, j


def _cut(pieces: Pieces, which: IntArray, at: Array, config: PreprocessConfig) -> Pieces:
    """The pieces, each cut at all of its places; what becomes too short is dropped."""
    axis, length = _axes(pieces), pieces.length
    parents, ends = [], []
    for place in range(len(pieces)):
        cuts = np.sort(at[which == place])
        bounds = np.concatenate([[0.0], cuts, [length[place]]])
        for low, high in pairwise(bounds.tolist()):
            if high - low >= config.min_length:
                parents.append(place)
                ends.append((low, high))
    chosen = pieces.take(np.array(parents, dtype=np.int64))
    start = chosen.segment[:, 0]
    direction = axis[np.array(parents, dtype=np.int64)]
    ends_array = np.array(ends).reshape(-1, 2)
    segment = start[:, None, :] + ends_array[:, :, None] * direction[:, None, :]
    return Pieces(chosen.plane_id, segment, chosen.normal, chosen.height)
