"""The picture of a run shows what it should, and is a whole file."""

from __future__ import annotations

import dataclasses
from pathlib import Path

import numpy as np
import pytest

from eval.picture import FALSE, TRUE, UNJUDGED, RunPicture, run_figure, save
from eval.score.trajectory import Trajectory
from slam.core import InputError, Proposals, RoomProposal, inverse


@pytest.fixture
def picture(house) -> RunPicture:
    poses = house.drive([(1.0, 1.0), (3.0, 1.0), (3.0, 2.0), (6.0, 2.0)])
    T_map_world = inverse(poses[0])
    true = Trajectory(0.1 * np.arange(len(poses)), poses)
    estimate = Trajectory(true.stamps, T_map_world @ poses)
    outline = np.array([[0, 0], [4, 0], [4, 3], [0, 3.0]]) - 1.0
    rooms = tuple(RoomProposal(i, (), outline + 4.1 * i, outline.mean(axis=0), 1.0) for i in (0, 1))
    pair = house.scan(0, 0.0, (2.0, 1.5, 0.0), house.whole(0))
    plane = house.plane(0, pair, house.whole(0), T_map_world=T_map_world)
    return RunPicture(
        title="house",
        truth=house.truth,
        true_path=true,
        estimate=estimate,
        odometry=estimate,
        T_world_map=poses[0],
        T_world_odom=poses[0],
        planes=(plane,),
        proposals=Proposals(rooms),
        matches={0: 0},
        entered=frozenset({0, 1}),
    )


def lines(picture: RunPicture, label: str) -> list[np.ndarray]:
    axes = run_figure(picture).axes[0]
    return [line.get_xydata() for line in axes.lines if line.get_label() == label]


def test_everything_lies_over_the_truth(picture: RunPicture) -> None:
    true, estimate = lines(picture, "true path")[0], lines(picture, "estimate")[0]
    assert np.allclose(true, estimate)
    assert np.allclose(true[0], [1.0, 1.0])
    plane = lines(picture, "mapped planes")[0]
    assert np.allclose(plane[:, 1], 0.0, atol=1e-6)
    room = lines(picture, "detected, true")[0]
    assert np.allclose(room[:2], [[0, 0], [4, 0]])


def test_true_false_and_missed_rooms_are_told_apart(picture: RunPicture) -> None:
    axes = run_figure(picture).axes[0]
    colors = {line.get_label(): line.get_color() for line in axes.lines}
    assert (colors["detected, true"], colors["detected, false"]) == (TRUE, FALSE)
    texts = [text.get_text() for text in axes.texts]
    assert texts == ["A", "B (missed)", "C"]  # C was not entered
    assert axes.get_xlabel() == "x [m]"


def test_rooms_that_nobody_judged_are_neither_true_nor_false(picture: RunPicture) -> None:
    unjudged = dataclasses.replace(picture, matches={}, entered=frozenset(), judged=False)
    axes = run_figure(unjudged).axes[0]
    colors = {line.get_label(): line.get_color() for line in axes.lines}
    assert colors["detected"] == UNJUDGED
    assert not {"detected, true", "detected, false"} & colors.keys()
    assert [text.get_text() for text in axes.texts] == ["A", "B", "C"]


def test_a_legend_entry_for_each_thing(picture: RunPicture) -> None:
    (legend,) = run_figure(picture).legends
    names = [text.get_text() for text in legend.get_texts()]
    assert len(names) == len(set(names))
    wanted = {"true rooms", "true faces", "mapped planes", "true path", "estimate", "odometry"}
    assert wanted | {"detected, true", "detected, false", "entered, missed"} <= set(names)


def test_the_file_is_whole_or_absent(picture: RunPicture, tmp_path: Path) -> None:
    path = tmp_path / "plan.png"
    save(picture, path)
    assert path.read_bytes()[:8] == b"\x89PNG\r\n\x1a\n"
    assert [p.name for p in tmp_path.iterdir()] == ["plan.png"]
    with pytest.raises(InputError, match="cannot be written"):
        save(picture, tmp_path / "absent" / "plan.png")
