"""An IFC file read in a process of its own: one that makes the parser crash, never end, or take all
memory does no harm here. The process is this module: ``python -m worlds.readers.ifcprocess IFC UNIT
ANSWER MEMORY``.
"""

from __future__ import annotations

import os
import pickle
import resource
import subprocess
import sys
import tempfile
from importlib.util import find_spec
from pathlib import Path

from slam.core import InputError
from worlds.readers.ifcfile import Building, read_ifc_file

PATIENCE = 60.0
"""Time that any file gets [s]; the duplex house of two storeys takes one."""
PATIENCE_PER_MB = 5.0
"""Time that each megabyte of a file gets beyond that [s]."""
LONGEST = 600.0
"""Time that no file gets more of [s]."""
MEMORY, MEMORY_PER_BYTE = 4_000_000_000, 30
"""Address space that any file gets [bytes], and each byte of it beyond that; the parser alone takes
0.3 GB, a file's entities some ten times its size."""


def read_apart(path: Path, unit: str | None) -> Building:
    """``read_ifc_file`` in a process of its own. Raises InputError, also where ifcopenshell is not
    installed, and where the process crashes or takes too long."""
    if find_spec("ifcopenshell") is None:
        raise InputError(f'{path}: reading IFC needs: pip install "roomloop[ifc]"')
    with tempfile.TemporaryDirectory() as folder:
        answer = Path(folder) / "answer"
        memory = MEMORY + MEMORY_PER_BYTE * path.stat().st_size
        _run(path, [str(path), unit or "", str(answer), str(memory)])
        found = pickle.loads(answer.read_bytes())
    if isinstance(found, str):
        raise InputError(found)
    assert isinstance(found, Building)
    return found


def _run(path: Path, arguments: list[str]) -> None:
    patience = min(PATIENCE + PATIENCE_PER_MB * path.stat().st_size / 1e6, LONGEST)
    try:
        subprocess.run(
            [sys.executable, "-m", __name__, *arguments],
            env=os.environ | {"PYTHONPATH": os.pathsep.join(filter(None, sys.path))},
            stdin=subprocess.DEVNULL,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
            timeout=patience,
            check=True,
        )
    except subprocess.TimeoutExpired as error:
        raise InputError(f"{path}: expected sound IFC: not read in {patience:.0f} s") from error
    except subprocess.CalledProcessError as error:
        raise InputError(f"{path}: expected sound IFC: ifcopenshell crashed on it") from error


def main(path: str, unit: str, answer: str, memory: str) -> None:
    """Reads a file and writes the building, or the message of an InputError, as a pickle; takes no
    more memory [bytes]."""
    resource.setrlimit(resource.RLIMIT_AS, (int(memory), int(memory)))
    try:
        found: Building | str = read_ifc_file(Path(path), unit or None)
    except InputError as error:
        found = str(error)
    Path(answer).write_bytes(pickle.dumps(found))


if __name__ == "__main__":
    main(*sys.argv[1:])
