"""The recorded front end: a replay is the run itself, and is named by all that it depends on."""

import dataclasses

import numpy as np
import pytest

from eval.artefact import Replay, artefact_path, front_end_key, recorded, write_steps
from eval.config import RunConfig
from eval.outputs import read_tum
from eval.run import run
from slam.core import InputError, RunError

SECONDS = 6.0
TIMES = {
    *("startup_s", "wall_s", "real_time_factor", "stages", "peak_rss_mb"),
    *("first_room_s", "room_latency_s"),  # inference time included
}


@pytest.fixture(scope="module")
def runs(tmp_path_factory):
    """The same run live, recorded, and replayed."""
    folder = tmp_path_factory.mktemp("cache")
    config = RunConfig("SE1", seed=3, duration=SECONDS)
    recording = dataclasses.replace(config, cache=folder / "cache")
    configs = {"live": config, "recorded": recording, "replayed": recording}
    return {
        name: run(dataclasses.replace(config, out=folder / name))
        for name, config in configs.items()
    }


def facts(metrics):
    return {k: v for k, v in dataclasses.asdict(metrics).items() if k not in TIMES}


def test_a_replay_is_equal_to_the_live_run(runs):
    live = runs["live"]
    for name in ("recorded", "replayed"):
        other = runs[name]
        assert facts(other.metrics) == facts(live.metrics)
        for file in ("trajectory.tum", "odometry.tum", "truth.tum", "graph.json", "map.ply"):
            assert (other.folder / file).read_bytes() == (live.folder / file).read_bytes(), file


def test_a_replay_claims_no_times_that_it_did_not_measure(runs):
    replayed, recorded_run = runs["replayed"].metrics, runs["recorded"].metrics
    assert recorded_run.wall_s > 0.0
    assert replayed.wall_s is None
    assert replayed.real_time_factor is None
    assert replayed.stages.lidar.total_s is None
    assert replayed.stages.graph.total_s > 0.0


def test_variants_of_the_back_end_share_one_file(runs, tmp_path):
    cache = runs["recorded"].folder.parent / "cache"
    config = RunConfig("SE1", seed=3, duration=SECONDS, cache=cache, detector="oracle")
    variant = dataclasses.replace(config, layers="planes", factors="paper", loops="off")
    result = run(dataclasses.replace(variant, out=tmp_path / "variant"))
    assert result.metrics.wall_s is None
    assert len(list(cache.iterdir())) == 1


def test_informative_factors_move_the_path_and_published_ones_do_not(runs, tmp_path):
    cache = runs["recorded"].folder.parent / "cache"
    base = RunConfig("SE1", seed=3, duration=SECONDS, cache=cache, detector="oracle", loops="off")

    def path(layers, factors):
        config = dataclasses.replace(base, layers=layers, factors=factors)
        folder = run(dataclasses.replace(config, out=tmp_path / f"{layers}-{factors}")).folder
        return read_tum(folder / "trajectory.tum").poses[:, :3, 3]

    planes = path("planes", "paper")
    assert np.abs(path("rooms+walls", "paper") - planes).max() < 1e-5
    assert np.abs(path("rooms+walls", "informative") - planes).max() > 3e-5


def test_the_key_tells_front_ends_apart():
    base = RunConfig("SE1", seed=3, duration=SECONDS)
    same = dataclasses.replace(base, detector="none", layers="rooms", loops="off", save=True)
    assert front_end_key(same) == front_end_key(base)
    others = [
        dataclasses.replace(base, **{name: value})
        for name, value in (
            *(("seed", 4), ("duration", 5.0), ("speed", 1.0), ("storey", 0), ("sensor", "ideal")),
            *(("conditions", "ideal"), ("odometry", "vgicp")),
        )
    ]
    assert len({front_end_key(config) for config in (base, *others)}) == 1 + len(others)


def test_the_scene_counts_by_its_content(tmp_path):
    from worlds.catalogue import scene_path

    copy = tmp_path / "other.json"
    copy.write_bytes(scene_path("SE1").read_bytes())
    named, by_path = RunConfig("SE1"), RunConfig(str(copy))
    assert front_end_key(named) == front_end_key(by_path)
    copy.write_bytes(scene_path("SE1").read_bytes() + b"\n")
    assert front_end_key(named) != front_end_key(by_path)


def test_whole_scans_are_not_kept_so_a_recording_runs_live(tmp_path):
    config = RunConfig("SE1", cache=tmp_path)
    assert artefact_path(config) is not None
    assert artefact_path(dataclasses.replace(config, save=True)) is None
    assert artefact_path(RunConfig("SE1")) is None


def test_a_failure_is_replayed_and_a_stop_leaves_nothing(runs, tmp_path):
    steps = list(Replay(next((runs["recorded"].folder.parent / "cache").iterdir())))[:5]

    def ends_with(error):
        yield from steps
        raise error

    with pytest.raises(RunError, match="touched"):
        list(recorded(ends_with(RunError("the base touched a wall")), tmp_path / "failed.npz"))
    taken = []
    with pytest.raises(RunError, match="touched a wall"):
        taken.extend(iter(Replay(tmp_path / "failed.npz")))
    with pytest.raises(KeyboardInterrupt):
        list(recorded(ends_with(KeyboardInterrupt()), tmp_path / "stopped.npz"))
    stopped = recorded(iter(steps), tmp_path / "stopped.npz")
    next(stopped)
    stopped.close()
    assert not (tmp_path / "stopped.npz").exists()


def test_steps_survive_the_file_to_the_bit(runs, tmp_path):
    steps = list(Replay(next((runs["recorded"].folder.parent / "cache").iterdir())))
    first = steps[0].frame
    assert first.keyframe is not None
    assert first.keyframe.plumb is not None
    no_walls = dataclasses.replace(first.keyframe, plumb=None)
    steps.append(dataclasses.replace(steps[0], frame=dataclasses.replace(first, keyframe=no_walls)))
    write_steps(steps, "", tmp_path / "again.npz")
    for one, other in zip(steps, Replay(tmp_path / "again.npz"), strict=True):
        assert_same(one, other)
    assert sum(step.frame.keyframe is not None for step in steps) >= 2


def assert_same(one, other):
    if isinstance(one, np.ndarray):
        assert one.dtype == other.dtype
        assert np.array_equal(one, other, equal_nan=one.dtype.kind == "f")
    elif dataclasses.is_dataclass(one):
        for item in dataclasses.fields(one):
            assert_same(getattr(one, item.name), getattr(other, item.name))
    elif isinstance(one, tuple):
        assert len(one) == len(other)
        for a, b in zip(one, other, strict=True):
            assert_same(a, b)
    else:
        assert one == other


def test_nothing_recorded_is_a_file_too(tmp_path):
    with pytest.raises(RunError):
        list(recorded(_lost(), tmp_path / "none.npz"))
    replay = Replay(tmp_path / "none.npz")
    assert replay.duration == 0.0
    with pytest.raises(RunError, match="lost"):
        list(replay)


def _lost():
    raise RunError("the odometry is lost")
    yield


@pytest.mark.parametrize("content", [b"", b"no archive", b"PK\x03\x04cut off"])
def test_a_broken_file_is_named(tmp_path, content):
    path = tmp_path / "broken.npz"
    path.write_bytes(content)
    with pytest.raises(InputError, match=r"broken\.npz.*delete it"):
        Replay(path)


def test_a_file_that_lacks_an_array_is_named(tmp_path):
    write_steps([], "", tmp_path / "steps.npz")
    with np.load(tmp_path / "steps.npz") as file:
        arrays = {name: file[name] for name in file.files if name != "normal"}
    np.savez(tmp_path / "steps.npz", **arrays)
    with pytest.raises(InputError, match=r"steps.npz: .* with normal; delete it"):
        Replay(tmp_path / "steps.npz")
