"""Walls: a pair of pieces is true if their faces are the two faces of one true wall."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

from eval.score.rooms import ratio
from eval.score.votes import WallVote
from eval.seen import SeenFaces
from worlds.truth import Truth, Wall


@dataclass(frozen=True)
class WallScore:
    """The figures of metrics.json's ``walls``.

    truth: walls that count (both faces seen); precision counts over all true walls, recall over
    those that count. One-to-one: a second proposal of a wall is false. matches: proposal id to
    wall. All are None in a world without room truth.
    """

    truth: int | None = None
    detected: int | None = None
    true_positive: int | None = None
    precision: float | None = None
    recall: float | None = None
    matches: Mapping[int, int] = field(default_factory=dict)


def counting_walls(truth: Truth, seen: SeenFaces) -> tuple[Wall, ...]:
    """Walls both of whose faces are seen."""
    return tuple(wall for wall in truth.walls if all(seen.seen[face] for face in wall.faces))


def match_walls(votes: Sequence[WallVote], truth: Truth) -> dict[int, int]:
    """True detections: proposal id -> wall id; of several for one wall, the lowest id."""
    wall_of = {frozenset(wall.faces): wall.id for wall in truth.walls}
    matches: dict[int, int] = {}
    for vote in sorted(votes, key=lambda vote: vote.id):
        wall = wall_of.get(frozenset(vote.faces))
        if wall is not None and wall not in matches.values():
            matches[vote.id] = wall
    return matches


def score_walls(votes: Sequence[WallVote], truth: Truth, seen: SeenFaces) -> WallScore:
    """Score the final wall detections."""
    matches = match_walls(votes, truth)
    counting = {wall.id for wall in counting_walls(truth, seen)}
    recalled = sum(wall in counting for wall in matches.values())
    return WallScore(
        truth=len(counting),
        detected=len(votes),
        true_positive=len(matches),
        precision=ratio(len(matches), len(votes)),
        recall=ratio(recalled, len(counting)),
        matches=matches,
    )
