"""How long a sweep will take, from what its runs have taken so far."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from statistics import fmean

ROOM_S = 15.0
"""Simulated seconds that a tour takes for each room and corridor."""
LIVE, REPLAY = 0.7, 0.25
"""Wall seconds of one thread for a simulated second, before anything is known: with scans and
odometry, and with a recorded front end."""
START_S = 2.0
"""Wall seconds of a run before its first scan and after its last, before anything is known."""


@dataclass(frozen=True)
class Cost:
    """What the time of a run depends on. scene: its name; variant: of detector and back end;
    replay: whether its front end is recorded already; simulated: about how long it drives [s]."""

    scene: str
    variant: str
    replay: bool
    simulated: float

    @property
    def prior(self) -> float:
        """Wall seconds, before anything is known."""
        return START_S + self.simulated * (REPLAY if self.replay else LIVE)


class Forecast:
    """Learns from finished runs. Times are of wall, one run at a time [s]."""

    def __init__(self) -> None:
        self._taken: list[tuple[Cost, float]] = []

    def add(self, cost: Cost, seconds: float) -> None:
        """A run has taken so long."""
        self._taken.append((cost, seconds))

    def one(self, cost: Cost) -> float:
        """A run's time: the mean of runs that are like it, the nearest ones that there are."""
        for alike in (
            lambda other: other == cost,
            lambda other: (other.scene, other.replay) == (cost.scene, cost.replay),
        ):
            times = [seconds for other, seconds in self._taken if alike(other)]
            if times:
                return fmean(times)
        return cost.prior * self._correction(cost.replay)

    def knows(self, costs: Iterable[Cost]) -> bool:
        """Has every kind of run been timed, so that no prior enters?"""
        timed = {(cost.scene, cost.replay) for cost, _ in self._taken}
        return all((cost.scene, cost.replay) in timed for cost in costs)

    def _correction(self, replay: bool) -> float:
        """How much slower than the prior this machine is, by runs of the same kind if any."""
        same = [(cost, s) for cost, s in self._taken if cost.replay == replay] or self._taken
        return sum(s for _, s in same) / sum(cost.prior for cost, _ in same) if same else 1.0

    def all(self, costs: Iterable[Cost], workers: int) -> float:
        """Time for many runs, shared by workers; never less than the longest of them."""
        times = [self.one(cost) for cost in costs]
        return max([sum(times) / workers, *times]) if times else 0.0
