"""Viewers as processes of their own: the window, and the page for a browser."""

from __future__ import annotations

import os
import signal
import socket
import subprocess
import sys
import time
from contextlib import closing, suppress
from dataclasses import dataclass
from pathlib import Path

from slam.core import RoomloopError

MEMORY = "1GB"
"""Of a viewer, and of what is kept for browsers that come late; then the oldest goes."""

LOOPBACK = "127.0.0.1"
START_S = 45.0
"""How long a viewer may take to listen."""


class ViewerError(RoomloopError):
    """No viewer could be started; a run goes on without."""

    exit_status = 2


@dataclass(frozen=True)
class Viewer:
    """A viewer that listens. address: for streams; page: for a browser, if it serves one."""

    process: subprocess.Popen[bytes]
    address: str
    page: str | None = None

    def alive(self) -> bool:
        """Is it still there? Whoever watches may close it."""
        return self.process.poll() is None

    def stop(self) -> None:
        """Ends it."""
        _end(self.process)


def open_window(path: Path | None = None) -> Viewer:
    """The native viewer. It outlives the run. Raises ViewerError where it cannot be shown."""
    if sys.platform.startswith("linux") and not (
        os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY")
    ):
        raise ViewerError("view: there is no display here; try --serve, or --save")
    port = free_port(9876)
    files = [] if path is None else [str(path)]
    return _started([*files, "--port", str(port), "--memory-limit", MEMORY], port)


def open_page(path: Path | None = None) -> Viewer:
    """The viewer as a page, for browsers on this machine only. Raises ViewerError."""
    port = free_port(9876)
    web = free_port(9090 if port != 9090 else 9091)
    files = [] if path is None else [str(path)]
    ports = ["--port", str(port), "--web-viewer-port", str(web)]
    options = ["--serve-web", *ports, "--server-memory-limit", MEMORY]
    address = f"rerun+http://{LOOPBACK}:{port}/proxy"
    said = address.replace("+", "%2B").replace(":", "%3A")
    page = f"http://{LOOPBACK}:{web}/?url={said}&theme=dark&hide_welcome_screen"
    return _started([*files, *options], port, page)


def open_unseen(path: Path, size: tuple[int, int] = (1600, 900)) -> Viewer:
    """A viewer without a window, to take pictures with. Raises ViewerError."""
    port = free_port(9876)
    shape = f"{size[0]}x{size[1]}"
    return _started([str(path), "--port", str(port), "--headless", "--window-size", shape], port)


def free_port(wanted: int) -> int:
    """The wanted port of the loopback address, or any free one."""
    for port in (wanted, 0):
        with closing(socket.socket()) as probe:
            try:
                probe.bind((LOOPBACK, port))
            except OSError:
                continue
            return int(probe.getsockname()[1])
    raise ViewerError("view: no free port on the loopback address")


def _started(options: list[str], port: int, page: str | None = None) -> Viewer:
    command = [sys.executable, "-m", "rerun", "--bind", LOOPBACK, *options]
    process = subprocess.Popen(
        command,
        stdin=subprocess.DEVNULL,
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
        start_new_session=True,  # Ctrl-C ends the run, not its viewer
    )
    deadline = time.monotonic() + START_S
    while time.monotonic() < deadline and process.poll() is None:
        with closing(socket.socket()) as probe:
            if probe.connect_ex((LOOPBACK, port)) == 0:
                return Viewer(process, f"rerun+http://{LOOPBACK}:{port}/proxy", page)
        time.sleep(0.05)
    _end(process)
    raise ViewerError("view: the viewer did not start (is there a graphics driver?)")


def _end(process: subprocess.Popen[bytes]) -> None:
    """Ends a process and those that it started: rerun's command is one that starts the viewer."""
    with suppress(ProcessLookupError):
        os.killpg(process.pid, signal.SIGTERM)
    process.wait()
