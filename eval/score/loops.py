"""Loop closures against the truth: right, wrong, and revisits that none was found for."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from slam.core import Array, inverse, so3_log
from slam.loops import Loop


@dataclass(frozen=True)
class LoopRule:
    """A closure is true within distance [m] and angle [rad] of the true motion between its two
    keyframes. A revisit: the base is within near [m] of where it was at least apart [m] of its way
    ago; one that goes on for more than ``stretch`` metres counts once per stretch. It is missed if
    no true closure was made on it."""

    distance: float = 0.10
    angle: float = np.radians(2.0)
    near: float = 1.0
    apart: float = 12.0
    stretch: float = 8.0


@dataclass(frozen=True)
class LoopScore:
    """How many closures are true and false, and how many revisits were missed."""

    true: int
    false: int
    missed: int


def score_loops(loops: Sequence[Loop], poses: Array, rule: LoopRule = LoopRule()) -> LoopScore:
    """poses: (K, 4, 4) true T_world_base of all keyframes."""
    right = [loop for loop in loops if _is_true(loop, poses, rule)]
    closed = {loop.later for loop in right}
    missed = sum(not closed & visit for visit in _revisits(poses, rule))
    return LoopScore(len(right), len(loops) - len(right), missed)


def _is_true(loop: Loop, poses: Array, rule: LoopRule) -> bool:
    error = inverse(loop.T_earlier_later) @ inverse(poses[loop.earlier]) @ poses[loop.later]
    turn = float(np.linalg.norm(so3_log(error[:3, :3])))
    return float(np.linalg.norm(error[:3, 3])) < rule.distance and turn < rule.angle


def _revisits(poses: Array, rule: LoopRule) -> list[set[int]]:
    """Keyframes of each stretch on which the base was where it had been before."""
    places = poses[:, :3, 3]
    steps = np.linalg.norm(np.diff(places, axis=0), axis=1)
    way = np.concatenate([[0.0], np.cumsum(steps)])
    visits: list[set[int]] = []
    begun = -np.inf
    for k in range(len(poses)):
        before = way < way[k] - rule.apart
        distance = np.linalg.norm(places[before] - places[k], axis=1)
        if distance.min(initial=np.inf) > rule.near:
            continue
        if not visits or way[k] - begun > rule.stretch or k - 1 not in visits[-1]:
            visits.append(set())
            begun = way[k]
        visits[-1].add(k)
    return visits
