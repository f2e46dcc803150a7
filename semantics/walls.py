"""From the probabilities of edges to walls: pairs of faces that stand back to back."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

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
    common = _back_to_back(pieces, pairs, config)
    good = np.flatnonzero((common > config.overlap) & (probability > config.wall))
    good = good[np.argsort(-common[good], kind="stable")]
    size = np.bincount(label[label >= 0], minlength=1)
    room = np.where((label >= 0) & (size[label] > 1), label, -1)
    taken: dict[int, list[_Claim]] = {}
    chosen = []
    for place in good.tolist():
        i, j = pairs[place].tolist()
        claims = []
        for a, b in ((i, j), (j, i)):
            low, high = _stretch(pieces, a, b)
            rooms = (int(room[a]), int(room[b]))
            claims.append((int(pieces.plane_id[a]), (int(pieces.plane_id[b]), rooms, low, high)))
        if not any(_is_told(claim, taken.get(plane, ())) for plane, claim in claims):
            chosen.append(place)
            for plane, claim in claims:
                taken.setdefault(plane, []).append(claim)
    return np.array(sorted(chosen), dtype=np.int64)


_Claim = tuple[int, tuple[int, int], float, float]
"""Of a plane's wall: the other plane, the rooms here and there, and from where to where [m]."""


def _is_told(claim: _Claim, known: Iterable[_Claim]) -> bool:
    """Has a wall between the same rooms been told of the same two planes, or of this stretch?"""
    other, rooms, low, high = claim
    return any(
        _may_be_same(rooms, theirs) and (other == plane or (low < end and start < high))
        for plane, theirs, start, end in known
    )


def _stretch(pieces: Pieces, i: int, j: int) -> tuple[float, float]:
    """From where to where along i's plane both pieces run [m]."""
    axis = np.array([-pieces.normal[i, 1], pieces.normal[i, 0]])
    mine, others = np.sort(pieces.segment[i] @ axis), np.sort(pieces.segment[j] @ axis)
    return float(max(mine[0], others[0])), float(min(mine[1], others[1]))


def trimmed(pieces: Pieces, i: int, j: int) -> PlanePiece:
    """Of piece i what lies back to back with j: the face of that wall, where the plane has more."""
    axis = np.array([-pieces.normal[i, 1], pieces.normal[i, 0]])
    along = pieces.segment[i] @ axis
    ends = np.clip(along, *_stretch(pieces, i, j))
    segment = pieces.segment[i] + (ends - along)[:, None] * axis
    return PlanePiece(int(pieces.plane_id[i]), segment)


def _may_be_same(rooms: tuple[int, int], others: tuple[int, int]) -> bool:
    """Two pairs of rooms, -1 for an unknown one."""
    return all(a == b or -1 in (a, b) for a, b in zip(rooms, others, strict=True))


def _back_to_back(pieces: Pieces, pairs: IntArray, config: WallConfig) -> Array:
    """(P,) length that two pieces have in common across a wall body [m]; 0 where there is none."""
    length, normal = pieces.length, pieces.normal
    shorter = np.minimum(length[pairs[:, 0]], length[pairs[:, 1]])
    angle = config.angle + config.angle_noise / np.maximum(shorter, 0.1)
    cosine = np.einsum("pc,pc->p", normal[pairs[:, 0]], normal[pairs[:, 1]])
    opposed = cosine < -np.cos(np.minimum(angle, MOST))
    found = np.zeros(len(pairs))
    i, j = pairs[opposed].T
    away = pieces.centre[j] - pieces.centre[i]
    depth_i = -np.einsum("pc,pc->p", away, normal[i])
    depth_j = np.einsum("pc,pc->p", away, normal[j])
    low, high = config.gap
    near = (np.minimum(depth_i, depth_j) > low) & (np.maximum(depth_i, depth_j) < high)
    axis = np.column_stack([-normal[:, 1], normal[:, 0]])[i]
    along_i = np.sort(np.einsum("pkc,pc->pk", pieces.segment[i], axis), axis=1)
    along_j = np.sort(np.einsum("pkc,pc->pk", pieces.segment[j], axis), axis=1)
    common = np.minimum(along_i[:, 1], along_j[:, 1]) - np.maximum(along_i[:, 0], along_j[:, 0])
    found[opposed] = np.where(near, np.maximum(common, 0.0), 0.0)
    return found
