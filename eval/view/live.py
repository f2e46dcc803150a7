"""A sink that never makes the run wait: what its viewer has no time for is left out."""

from __future__ import annotations

import logging
import threading
from collections import deque
from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING

from eval.sinks import Sink
from slam.core import Array, Frame, MapView, Proposals, Scan
from worlds.truth import Truth

if TYPE_CHECKING:
    from eval.config import RunConfig

LENGTH = 8
"""Calls that may wait; then the oldest that may be left out goes."""

logger = logging.getLogger(__name__)


class LiveSink:
    """Hands the calls on to another sink in a thread of its own, newest first to be kept.

    If the other sink fails, or its viewer is no longer ``alive``, the run goes on without it, and a
    warning says so.
    """

    def __init__(self, inner: Sink, length: int = LENGTH, alive: Callable[[], bool] = lambda: True):
        self._inner = inner
        self._alive = alive
        self._waiting: deque[Callable[[], None]] = deque(maxlen=length)
        self._ready = threading.Condition()
        self._over = False
        self._thread = threading.Thread(target=self._work, name="viewer", daemon=True)

    def started(self, config: RunConfig, truth: Truth | None) -> None:
        """At once, so that nothing can come before it."""
        if self._try(lambda: self._inner.started(config, truth)):
            self._thread.start()

    def frame(
        self, frame: Frame, scan: Scan, T_map_base: Array, T_world_base: Array | None = None
    ) -> None:
        """Queued."""
        self._put(lambda: self._inner.frame(frame, scan, T_map_base, T_world_base))

    def updated(self, view: MapView, proposals: Proposals) -> None:
        """Queued."""
        self._put(lambda: self._inner.updated(view, proposals))

    def timed(self, stamp: float, seconds: Mapping[str, float]) -> None:
        """Queued."""
        self._put(lambda: self._inner.timed(stamp, seconds))

    def event(self, stamp: float, text: str) -> None:
        """Queued."""
        self._put(lambda: self._inner.event(stamp, text))

    def finished(self) -> None:
        """Waits for what is queued, which is little."""
        with self._ready:
            self._over = True
            self._ready.notify()
        if self._thread.is_alive():
            self._thread.join()

    def _put(self, call: Callable[[], None]) -> None:
        with self._ready:
            if not self._over:
                self._waiting.append(call)
                self._ready.notify()

    def _work(self) -> None:
        while True:
            with self._ready:
                self._ready.wait_for(lambda: self._waiting or self._over)
                if not self._waiting:
                    break
                call = self._waiting.popleft()
            if not self._alive():
                self._give_up("closed")
                return
            if not self._try(call):
                return
        self._try(self._inner.finished)

    def _try(self, call: Callable[[], None]) -> bool:
        try:
            call()
        except Exception as error:  # whatever a viewer does, the run goes on
            self._give_up(f"lost ({error})")
            return False
        return True

    def _give_up(self, why: str) -> None:
        logger.warning("view: the viewer was %s; the run goes on", why)
        with self._ready:
            self._over = True
