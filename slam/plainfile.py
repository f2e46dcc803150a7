"""Files that end: what a pipe or a device would make a reader wait for, or read for ever."""

from __future__ import annotations

import stat
from pathlib import Path

from slam.core import InputError


def size_of(path: Path) -> int:
    """The size of a plain file [bytes]. Raises InputError where there is none, before it is
    opened: that of a pipe might wait for ever, and a device has no end."""
    try:
        status = path.stat()
    except (OSError, ValueError) as error:  # ValueError: a name with a NUL in it
        reason = getattr(error, "strerror", None) or error
        raise InputError(f"{path}: cannot be read: {reason}") from error
    if not stat.S_ISREG(status.st_mode):
        kind = "a folder" if stat.S_ISDIR(status.st_mode) else "a pipe or a device"
        raise InputError(f"{path}: cannot be read: expected a file, found {kind}")
    return status.st_size
