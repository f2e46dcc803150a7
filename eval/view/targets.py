"""Where a stream goes: a file that is there once it is whole, or a viewer."""

from __future__ import annotations

from contextlib import suppress
from pathlib import Path
from typing import Any


class FileTarget:
    """A recording (.rrd)."""

    tick_s = 10.0
    """Many rows in one piece: a third of the bytes."""

    def __init__(self, path: Path):
        self._path = path
        self._part = path.with_name(f".{path.name}.part")

    def open(self, stream: Any, blueprint: Any) -> None:
        """Writes beside the path until the run is over."""
        stream.save(self._part, default_blueprint=blueprint)

    def close(self, stream: Any) -> None:
        """Completes the file."""
        stream.flush()
        stream.disconnect()
        self._part.replace(self._path)


class ViewerTarget:
    """A viewer that listens at a rerun address."""

    tick_s = 0.3

    PATIENCE_S = 5.0
    """How long the end of a run waits for a viewer that is slow, or gone."""

    def __init__(self, address: str):
        self._address = address

    def open(self, stream: Any, blueprint: Any) -> None:
        """Connects; a viewer that is gone loses what it is sent, nothing else."""
        stream.connect_grpc(self._address, default_blueprint=blueprint)

    def close(self, stream: Any) -> None:
        """Sends what is left, as far as the viewer takes it."""
        with suppress(RuntimeError, ValueError):  # of a closed viewer nobody misses the rest
            stream.flush(timeout_sec=self.PATIENCE_S)
        stream.disconnect()
