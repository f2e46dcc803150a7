"""``roomloop calibrate`` and ``roomloop bench sensor``: their tables, files and refusals."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from eval.bench.sensor import time_sweeps
from eval.cli import main
from eval.config import RunConfig
from eval.source import make_world
from eval.studies.calibration import compare, sensor_text
from sim.calibration.beams import Calibration
from sim.sensorfile import sensor_named
from slam.core import InputError

ROOM = Path(__file__).parents[3] / "shared" / "data" / "vlp16" / "room_293_packets.pcap"
needs_room = pytest.mark.skipif(not ROOM.is_file(), reason=f"no recording {ROOM.name}")


@needs_room
def test_the_command_compares_and_writes_a_sensor_that_can_be_read(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    picture, file = tmp_path / "room.png", tmp_path / "unit.toml"
    asked = ["calibrate", str(ROOM), "--out", str(picture), "--toml", str(file)]
    assert main(asked) == 0
    printed = capsys.readouterr().out
    assert "no return" in printed
    assert len([line for line in printed.splitlines() if line.strip()[:2].strip().isdigit()]) == 16
    assert picture.read_bytes()[:4] == b"\x89PNG"
    unit = sensor_named(str(file))
    assert unit.name == "unit"
    assert np.std(unit.range_offsets) > 0.004
    assert 0.005 < np.median(unit.range_noise) < 0.008


def test_a_sensor_s_text_fills_what_is_not_known() -> None:
    nan = np.nan
    table = np.array([nan, 0.01, -0.01])
    found = Calibration(
        offset=table,
        spread=abs(table),
        noise=np.array([nan, 0.004, 0.006]),
        dropout=np.array([nan, 0.01, 0.03]),
        lost=np.zeros(3),
        points=np.array([0, 900, 900]),
        planes=np.zeros((1, 4)),
        dropout_by_cosine=np.zeros(5),
        mixed=0.1,
    )
    text = sensor_text(found, sensor_named("vlp16"), "a.pcap")
    assert "range_offsets_mm = [0.0, 10.0, -10.0]" in text
    assert "range_noise_mm = [5.0, 4.0, 6.0]" in text
    assert "dropout = 0.0200" in text


def test_what_cannot_be_calibrated_is_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="absent.pcap: no such file"):
        compare(tmp_path / "absent.pcap", sensor_named("vlp16"))
    foreign = tmp_path / "foreign.pcap"
    foreign.write_bytes(b"GIF89a" + bytes(5000))
    with pytest.raises(InputError, match="foreign.pcap: no VLP-16 data packet"):
        compare(foreign, sensor_named("vlp16"))


@needs_room
def test_a_sensor_with_other_beams_cannot_take_the_place() -> None:
    with pytest.raises(InputError, match="os1-32 has 32 beams, the recording 16"):
        compare(ROOM, sensor_named("os1-32"))


def test_the_bench_times_what_it_says() -> None:
    times = time_sweeps("SE1", make_world(RunConfig("SE1")), sensor_named("ideal"), 3, 1)
    assert (times.rays, times.threads) == (28_800, 1)
    assert times.sweep_ms > times.cast_ms * 0.5 > 0.0
    assert times.sweep_p95_ms >= times.sweep_ms
    assert times.ratio == times.cast_ms / times.embree_ms


def test_the_bench_command_prints_a_table(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["bench", "sensor", "SE1", "--sweeps", "2"]) == 0
    printed = capsys.readouterr().out
    assert "SE1" in printed
    assert main(["bench", "sensor", "SE1", "--sweeps", "0"]) == 2
