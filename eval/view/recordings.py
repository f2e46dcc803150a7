"""Recordings of finished runs: where they are, and whether this rerun can open them."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

from slam.core import InputError
from slam.plainfile import size_of

MAGIC = b"RRF"


def recording_of(run: Path) -> Path:
    """The recording of a run's folder, or the file itself. Raises InputError."""
    if not run.exists():
        raise InputError(f"{run}: no such run; expected its folder, as runs/SE1-gnn-s0, or a .rrd")
    if run.is_file():
        return run
    path = run / "recording.rrd"
    if not path.is_file():
        raise InputError(f"{run}: holds no recording.rrd; run it again with --save")
    return path


def check_recording(path: Path) -> None:
    """Raises InputError for what is no recording, is cut off, or is of another version."""
    size_of(path)
    with path.open("rb") as file:
        start = file.read(len(MAGIC))
    if start != MAGIC:
        raise InputError(f"{path}: not a rerun recording (.rrd)")
    command = [sys.executable, "-m", "rerun", "rrd", "verify", str(path)]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    if done.returncode != 0:
        said = next((line for line in done.stderr.splitlines() if line.strip()), "unreadable")
        raise InputError(
            f"{path}: cut off, or written by another version of rerun ({said.strip()})"
        )
