"""Who watches a run: nobody, a recording, or several. A sink is told; it never answers."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Protocol

from slam.core import Array, Frame, MapView, Proposals, Scan
from worlds.truth import Truth

if TYPE_CHECKING:
    from eval.config import RunConfig


class Sink(Protocol):
    """Told about each step of a run: ``started`` first, ``finished`` last, errors or not. Of each
    scan, ``updated``, ``timed`` and ``event`` where they apply, in this order, and then ``frame``
    (not where the front end is replayed)."""

    def started(self, config: RunConfig, truth: Truth | None) -> None:
        """The run begins. truth: None where there is none (a recording of a real robot)."""
        ...

    def frame(
        self, frame: Frame, scan: Scan, T_map_base: Array, T_world_base: Array | None = None
    ) -> None:
        """One scan went through; poses (4, 4) at its end: as estimated online, and the true one."""
        ...

    def updated(self, view: MapView, proposals: Proposals) -> None:
        """A keyframe went through: the map after its optimisation, and what the detector says."""
        ...

    def timed(self, stamp: float, seconds: Mapping[str, float]) -> None:
        """What each stage took of the keyframe that ``updated`` told of [s]."""
        ...

    def event(self, stamp: float, text: str) -> None:
        """Something that does not happen with every scan, such as a loop closure."""
        ...

    def finished(self) -> None:
        """The run is over; files are completed here."""
        ...


class NullSink:
    """Watches nothing."""

    def started(self, config: RunConfig, truth: Truth | None) -> None:
        """Ignored."""

    def frame(
        self, frame: Frame, scan: Scan, T_map_base: Array, T_world_base: Array | None = None
    ) -> None:
        """Ignored."""

    def updated(self, view: MapView, proposals: Proposals) -> None:
        """Ignored."""

    def timed(self, stamp: float, seconds: Mapping[str, float]) -> None:
        """Ignored."""

    def event(self, stamp: float, text: str) -> None:
        """Ignored."""

    def finished(self) -> None:
        """Ignored."""


class Sinks:
    """Tells several sinks, in their order."""

    def __init__(self, sinks: Iterable[Sink]):
        self._sinks = tuple(sinks)

    def started(self, config: RunConfig, truth: Truth | None) -> None:
        """Passed on."""
        for sink in self._sinks:
            sink.started(config, truth)

    def frame(
        self, frame: Frame, scan: Scan, T_map_base: Array, T_world_base: Array | None = None
    ) -> None:
        """Passed on."""
        for sink in self._sinks:
            sink.frame(frame, scan, T_map_base, T_world_base)

    def updated(self, view: MapView, proposals: Proposals) -> None:
        """Passed on."""
        for sink in self._sinks:
            sink.updated(view, proposals)

    def timed(self, stamp: float, seconds: Mapping[str, float]) -> None:
        """Passed on."""
        for sink in self._sinks:
            sink.timed(stamp, seconds)

    def event(self, stamp: float, text: str) -> None:
        """Passed on."""
        for sink in self._sinks:
            sink.event(stamp, text)

    def finished(self) -> None:
        """Passed on."""
        for sink in self._sinks:
            sink.finished()


def make_sink(config: RunConfig, folder: Path, watchers: Sequence[Sink] = ()) -> Sink:
    """What the configuration asks for, writing to the run's folder, and whoever else watches."""
    if not config.save:
        return Sinks(watchers) if watchers else NullSink()
    from eval.view.recorder import Recorder
    from eval.view.targets import FileTarget

    return Sinks([Recorder(FileTarget(folder / "recording.rrd")), *watchers])
