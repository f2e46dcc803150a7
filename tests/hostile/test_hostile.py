"""No file, however bad, ends in anything but a result or one line that names it."""

from __future__ import annotations

import os
import resource
import signal
from collections.abc import Callable, Iterator
from pathlib import Path
from types import FrameType

import numpy as np
import pytest
from kinds import KINDS, Kind
from spoil import always, bomb, spoilt

from slam.core import InputError, RoomloopError

SAMPLES = 25
PATIENCE_S = 20
MOST_MB = 400.0
"""By how much the process may grow over one kind's samples."""


def peak_mb() -> float:
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024.0


@pytest.fixture(autouse=True)
def patience() -> Iterator[None]:
    """A reader that hangs fails, and does not hold up the suite."""

    def hangs(*_: int | FrameType | None) -> None:
        raise AssertionError(f"not done within {PATIENCE_S} s")

    before = signal.signal(signal.SIGALRM, hangs)
    yield
    signal.alarm(0)
    signal.signal(signal.SIGALRM, before)


def bear(kind: Kind, path: Path) -> bool:
    """Whether a file is taken; what is refused is refused in one line that names it."""
    signal.alarm(PATIENCE_S)
    said = refusal(kind, path)
    assert "\n" not in said
    assert not said or path.parent.name in said or path.name in said
    return not said


def refusal(kind: Kind, path: Path) -> str:
    try:
        kind.read(path)
    except RoomloopError as refused:
        return str(refused)
    return ""


@pytest.mark.filterwarnings("ignore")
@pytest.mark.parametrize("name", KINDS)
def test_spoilt_files_are_read_or_refused_in_one_line(name: str, tmp_path: Path) -> None:
    kind, rng = KINDS[name], np.random.default_rng(7)
    path = kind.make(tmp_path)
    whole = path.read_bytes()
    assert bear(kind, path)
    before = peak_mb()
    contents = [*always(kind.text), *(spoilt(whole, rng) for _ in range(SAMPLES))]
    for content in contents:
        path.write_bytes(content)
        bear(kind, path)
    assert peak_mb() - before < MOST_MB


@pytest.mark.parametrize("name", KINDS)
def test_what_is_no_file_is_refused(name: str, tmp_path: Path) -> None:
    """Absent, a folder, a link to itself, a link to nowhere, a pipe, what never ends."""
    kind = KINDS[name]
    path = kind.make(tmp_path)
    hindrances: list[Callable[[], object]] = [
        lambda: None,
        path.mkdir,
        lambda: path.symlink_to(path),
        lambda: path.symlink_to(tmp_path / "nowhere"),
        lambda: os.mkfifo(path),
        lambda: path.symlink_to("/dev/zero"),
    ]
    optional = name == "page of truth.tum"  # a run without truth has none
    for place, hinder in enumerate(hindrances):
        path.rmdir() if path.is_dir() else path.unlink(missing_ok=True)
        hinder()
        assert not bear(kind, path) or (optional and place != 1)


@pytest.mark.parametrize(("name", "megabytes"), [("weights", 1500), ("labels", 20_000)])
def test_a_small_file_that_unpacks_to_gigabytes_is_refused(
    name: str, megabytes: int, tmp_path: Path
) -> None:
    kind = KINDS[name]
    path = kind.make(tmp_path)
    before = peak_mb()
    path.write_bytes(bomb(path.read_bytes(), megabytes))
    with pytest.raises(InputError, match="MB unpacked, at most"):
        kind.read(path)
    assert peak_mb() - before < MOST_MB
