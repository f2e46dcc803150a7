"""The search for the baselines' parameters: what it takes, what it leaves, what it counts."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from eval.cli import main
from eval.studies import baseline_drives
from eval.studies.baseline_drives import Drive, drive_of, generated, hydra_rooms, sgraphs_rooms
from eval.studies.baseline_search import (
    HYDRA_AXES,
    SGRAPHS_AXES,
    Tally,
    changed,
    search,
    tally,
    value_at,
)
from semantics.hydra.config import PUBLISHED_V2, HydraConfig
from semantics.sgraphs.config import PUBLISHED
from slam.core import MapView, Proposals, RoomProposal

AXES = (("rooms.min_room", (3, 5, 10)), ("space.places.compression", (0.75, 1.5)))


def worth(config: HydraConfig) -> Tally:
    """Best at 5 places and cells of 0.75 m; the first counts for more."""
    right = 2.0 * (config.rooms.min_room == 5) + (config.space.places.compression == 0.75)
    return Tally(right, 4.0, right, 4)


def test_one_parameter_after_the_other_is_bettered() -> None:
    trials = list(search(PUBLISHED_V2, AXES, worth))
    assert [trial.change for trial in trials] == [
        "start",
        "rooms.min_room = 5",
        "space.places.compression = 0.75",
    ]
    assert [trial.worth.true for trial in trials] == [0.0, 2.0, 3.0]
    assert trials[-1].config == changed(
        changed(PUBLISHED_V2, "rooms.min_room", 5), "space.places.compression", 0.75
    )


def test_what_is_only_as_good_changes_nothing() -> None:
    trials = list(search(PUBLISHED_V2, AXES, lambda config: Tally(1.0, 2.0, 1.0, 2)))
    assert [trial.config for trial in trials] == [PUBLISHED_V2]


@pytest.mark.parametrize(("start", "axes"), [(PUBLISHED_V2, HYDRA_AXES), (PUBLISHED, SGRAPHS_AXES)])
def test_the_published_values_are_among_those_tried(start, axes) -> None:
    for path, values in axes:
        assert value_at(start, path) in values
        other = next(value for value in values if value != value_at(start, path))
        assert value_at(changed(start, path, other), path) == other


def test_counts_of_buildings_are_added_before_anything_is_divided() -> None:
    both = Tally(1.0, 1.0, 1.0, 4) + Tally(2.0, 3.0, 2.0, 2)
    assert (both.precision, both.recall) == (0.75, 0.5)
    assert both.f1 == pytest.approx(0.6)
    assert Tally().f1 == 0.0


def proposal(id: int, x: float, y: float) -> RoomProposal:
    return RoomProposal(id, (), None, np.array([x, y]), 1.0)


def test_rooms_count_by_their_centres(house) -> None:
    keeper = house.keeper(house.whole(0, 1, 2, 3))
    keeper.visits.entered.update({0: 0.0, 1: 1.0})
    drive = Drive("house", (MapView(0.0, (), ()),), keeper, np.eye(4))
    rooms = Proposals((proposal(0, 2.0, 1.5), proposal(1, 2.5, 1.5), proposal(2, 4.0, 4.0)))
    assert tally(drive, rooms) == Tally(2.0, 3.0, 1.0, 2)
    assert tally(drive, Proposals()) == Tally(entered=2)


@pytest.mark.slow
def test_a_building_is_driven_once_and_asked_often(tmp_path: Path, monkeypatch) -> None:
    plan = generated(22, tmp_path)
    drive, again = (drive_of(plan, "as-built", tmp_path) for _ in range(2))
    np.testing.assert_array_equal(drive.T_world_map, again.T_world_map)
    made = []
    known = baseline_drives.gvd_of
    monkeypatch.setattr(baseline_drives, "gvd_of", lambda *a: made.append(a) or known(*a))
    small = changed(PUBLISHED_V2, "rooms.min_component", 3)
    for hydra in (PUBLISHED_V2, small, changed(small, "rooms.min_room", 3)):
        hydra_rooms(drive, hydra)
    assert len(made) == 1
    found = tally(drive, hydra_rooms(drive, changed(small, "rooms.min_room", 3)))
    assert found.recalled >= 1
    rooms = sgraphs_rooms(drive, PUBLISHED)
    assert rooms.rooms
    assert {piece.plane_id for room in rooms.rooms for piece in room.pieces} <= {
        plane.id for plane in drive.views[-1].planes
    }


def test_the_command_knows_two_methods(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def found(methods: tuple[str, ...], cache: Path) -> list[str]:
        return [f"{','.join(methods)} in {cache.name}\n"]

    monkeypatch.setattr("eval.studies.baseline_search.searches", found)
    line = ["bench", "baselines", "--cache", str(tmp_path / "drives")]
    assert main(line) == 0
    assert main([*line, "--only", "sgraphs"]) == 0
    assert capsys.readouterr().out == "hydra,sgraphs in drives\nsgraphs in drives\n"
    assert main([*line, "--only", "hydr"]) == 2
    assert "expected one of: hydra, sgraphs" in capsys.readouterr().err
