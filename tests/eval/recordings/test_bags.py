"""Bags made here and read back, and where their truth comes from."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from bagfiles import SECONDS, Bag, cloud_of, drive, ring_of_points, shifted, timed_cloud
from packetfiles import encode, turning, write_packets

from eval.outputs import write_tum
from eval.recordings import RecordingOptions, open_recording, poses_at
from eval.score.trajectory import Trajectory
from slam.core import InputError


@pytest.mark.parametrize("kind", ["ros1", "sqlite3", "mcap"])
def test_a_bag_is_read_back(tmp_path: Path, kind: str) -> None:
    bag = Bag(drive(), odometry=[("/odom", 100.0 + 0.1 * i, shifted(i)) for i in range(5)])
    recording = open_recording(bag.write(tmp_path / "drive", kind))
    assert recording.count == 5
    assert recording.duration == pytest.approx(0.4, abs=1e-6)
    assert recording.truth is None  # odometry is no truth
    for _ in range(2):
        scans = list(recording)
        assert [scan.index for scan in scans] == list(range(5))
        assert [scan.stamp for scan in scans] == pytest.approx([100.0 + 0.1 * i for i in range(5)])
        assert scans[3].points[:, 0] - scans[0].points[:, 0] == pytest.approx(0.03, abs=1e-6)
        assert scans[0].times == pytest.approx(SECONDS - 0.1, abs=1e-7)
    assert recording.skipped == 0


@pytest.mark.parametrize(("kind", "pattern"), [("sqlite3", "*.db3"), ("mcap", "*.mcap")])
def test_a_bag_s_only_file_will_do(tmp_path: Path, kind: str, pattern: str) -> None:
    folder = Bag(drive()).write(tmp_path / "drive", kind)
    (file,) = folder.glob(pattern)
    assert len(list(open_recording(file))) == 5


def test_bad_scans_in_a_bag_are_skipped(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    nan = {name: np.full(360, np.nan, dtype=np.float32) for name in "xyz"}
    clouds = drive(4)
    clouds.insert(2, ("/points", 100.15, cloud_of(**nan)))
    clouds[3] = ("/points", 100.2, cloud_of(**ring_of_points(), t=np.full(360, 7, dtype=np.uint32)))
    bag = Bag(clouds)
    recording = open_recording(bag.write(tmp_path / "drive", "mcap"))
    assert len(list(recording)) == 4
    assert recording.skipped == 1
    assert "finite" in caplog.text


def test_stamps_that_run_backwards_are_skipped(tmp_path: Path) -> None:
    clouds = drive(4)
    path = Bag(clouds).write(tmp_path / "drive", "mcap")
    recording = open_recording(path)
    messages = recording._scans  # the third scan is delivered twice
    scans = list(messages())
    recording._scans = lambda: iter([*scans[:3], scans[1], scans[3]])
    assert [scan.stamp for scan in recording] == [scans[i].stamp for i in (0, 1, 2, 3)]
    assert recording.skipped == 1


def test_missing_times_are_said_once(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    clouds = [("/points", 100.0 + 0.1 * i, cloud_of(**ring_of_points())) for i in range(3)]
    scans = list(open_recording(Bag(clouds).write(tmp_path / "drive", "mcap")))
    assert caplog.text.count("without times") == 1
    assert caplog.text.count("without rings") == 1
    assert np.ptp(scans[2].times) == pytest.approx(0.1, rel=0.01)


def test_several_topics_need_a_choice(tmp_path: Path) -> None:
    clouds = [*drive(3), ("/rear", 100.05, timed_cloud())]
    path = Bag(clouds).write(tmp_path / "drive", "sqlite3")
    with pytest.raises(InputError, match="/points, /rear"):
        open_recording(path)
    with pytest.raises(InputError, match="/front: expected one of /points, /rear"):
        open_recording(path, RecordingOptions(topic="/front"))
    assert len(list(open_recording(path, RecordingOptions(topic="/rear")))) == 1


def test_a_bag_without_point_clouds_is_refused(tmp_path: Path) -> None:
    bag = Bag([], poses=[("/pose", 1.0, np.eye(4))])
    with pytest.raises(InputError, match="no sensor_msgs/PointCloud2 topic, it holds /pose"):
        open_recording(bag.write(tmp_path / "drive", "mcap"))


def test_a_bag_of_bad_scans_only_is_refused(tmp_path: Path) -> None:
    good = ring_of_points()
    clouds = [("/points", 1.0 + i, cloud_of(x=good["x"], y=good["y"])) for i in range(2)]
    recording = open_recording(Bag(clouds).write(tmp_path / "drive", "mcap"))
    with pytest.raises(InputError, match="no good scan in /points: .* expected x, y and z"):
        list(recording)
    assert recording.skipped == 2


@pytest.mark.parametrize("name", ["a.bag", "a.db3", "a.mcap"])
@pytest.mark.parametrize("keep", [0, 7, 600])
def test_damaged_bags_are_refused(tmp_path: Path, name: str, keep: int) -> None:
    kind = {"a.bag": "ros1", "a.db3": "sqlite3", "a.mcap": "mcap"}[name]
    bag = Bag(drive()).write(tmp_path / "drive", kind)
    source = bag if bag.is_file() else next(bag.glob(f"*{Path(name).suffix}"))
    path = tmp_path / name
    path.write_bytes(source.read_bytes()[:keep])
    with pytest.raises(InputError, match=name) as caught:
        list(open_recording(path))
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("word", ["odometry", "poses"])
def test_truth_comes_from_a_topic(tmp_path: Path, word: str) -> None:
    truth = [("/ground_truth", 99.95 + 0.1 * i, shifted(0.1 * i)) for i in range(6)]
    recording = open_recording(Bag(drive(), **{word: truth}).write(tmp_path / "drive", "mcap"))
    assert recording.truth is not None
    assert recording.truth.positions[:, 0] == pytest.approx(0.1 * np.arange(6))
    poses, known = poses_at(recording.truth, np.array([scan.stamp for scan in recording]))
    assert known.all()
    assert poses[:, 0, 3] == pytest.approx(0.05 + 0.1 * np.arange(5), abs=1e-6)


def test_truth_comes_from_a_file_or_a_named_topic(tmp_path: Path) -> None:
    bag = Bag(drive(), odometry=[("/odom", 100.0 + 0.1 * i, shifted(i)) for i in range(5)])
    path = bag.write(tmp_path / "drive", "mcap")
    named = open_recording(path, RecordingOptions(truth="/odom")).truth
    assert named is not None
    assert named.positions[:, 0] == pytest.approx(np.arange(5))
    with pytest.raises(InputError, match="/absent: expected a .tum file or one of: /odom"):
        open_recording(path, RecordingOptions(truth="/absent"))
    write_tum(Trajectory(np.array([100.0, 101.0]), np.array([np.eye(4)] * 2)), path / "truth.tum")
    beside = open_recording(path).truth
    assert beside is not None
    assert len(beside) == 2


def test_packets_take_truth_from_a_file_only(tmp_path: Path) -> None:
    path = write_packets(tmp_path / "a.bin", encode(*turning(1800)))
    write_tum(Trajectory(np.array([1.0, 1.2]), np.array([np.eye(4)] * 2)), tmp_path / "a.tum")
    truth = open_recording(path).truth
    assert truth is not None
    assert len(truth) == 2
    with pytest.raises(InputError, match="expected a .tum file"):
        open_recording(path, RecordingOptions(truth="/odom"))


def test_truth_is_not_made_up_across_gaps() -> None:
    truth = Trajectory(np.array([0.0, 1.0, 3.0]), np.array([shifted(x) for x in (0, 1, 3)]))
    _, known = poses_at(truth, np.array([-0.1, 0.5, 2.0, 3.5]), longest_gap=1.5)
    assert known.tolist() == [False, True, False, False]
    assert not poses_at(truth, np.array([100.0]))[1].any()
