"""Where a run's time goes."""

from __future__ import annotations

from dataclasses import dataclass, field

from eval.metrics import Stages, StageTime


@dataclass
class Clock:
    """Wall time by stage [s], one entry a call."""

    seconds: dict[str, list[float]] = field(default_factory=dict)

    def add(self, stage: str, seconds: float) -> None:
        """One more call of a stage."""
        self.seconds.setdefault(stage, []).append(seconds)

    def last(self) -> dict[str, float]:
        """What each stage took when it last ran."""
        return {stage: seconds[-1] for stage, seconds in self.seconds.items()}

    def stages(self) -> Stages:
        """What each took in all, as metrics.json has it."""
        return Stages(**{name: StageTime.of(seconds) for name, seconds in self.seconds.items()})
