"""Clearance of free space and its generalised Voronoi diagram (Lau et al. 2013), in one batch."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import product

import numpy as np
from numpy.typing import NDArray

from semantics.freespace.tsdf import Volume
from slam.core import Array

Ints = NDArray[np.int64]

OFFSETS = np.array([o for o in product((-1, 0, 1), repeat=3) if any(o)])
"""(26, 3) the neighbours of a voxel."""

HALF = OFFSETS[len(OFFSETS) // 2 :]
"""(13, 3) one of each pair of opposite neighbours."""

MOST_BASIS = 8


@dataclass(frozen=True)
class GvdConfig:
    """The Voronoi diagram of free space (uhumans2).

    max_distance: clearance is capped there [m]; band: nearer to a surface than this the field's own
    distance holds, so less than its truncation [m]; min_distance: of the diagram's voxels [m];
    parents_apart: L1 distance of two nearest surface voxels that makes them distinct [voxels];
    parents_cosine: or the cosine of the angle between the ways to them.
    """

    max_distance: float = 4.5
    band: float = 0.2
    min_distance: float = 0.3
    parents_apart: int = 20
    parents_cosine: float = 0.2


@dataclass(frozen=True)
class Gvd:
    """The voxels of the diagram.

    voxels: (N, 3) index in the volume; clearance: (N,) [m]; basis: (N,) distinct nearest surface
    voxels; pairs: (P, 2) places in ``voxels`` of neighbours (26); distance: (X, Y, Z) clearance of
    every voxel of the volume, NaN where it was never seen.
    """

    voxels: Ints
    clearance: Array
    basis: Ints
    pairs: Ints
    distance: NDArray[np.float32]


def gvd_of(volume: Volume, config: GvdConfig) -> Gvd:
    """The diagram of a volume. Surfaces are observed voxels less than half a diagonal from one."""
    surface = volume.observed & (np.abs(volume.distance) < np.sqrt(3) / 2 * volume.voxel)
    empty = np.zeros((0, 3), np.int64)
    if not surface.any():
        nowhere = np.full(volume.distance.shape, np.nan, np.float32)
        return Gvd(empty, np.zeros(0), np.zeros(0, np.int64), empty[:, :2], nowhere)
    distance, parents = _clearance(volume, surface, config)
    free = volume.observed & (volume.distance > 0) & ~surface
    free &= (distance > config.min_distance) & (distance < config.max_distance)
    field = _Field(free, parents, config)
    member = field.on_diagram()
    basis = np.where(member, field.basis(np.flatnonzero(member)), 1)
    kept = np.flatnonzero(member & (basis >= 2))
    voxels = field.voxels[kept]
    at = tuple(voxels.T)
    seen = np.where(volume.observed, distance, np.nan).astype(np.float32)
    return Gvd(voxels, distance[at].astype(float), basis[kept], field.pairs_among(kept), seen)


def _clearance(
    volume: Volume, surface: NDArray[np.bool_], config: GvdConfig
) -> tuple[NDArray[np.float32], NDArray[np.int32]]:
    """Distance (X, Y, Z) to the nearest surface voxel [m], capped, and that voxel (3, X, Y, Z)."""
    from scipy.ndimage import distance_transform_edt

    distance, parents = distance_transform_edt(~surface, return_indices=True)
    distance = np.minimum(distance * volume.voxel, config.max_distance).astype(np.float32)
    near = np.abs(volume.distance) < config.band
    return np.where(near & volume.observed, np.abs(volume.distance), distance), parents


class _Field:
    """Free voxels with their nearest surface voxels, and which of them are neighbours."""

    def __init__(
        self, free: NDArray[np.bool_], parents: NDArray[np.int32], config: GvdConfig
    ) -> None:
        self._config = config
        self.voxels = np.argwhere(free)
        self.parents = parents[:, free].T.astype(np.int64)
        places = np.full(np.array(free.shape) + 2, -1, np.int64)
        places[1:-1, 1:-1, 1:-1][free] = np.arange(len(self.voxels))
        self._places = places

    def neighbours(self, offset: Ints, of: Ints) -> Ints:
        """Places of the neighbours of voxels, -1 where there is no free one."""
        return self._places[tuple((self.voxels[of] + 1 + offset).T)]

    def on_diagram(self) -> NDArray[np.bool_]:
        """The pair test: of two neighbours with distinct parents, the one that lies nearer to the
        other's parent than the other to its own."""
        member = np.zeros(len(self.voxels), bool)
        everyone = np.arange(len(self.voxels))
        for offset in HALF:
            b = self.neighbours(offset, everyone)
            a = np.flatnonzero(b >= 0)
            b = b[a]
            differ = (self.parents[a] != self.parents[b]).any(axis=1)
            a, b = a[differ], b[differ]
            distinct = self._distinct(self.voxels[a], self.parents[a], self.parents[b])
            a, b = a[distinct], b[distinct]
            to_other, from_other = (
                self.voxels[a] - self.parents[b],
                self.voxels[b] - self.parents[a],
            )
            to_other, from_other = _dot(to_other, to_other), _dot(from_other, from_other)
            member[a[to_other <= from_other]] = True
            member[b[from_other <= to_other]] = True
        return member

    def basis(self, chosen: Ints) -> Ints:
        """(N,) distinct parents of each chosen voxel and its neighbours; 1 for the others."""
        known = np.zeros((MOST_BASIS, len(chosen), 3), np.int64)
        known[0] = self.parents[chosen]
        count = np.ones(len(chosen), np.int64)
        at = self.voxels[chosen]
        for offset in OFFSETS:
            other = self.neighbours(offset, chosen)
            new = (other >= 0) & (count < MOST_BASIS)
            new &= (self.parents[other] != known[0]).any(axis=1)
            for k in range(MOST_BASIS):
                rows = np.flatnonzero(new & (count > k))
                if not len(rows):
                    break
                parent = self.parents[other[rows]]
                new[rows] = self._distinct(at[rows], known[k, rows], parent)
            rows = np.flatnonzero(new)
            known[count[rows], rows] = self.parents[other[rows]]
            count[rows] += 1
        found = np.ones(len(self.voxels), np.int64)
        found[chosen] = count
        return found

    def _distinct(self, at: Ints, parent_a: Ints, parent_b: Ints) -> NDArray[np.bool_]:
        """Are two parents far apart, or in clearly different directions as seen from voxels?"""
        away_a, away_b = parent_a - at, parent_b - at
        lengths = np.sqrt((_dot(away_a, away_a) * _dot(away_b, away_b)).astype(float))
        cosine = _dot(away_a, away_b) / np.maximum(lengths, 1e-9)
        between = np.abs(parent_a - parent_b)
        apart = between[:, 0] + between[:, 1] + between[:, 2] > self._config.parents_apart
        return apart | (cosine < self._config.parents_cosine)

    def pairs_among(self, chosen: Ints) -> Ints:
        """(P, 2) neighbours among the chosen voxels, by their place in ``chosen``."""
        new_place = np.full(len(self.voxels) + 1, -1, np.int64)
        new_place[chosen] = np.arange(len(chosen))
        pairs = []
        for offset in HALF:
            other = new_place[self.neighbours(offset, chosen)]
            mine = np.flatnonzero(other >= 0)
            pairs.append(np.column_stack([mine, other[mine]]))
        return np.concatenate(pairs)


def _dot(a: Ints, b: Ints) -> Ints:
    """(N,) of the rows of (N, 3)."""
    return np.einsum("ij,ij->i", a, b)
