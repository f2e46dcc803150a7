"""Detectors and odometries are found by name, ours and a user's."""

from __future__ import annotations

import sys
from pathlib import Path

import pytest

from eval.detectors import DETECTORS, ODOMETRIES, make_detector, make_odometry
from slam.core import InputError, MapView, Proposals

VIEW = MapView(0.0, (), ())

USERS_MODULE = """
from slam.core import Proposals, RoomProposal
import numpy as np

class Finder:
    def update(self, view):
        return Proposals((RoomProposal(1, (), None, np.zeros(2), 1.0),))

class Needy(Finder):
    def __init__(self, threshold):
        pass

class Mute:
    pass

number = 3
"""


@pytest.fixture
def users_module(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> str:
    (tmp_path / "users_rooms.py").write_text(USERS_MODULE)
    (tmp_path / "users_broken.py").write_text("import nothing_of_this_name")
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sys, "path", [*sys.path])
    return "users_rooms"


@pytest.mark.parametrize("name", sorted(DETECTORS.keys() - {"oracle"}))
def test_every_detector_of_ours_is_made_anew_and_finds_nothing_in_nothing(name: str) -> None:
    first, second = make_detector(name), make_detector(name)
    assert first is not second
    assert first.update(VIEW) == Proposals()


def test_the_oracle_needs_the_truth() -> None:
    with pytest.raises(InputError, match="oracle"):
        make_detector("oracle")


@pytest.mark.parametrize("name", ODOMETRIES)
def test_every_odometry_of_ours_is_made_anew(name: str) -> None:
    assert make_odometry(name) is not make_odometry(name)


def test_a_users_detector_is_found_in_the_working_folder(users_module: str) -> None:
    proposals = make_detector(f"{users_module}:Finder").update(VIEW)
    assert [room.id for room in proposals.rooms] == [1]


@pytest.mark.parametrize(
    ("name", "expected"),
    [
        ("users_rooms:Absent", "users_rooms has no class 'Absent'"),
        ("users_rooms:number", "users_rooms has no class 'number'"),
        ("users_rooms:Mute", r"has no method update\(\)"),
        ("users_rooms:Needy", "cannot be made without arguments"),
        ("users_absent:Finder", "importing users_absent failed"),
        ("users_broken:Finder", "importing users_broken failed.*nothing_of_this_name"),
        ("users_rooms:", "expected package.module:Class"),
        ("gnm", "unknown name 'gnm'"),
    ],
)
def test_a_detector_that_cannot_be_used_is_refused_in_one_line(
    users_module: str, name: str, expected: str
) -> None:
    with pytest.raises(InputError, match=f"detector: .*{expected}|detector: {expected}") as caught:
        make_detector(name)
    assert "\n" not in str(caught.value)


def test_an_odometry_needs_its_own_method(users_module: str) -> None:
    with pytest.raises(InputError, match=r"odometry: .*has no method register\(\)"):
        make_odometry(f"{users_module}:Finder")
