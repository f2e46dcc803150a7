"""Recordings that cannot be opened: one line that says why."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest

from eval.commands.view import view
from eval.view.recorder import Recorder
from eval.view.recordings import check_recording, recording_of
from eval.view.targets import FileTarget
from slam.core import InputError


def test_no_such_run(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="nowhere: no such run; expected its folder"):
        view(tmp_path / "nowhere")


def test_a_run_without_a_recording(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="holds no recording.rrd; run it again with --save"):
        view(tmp_path)


@pytest.mark.parametrize("content", [b"", b"PK", b"not a recording"])
def test_a_foreign_file(tmp_path: Path, content: bytes) -> None:
    path = tmp_path / "recording.rrd"
    path.write_bytes(content)
    with pytest.raises(InputError, match="not a rerun recording"):
        view(tmp_path)


def test_whole_and_cut_off(tmp_path: Path, play: Callable[..., None]) -> None:
    path = tmp_path / "recording.rrd"
    play(Recorder(FileTarget(path)))
    assert recording_of(tmp_path) == recording_of(path) == path
    check_recording(path)
    path.write_bytes(path.read_bytes()[: path.stat().st_size // 2])
    with pytest.raises(InputError, match="cut off, or written by another version of rerun"):
        view(tmp_path)
