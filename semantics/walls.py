"""From the probabilities of edges to walls: pairs of faces that stand back to back."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass

import numpy as np

from semantics.lines import row_dots
from semantics.pieces import Pieces
from slam.core import Array, IntArray, PlanePiece

MOST = np.radians(8.0)
"""However short they are, faces of a wall are not further off parallel."""


@dataclass(frozen=True)
class WallConfig:
    """wall: least probability of a pair; gap: (least, largest) distance [m] of a wall's faces,
    overlap: least common length [m], angle [rad]: between them, as a wall is flat and its sides
    parallel, and angle_noise [rad m] of it more per metre that the shorter one is short, as the
    mapping is no better (measured: ``plane_noise.csv``).
    """

    wall: float = 0.6
    gap: tuple[float, float] = (0.03, 0.62)
    overlap: float = 0.2
    angle: float = np.radians(1.5)
    angle_noise: float = np.radians(1.0)


def walls_of(
    pieces: Pieces, pairs: IntArray, probability: Array, label: IntArray, config: WallConfig
) -> IntArray:
    """(W,) places in ``pairs`` of those that are two faces of a wall: likely, back to back, near.

    label: (M,) the cluster of each piece. A long face may have a wall with each of several rooms
    behind it; but what one room has of a plane is one face, in however many pieces: of those the
    pair with most in common stands for all. A piece alone may be of any room.
    """
    likely = np.flatnonzero(probability > config.wall)
    common = _back_to_back(pieces, pairs[likely], config)
    good = np.flatnonzero(common > config.overlap)
    good = likely[good[np.argsort(-common[good], kind="stable")]]
    size = np.bincount(label[label >= 0], minlength=1)
    room = np.where((label >= 0) & (size[label] > 1), label, -1)
    taken: dict[int, list[_Claim]] = {}
    chosen = []
    for place, claims in zip(good.tolist(), _claims(pieces, pairs[good], room), strict=True):
        (p, here), (q, there) = claims
        if not (_is_told(here, taken.get(p, ())) or _is_told(there, taken.get(q, ()))):
            chosen.append(place)
            taken.setdefault(p, []).append(here)
            taken.setdefault(q, []).append(there)
    return np.array(sorted(chosen), dtype=np.int64)


_Claim = tuple[int, tuple[int, int], float, float]
"""Of a plane's wall: the other plane, the rooms here and there, and from where to where [m]."""


def _claims(
    pieces: Pieces, pairs: IntArray, room: IntArray
) -> Iterator[tuple[tuple[int, _Claim], tuple[int, _Claim]]]:
    """Of each pair, what it says of the plane of the one and of that of the other."""
    both = np.concatenate([pairs, pairs[:, ::-1]])
    low, high = (side.reshape(2, -1).T.tolist() for side in _stretches(pieces, both))
    planes, rooms = pieces.plane_id[pairs].tolist(), room[pairs].tolist()
    for (p, q), (here, there), start, end in zip(planes, rooms, low, high, strict=True):
        yield (
            (p, (q, (here, there), start[0], end[0])),
            (q, (p, (there, here), start[1], end[1])),
        )


def _is_told(claim: _Claim, known: Iterable[_Claim]) -> bool:
    """Has a wall between the same rooms been told of the same two planes, or of this stretch?"""
    other, rooms, low, high = claim
    for plane, theirs, start, end in known:
        near = other == plane or (low < end and start < high)
        if near and _may_be_same(rooms, theirs):
            return True
    return False


def _stretches(pieces: Pieces, pairs: IntArray) -> tuple[Array, Array]:
    """(P,) from where to where along the plane of the first both pieces run [m]."""
    mine, others = (np.sort(_along(pieces, pairs, k), axis=1).T for k in (0, 1))
    return np.maximum(mine[0], others[0]), np.minimum(mine[1], others[1])


def _along(pieces: Pieces, pairs: IntArray, which: int) -> Array:
    """(P, 2) where the ends of one of each two pieces are along the plane of the first [m]."""
    axis = _axes(pieces)[pairs[:, 0]]
    return np.matmul(pieces.segment[pairs[:, which]], axis[:, :, None])[:, :, 0]


def _axes(pieces: Pieces) -> Array:
    return np.column_stack([-pieces.normal[:, 1], pieces.normal[:, 0]])


def faces_of(pieces: Pieces, pairs: IntArray) -> list[tuple[PlanePiece, PlanePiece]]:
    """Of each two pieces what lies back to back with the other one: the faces of that wall, where
    the planes have more."""
    both = np.concatenate([pairs, pairs[:, ::-1]])
    first, (low, high) = both[:, 0], _stretches(pieces, both)
    along = _along(pieces, both, 0)
    ends = np.minimum(np.maximum(along, low[:, None]), high[:, None])
    shift = (ends - along)[:, :, None] * _axes(pieces)[first][:, None, :]
    faces = list(map(PlanePiece, pieces.plane_id[first].tolist(), pieces.segment[first] + shift))
    return list(zip(faces[: len(pairs)], faces[len(pairs) :], strict=True))


def _may_be_same(rooms: tuple[int, int], others: tuple[int, int]) -> bool:
    """Two pairs of rooms, -1 for an unknown one."""
    (a, b), (c, d) = rooms, others
    return (a == c or a < 0 or c < 0) and (b == d or b < 0 or d < 0)


def _back_to_back(pieces: Pieces, pairs: IntArray, config: WallConfig) -> Array:
    """(P,) length that two pieces have in common across a wall body [m]; 0 where there is none."""
    i, j = pairs.T
    shorter = np.minimum(pieces.length[i], pieces.length[j])
    angle = config.angle + config.angle_noise / np.maximum(shorter, 0.1)
    cosine = row_dots(pieces.normal[i], pieces.normal[j])
    opposed = np.flatnonzero(cosine < -np.cos(np.minimum(angle, MOST)))
    i, j = i[opposed], j[opposed]
    away = pieces.centre[j] - pieces.centre[i]
    depth_i, depth_j = -row_dots(away, pieces.normal[i]), row_dots(away, pieces.normal[j])
    low, high = config.gap
    near = (np.minimum(depth_i, depth_j) > low) & (np.maximum(depth_i, depth_j) < high)
    mine = pieces.along[i]
    others = np.sort(np.einsum("pkc,pc->pk", pieces.segment[j], _axes(pieces)[i]), axis=1)
    common = np.minimum(mine[:, 1], others[:, 1]) - np.maximum(mine[:, 0], others[:, 0])
    found = np.zeros(len(pairs))
    found[opposed] = np.where(near, np.maximum(common, 0.0), 0.0)
    return found
