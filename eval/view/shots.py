"""Pictures of a recording, taken with a viewer that has no window."""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from eval.view.viewers import ViewerError, open_unseen

LOAD_S = 120.0
PATIENCE = 4
"""Times that the viewer, which gives up after 15 s, is asked for one picture."""

SETTLE_S = 2.0
"""What the viewer gets to draw a moment, and to take its notices away."""


@dataclass(frozen=True)
class Shot:
    """One picture: when (None: at the end), and of which view (None: of all)."""

    moment: float | None = None
    view: str | None = None


def take(
    recording: Path, shots: Sequence[Shot], size: tuple[int, int] = (1600, 900)
) -> list[bytes]:
    """PNG files, one a shot. Raises ViewerError where nothing can be drawn."""
    viewer = open_unseen(recording, size)
    try:
        client = _loaded(viewer.address, recording)
        return [_take(client, shot, max(size)) for shot in shots]
    except (RuntimeError, TimeoutError, ConnectionError) as error:
        why = "the viewer has died (is there a graphics driver?)"
        why = why if isinstance(error, ConnectionError) else str(error)
        raise ViewerError(f"{recording}: no picture could be taken: {why}") from error
    finally:
        viewer.stop()


def _loaded(address: str, recording: Path) -> Any:
    """A client of the viewer once it has read the recording."""
    from rerun.experimental import ViewerClient

    client = ViewerClient.connect(address)
    deadline = time.monotonic() + LOAD_S
    while time.monotonic() < deadline:
        state = client.get_state()
        if not state.loading and any(r.timelines for r in state.recordings):
            return client
        time.sleep(0.2)
    raise ViewerError(f"{recording}: the viewer did not load it within {LOAD_S:.0f} s")


def _take(client: Any, shot: Shot, longest: int) -> bytes:
    if shot.moment is not None:
        client.set_time("sim_time", duration=shot.moment, play_state="paused")
    ids = {view.name: view.view_id for view in client.get_state().views}
    time.sleep(SETTLE_S)
    for _ in range(PATIENCE - 1):
        try:
            return bytes(client.take_screenshot(ids.get(shot.view), max_size=longest))
        except TimeoutError:  # a busy machine draws slowly without a graphics card
            continue
    return bytes(client.take_screenshot(ids.get(shot.view), max_size=longest))
