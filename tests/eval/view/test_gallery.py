"""Pictures of runs: each by its name, and one that cannot be made stops no other."""

from __future__ import annotations

import io
from pathlib import Path

import numpy as np
import pytest

from eval.cli import main
from eval.commands import gallery
from eval.config import RunConfig
from eval.folder import config_text
from eval.outputs import write_tum
from eval.report import run as report
from eval.score.trajectory import Trajectory
from eval.view import recordings, shots
from eval.view.shots import Shot
from eval.view.viewers import ViewerError


def png() -> bytes:
    from PIL import Image

    out = io.BytesIO()
    Image.new("RGB", (3000, 20), "red").save(out, "PNG")
    return out.getvalue()


@pytest.fixture
def run(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A run's folder, as far as pictures of it need it."""
    folder = tmp_path / "run"
    folder.mkdir()
    (folder / "config.json").write_text(config_text(RunConfig("plans/office.json")))
    (folder / "recording.rrd").write_bytes(b"RRF")
    (folder / "plan.png").write_bytes(png())
    write_tum(
        Trajectory(np.arange(11.0), np.tile(np.eye(4), (11, 1, 1))), folder / "trajectory.tum"
    )
    monkeypatch.setattr(recordings, "check_recording", lambda path: None)
    monkeypatch.setattr(report, "write_report", lambda folder: folder / "report.html")
    monkeypatch.setattr("eval.report.photo.photograph", lambda address, size: png())
    return folder


def test_pictures_of_moments_of_the_plan_and_of_the_page(
    run: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    from PIL import Image

    asked: list[Shot] = []

    def take(recording: Path, wanted: list[Shot]) -> list[bytes]:
        asked.extend(wanted)
        return [png() for _ in wanted]

    monkeypatch.setattr(shots, "take", take)
    assert main(["gallery", str(run), "--out", str(tmp_path / "out")]) == 0
    names = {path.name for path in (tmp_path / "out").iterdir()}
    graphs = {f"office-graph-{i}.png" for i in range(1, len(gallery.MOMENTS) + 1)}
    assert names == graphs | {"office-view.png", "office-plan.png", "office-report.png"}
    moments = [shot.moment for shot in asked if shot.view == "Scene graph"]
    assert moments == pytest.approx([10.0 * share for share in gallery.MOMENTS])
    assert Image.open(tmp_path / "out" / "office-plan.png").size == (1400, 9)


def test_one_that_cannot_be_made_is_said(
    run: Path,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    def take(*_: object) -> list[bytes]:
        raise ViewerError("no graphics driver")

    monkeypatch.setattr(shots, "take", take)
    assert main(["gallery", str(run), "--out", str(tmp_path / "out")]) == 0
    said = capsys.readouterr().out
    assert "left out: no graphics driver" in said
    assert {path.name for path in (tmp_path / "out").iterdir()} == {
        "office-plan.png",
        "office-report.png",
    }
