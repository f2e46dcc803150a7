"""A drive simulated ahead in a process of its own, while its last scans are being worked on.

A process, for casting rays and registering scans both hold the interpreter's lock; one that is
started afresh and not forked, for the threads of Embree and TBB do not survive a fork; and over a
pipe, whose end says at once on either side that the other one is gone.
"""

from __future__ import annotations

import contextlib
import os
import pickle
import queue
import subprocess
import sys
import threading
import traceback
import weakref
from collections.abc import Callable, Iterable, Iterator
from typing import Any, BinaryIO, Generic, TypeVar

import numpy as np

from sim.truth import ScanTruth
from slam.core import InputError, RoomloopError, RunError, Scan, cores, thread_limit

Pair = tuple[Scan, ScanTruth]

Item = TypeVar("Item")

DEPTH = 4
"""Sweeps that wait at most: a keyframe takes its user as long as some plain sweeps."""

PIPE_BYTES = 1 << 20
"""What the system holds of a pipe where it can be asked (Linux); a sweep is one to two MB."""


class Ahead(Generic[Item]):
    """Iterates like what ``make()`` returns, a drive, to the bit, but simulated elsewhere.

    make: what can be pickled by the name of its module (a ``functools.partial`` of a function, not
    of a lambda); duration: about how long it drives [s]. The process starts at once. It serves one
    iteration, and goes when that ends, is closed, fails, or when this object or its process goes.
    Raises what the drive raises.
    """

    def __init__(
        self, make: Callable[[], Iterable[Item]], duration: float = np.inf, depth: int = DEPTH
    ) -> None:
        self.duration = duration
        self._reader, process = _start(make, depth)
        self._process = process
        self._stop = weakref.finalize(self, _stop, process, self._reader)

    def __iter__(self) -> Iterator[Item]:
        if not self._stop.alive:
            raise InputError("a drive that runs ahead can be iterated once only")
        try:
            while (message := self._receive()) is not None:
                yield message[0]
        finally:
            self._stop()

    def close(self) -> None:
        """Ends the process, if it is not gone yet."""
        self._stop()

    def _receive(self) -> tuple[Item] | None:
        """The next item, None after the last. Raises what was raised over there."""
        try:
            what, value = pickle.load(self._reader)
        except (EOFError, pickle.UnpicklingError) as error:
            status = self._process.wait()
            raise RunError(f"the simulator's process ended with status {status}") from error
        if what == "raised":
            raise value
        return (value,) if what == "item" else None


def _start(make: Callable[[], Iterable[object]], depth: int) -> tuple[BinaryIO, subprocess.Popen]:
    """The process, and the end of the pipe to read from."""
    recipe = pickle.dumps((make, depth))
    read, write = os.pipe()
    _widen(read)
    entry = f"import sys; sys.path[:] = {sys.path!r}; from sim.ahead import serve; serve({write})"
    process = subprocess.Popen(
        [sys.executable, "-c", entry],
        stdin=subprocess.PIPE,
        stdout=subprocess.DEVNULL,
        pass_fds=(write,),
        env={**os.environ, "OMP_NUM_THREADS": str(thread_limit(cores() - 1))},
        start_new_session=True,  # Ctrl-C is for who reads; the pipe tells this one
    )
    os.close(write)
    assert process.stdin is not None
    with contextlib.suppress(BrokenPipeError), process.stdin as stdin:
        stdin.write(recipe)
    return os.fdopen(read, "rb", buffering=1 << 16), process


def _widen(pipe: int) -> None:
    """Has the system hold more of a pipe, where it can."""
    with contextlib.suppress(ImportError, AttributeError, OSError):
        import fcntl

        fcntl.fcntl(pipe, fcntl.F_SETPIPE_SZ, PIPE_BYTES)


def _stop(process: subprocess.Popen, reader: BinaryIO) -> None:
    """Ends the process and waits for it, so that nothing of it remains."""
    reader.close()
    process.terminate()
    process.wait()


# --- over there ----------------------------------------------------------------------------------


def serve(pipe: int) -> None:
    """The other process: drives, and writes each item to the pipe, ``depth`` of them ahead."""
    make, depth = pickle.load(sys.stdin.buffer)
    waiting: queue.Queue[tuple[str, Any]] = queue.Queue(maxsize=depth)
    writer = threading.Thread(target=_write, args=(pipe, waiting))
    writer.start()
    try:
        for item in make():
            waiting.put(("item", item))
        waiting.put(("end", None))
    except BaseException as error:
        waiting.put(("raised", _sendable(error)))
    writer.join()


def _write(pipe: int, waiting: queue.Queue[tuple[str, Any]]) -> None:
    """Writes what is put there, until the end of it. Gone reader: gone process."""
    try:
        with os.fdopen(pipe, "wb") as stream:
            what = "item"
            while what == "item":
                message = waiting.get()
                pickle.dump(message, stream, protocol=5)
                stream.flush()
                what = message[0]
    except BrokenPipeError:
        os._exit(1)


def _sendable(error: BaseException) -> BaseException:
    """The error as it can be raised over here: ours as it is, others with their trace as text."""
    if isinstance(error, RoomloopError):
        return error
    trace = "".join(traceback.format_exception(error))
    return RuntimeError(f"in the simulator's process:\n{trace}")
