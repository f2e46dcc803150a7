"""A drive recorded as a bag and run again: the same trajectory; with labels, the same scores."""

from __future__ import annotations

import dataclasses
import re
import shutil
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

from eval.config import RunConfig
from eval.metrics import Metrics
from eval.outputs import read_metrics, read_tum, write_tum
from eval.recordings import open_recording
from eval.recordings.bags import BagRecording
from eval.recordings.clouds import BadCloud
from eval.recordings.labels import LabelsFile
from eval.run import RunResult, run
from eval.score.trajectory import Trajectory
from eval.source import make_source, make_world
from slam.core import InputError, RunError, Scan

pytest.importorskip("rosbags")

ASKED = RunConfig("SE1", seed=3, duration=2.0)
MEASURED = ("startup_s", "wall_s", "real_time_factor", "stages", "peak_rss_mb")
ITS_OWN = ("scene", "scene_sha256", "sensor", "conditions", "seed")
RECORDINGS = Path(__file__).parents[3] / "shared" / "data" / "vlp16"


@pytest.fixture(scope="module")
def bag(tmp_path_factory: pytest.TempPathFactory) -> Path:
    from eval.recordings.record import record

    folder = tmp_path_factory.mktemp("bags") / "drive"
    assert record(ASKED, folder, labels=True) == 20
    return folder


@pytest.fixture(scope="module")
def live(tmp_path_factory: pytest.TempPathFactory) -> RunResult:
    return run(dataclasses.replace(ASKED, out=tmp_path_factory.mktemp("live")))


def again(bag: Path, out: Path, **options: object) -> RunResult:
    return run(RunConfig(str(bag), out=out / "run", **options))  # type: ignore[arg-type]


def scores(metrics: Metrics) -> dict[str, object]:
    """What a run scored, without what it measured of itself."""
    tree = dataclasses.asdict(metrics)
    return {name: tree[name] for name in tree.keys() - {*MEASURED, *ITS_OWN}}


def test_scans_come_back_to_the_bit(bag: Path) -> None:
    recording = open_recording(bag)
    drive = make_source(ASKED, make_world(ASKED))
    labels = LabelsFile(bag / "labels.npz")
    for read, (scan, truth) in zip(recording, drive, strict=True):
        for name in ("points", "times", "ring", "intensity", "T_base_lidar", "stamp", "index"):
            assert np.array_equal(getattr(read, name), getattr(scan, name)), name
        assert read.wheels is not None
        assert scan.wheels is not None
        assert read.wheels.T_odom_base == pytest.approx(scan.wheels.T_odom_base, abs=1e-12)
        assert np.array_equal(read.wheels.twist, scan.wheels.twist)
        for name in ("face", "geom", "points_world", "T_world_base"):
            assert np.array_equal(getattr(labels.at(scan.stamp), name), getattr(truth, name))
    assert recording.skipped == 0


def test_with_labels_a_recording_scores_as_the_live_run(
    bag: Path, live: RunResult, tmp_path: Path
) -> None:
    replayed = again(bag, tmp_path, truth=str(bag / "labels.npz"))
    assert scores(replayed.metrics) == scores(live.metrics)
    assert replayed.metrics.sensor is None
    for name in ("trajectory.tum", "odometry.tum", "truth.tum", "map.ply", "graph.json"):
        assert (replayed.folder / name).read_bytes() == (live.folder / name).read_bytes()


def test_bad_scans_of_a_recording_are_counted(
    bag: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    good = BagRecording._scans

    def spoiled(recording: BagRecording) -> Iterator[Scan | BadCloud]:
        for scan in good(recording):
            bad = isinstance(scan, Scan) and round(10 * scan.stamp) in (5, 6, 20)
            yield BadCloud("spoiled") if bad else scan

    monkeypatch.setattr(BagRecording, "_scans", spoiled)
    replayed = again(bag, tmp_path, detector="none")
    assert read_metrics(replayed.folder / "metrics.json").scans_skipped == 3
    assert len(read_tum(replayed.folder / "trajectory.tum")) == 17


def test_with_its_own_poses_a_recording_has_the_trajectory_s_scores(
    bag: Path, live: RunResult, tmp_path: Path
) -> None:
    replayed = again(bag, tmp_path)
    ours, theirs = replayed.metrics, live.metrics
    assert ours.ate_origin_m == pytest.approx(theirs.ate_origin_m, abs=1e-9)
    assert ours.path_m == pytest.approx(theirs.path_m, abs=1e-9)
    assert ours.planes.mapped == theirs.planes.mapped
    assert (ours.mma_m, ours.planes.mixed, ours.rooms.truth, ours.walls.truth) == (None,) * 4
    for name in ("trajectory.tum", "odometry.tum", "truth.tum", "map.ply"):
        assert (replayed.folder / name).read_bytes() == (live.folder / name).read_bytes()
    assert read_metrics(replayed.folder / "metrics.json").rooms == ours.rooms


def test_poses_for_a_part_of_the_way_are_scored_there(bag: Path, tmp_path: Path) -> None:
    recorded = open_recording(bag).truth
    assert recorded is not None
    half = Trajectory(recorded.stamps[:12], recorded.poses[:12])
    write_tum(half, tmp_path / "half.tum")
    replayed = again(bag, tmp_path, truth=str(tmp_path / "half.tum"), detector="none")
    assert len(read_tum(replayed.folder / "truth.tum")) == 12
    assert len(read_tum(replayed.folder / "trajectory.tum")) == 20
    assert replayed.metrics.path_m == pytest.approx(half.path_m, abs=1e-4)


@pytest.mark.parametrize("name", ["office_1000_packets.bin", "room_293_packets.pcap"])
def test_a_real_recording_runs_without_truth(name: str, tmp_path: Path) -> None:
    if not (RECORDINGS / name).is_file():
        pytest.skip(f"no recordings in {RECORDINGS}")
    metrics = again(RECORDINGS / name, tmp_path, detector="none").metrics
    assert metrics.status == "complete"
    known = {"planes", "rooms", "walls", "loops", "room_latency_s"}
    for key, value in scores(metrics).items():
        if key in known or key.startswith(("ate", "rpe", "mma", "first")):
            tree = dataclasses.asdict(getattr(metrics, key)) if key in known else {key: value}
            tree.pop("mapped", None)
            assert not any(v is not None for v in tree.values()), key
    assert metrics.planes.mapped is not None
    assert metrics.planes.mapped >= 4
    path = read_tum(tmp_path / "run" / "trajectory.tum").positions
    assert np.ptp(path, axis=0).max() < 0.05  # the sensor stood still
    assert not (tmp_path / "run" / "truth.tum").exists()


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"speed": 1.0}, "speed: .* is a recording"),
        ({"start": "Kitchen"}, "start: .* is a recording"),
        ({"storey": 0}, "storey: .* is a recording"),
        ({"closed": True}, "closed: .* is a recording"),
        ({"topic": "/rear"}, "/rear: expected one of /points"),
        ({"truth": "/odom"}, "/odom: expected a .tum file or one of: /ground_truth, /wheel"),
        ({"truth": "absent.npz"}, "absent.npz: "),
        ({"truth": "absent.tum"}, "absent.tum"),
    ],
)
def test_what_makes_no_sense_for_a_recording_is_refused(
    bag: Path, tmp_path: Path, options: dict[str, object], message: str
) -> None:
    with pytest.raises(InputError, match=message) as caught:
        again(bag, tmp_path, **options)
    assert "\n" not in str(caught.value)
    assert not (tmp_path / "run").exists()


def test_a_simulated_run_takes_no_recorded_truth(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="truth: is for recordings"):
        run(RunConfig("SE1", truth="a.tum", out=tmp_path / "run"))


def test_a_bag_is_never_written_over(bag: Path) -> None:
    from eval.recordings.record import record

    with pytest.raises(InputError, match=re.escape(f"{bag} exists, a new folder")):
        record(ASKED, bag)


def test_labels_of_another_drive_are_told(bag: Path, tmp_path: Path) -> None:
    labels = LabelsFile(bag / "labels.npz")
    with pytest.raises(InputError, match="no scan ends at 99"):
        labels.at(99.0)
    copy = tmp_path / "labels.npz"
    copy.write_bytes((bag / "labels.npz").read_bytes()[:5000])
    with pytest.raises(InputError, match="expected labels of a recorded drive"):
        LabelsFile(copy)


def test_a_recording_that_ends_in_nothing_but_sky_fails_in_one_line(tmp_path: Path) -> None:
    """A scan without a single return is skipped; a recording of only such is refused."""
    source = RECORDINGS / "room_293_packets.pcap"
    if not source.is_file():
        pytest.skip(f"no recordings in {RECORDINGS}")
    blind = bytearray(source.read_bytes())
    for place in range(len(blind) - 1):
        if blind[place : place + 2] == b"\xff\xee":
            blind[place + 4 : place + 100] = bytes(96)
    (tmp_path / "blind.pcap").write_bytes(blind)
    with pytest.raises((InputError, RunError), match="no whole sweep with a return"):
        again(tmp_path / "blind.pcap", tmp_path)


def test_the_command_records(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    from eval.cli import main

    out = tmp_path / "made" / "bag"
    assert main(["record", "SE1", "--duration", "0.3", "--out", str(out)]) == 0
    assert "3 scans" in capsys.readouterr().out
    assert len(list(open_recording(out))) == 3
    assert not (out / "labels.npz").exists()
    assert main(["record", "SE1", "--duration", "0.3", "--out", str(out)]) == 2
    assert main(["record", "SE1", "--sensor", "nosuch.toml"]) == 2
    shutil.rmtree(out)
