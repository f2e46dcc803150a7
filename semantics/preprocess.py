"""Mapped planes -> plane pieces: what a room can own of a plane (paper, III-A).

A mapped plane is infinite and may run along several rooms. Its points say where it really is; it is
cut where nothing was seen for long, where a wall of another direction stands on it, on the side it
was seen from, and where a passage narrows to a door: too short to be mapped itself, the wall there
leaves a hole of its thickness in both faces of the passage. What lies behind a plane is of no
matter: that is another face's concern.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from semantics.bins import Bins
from semantics.cuts import crossed, cut, stubs
from semantics.names import places_of
from semantics.near import Pairs, columns, near_pairs
from semantics.pieces import STANDARD, Pieces, PreprocessConfig
from semantics.runs import no_runs, runs_of
from slam.core import MapPlane


class Preprocessor:
    """Cuts planes into pieces; what it found of an unchanged plane is kept."""

    def __init__(self, config: PreprocessConfig = STANDARD):
        self._config = config
        self._runs = no_runs()
        self._names = self._revision = np.zeros(0, dtype=np.int64)

    def __call__(self, planes: Sequence[MapPlane]) -> Pieces:
        """Pieces of all upright planes. Raises InputError for a plane that is no plane."""
        config = self._config
        pieces = self._stretches(planes)
        if len(pieces) == 0:
            return pieces
        near = near_pairs(pieces.segment, 0.5 * max(config.reach, config.duplicate_distance))
        pieces, near = _without_duplicates(pieces, near, config)
        bins = Bins(self._runs.only(pieces.plane_id))
        which, at = crossed(pieces, near, bins, config)
        holed, hole, barrier = stubs(pieces, bins, config)
        which, at = np.concatenate([which, holed]), np.concatenate([at, hole])
        whole = cut(pieces, which, at, config) if len(which) else pieces
        return self._seen(replace(whole, barrier=barrier), bins)

    def _stretches(self, planes: Sequence[MapPlane]) -> Pieces:
        """Of all upright planes, in their order; looked up anew where a plane has changed."""
        names = np.array([plane.id for plane in planes], dtype=np.int64)
        revision = np.array([plane.revision for plane in planes], dtype=np.int64)
        before = places_of(self._names, names)
        same = before >= 0
        same[same] = self._revision[before[same]] == revision[same]
        changed = [planes[place] for place in np.flatnonzero(~same).tolist()]
        upright = [plane for plane in changed if not plane.horizontal and len(plane.points)]
        fresh = runs_of(upright, self._config)
        self._runs = self._runs.updated(fresh, self._runs.places(names[same]))
        self._names, self._revision = names, revision
        return self._runs.stretches_of(names)

    def _seen(self, pieces: Pieces, bins: Bins) -> Pieces:
        """With the heights of what is left of each; without those that a cut has left with hardly
        more than a hole."""
        low, high = pieces.along.T
        count, height = bins.between(pieces.plane_id, pieces.along)
        height = np.where(count > 0, height, pieces.height.T).T.copy()
        seen = count * self._config.bin > self._config.seen * (high - low)
        return replace(pieces, height=height).take(seen | (high - low >= self._config.gap))


def _without_duplicates(
    pieces: Pieces, near: Pairs, config: PreprocessConfig
) -> tuple[Pieces, Pairs]:
    """Drops pieces that lie beside a longer one of the same side; a wall's two faces both stay.
    What is left, and the near pairs of it."""
    i, j = near
    normal = pieces.normal.T.copy()
    n, m = normal.take(i, axis=1), normal.take(j, axis=1)
    same = np.flatnonzero(n[0] * m[0] + n[1] * m[1] > np.cos(config.duplicate_angle))
    i, j, n = i[same], j[same], n.take(same, axis=1)
    length, a = pieces.length, pieces.axis[i].T
    ends = columns(pieces.segment).take(j, axis=2) - pieces.centre[i].T  # of j about i
    off = np.abs(ends[:, 0] * n[0] + ends[:, 1] * n[1]).max(axis=0)
    along = ends[:, 0] * a[0] + ends[:, 1] * a[1]
    half = 0.5 * length[i]
    common = np.minimum(along.max(axis=0), half) - np.maximum(along.min(axis=0), -half)
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
