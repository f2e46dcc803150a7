import dataclasses
import json
from functools import partial

import numpy as np
import pytest
from typer.testing import CliRunner

from eval.bench.pace import pace, stage_times
from eval.cli import app, main
from eval.studies.odometry import (
    StudyCase,
    StudyFile,
    StudyRow,
    cases,
    drive,
    study,
    summaries,
)
from slam.core import InputError, RunError, inverse


class Truthful:
    """Gives the true poses of a drive, in the frame of the first one."""

    def __init__(self, case):
        poses = np.array([truth.T_world_base for _, truth in drive(case)])
        self._poses = inverse(poses[0]) @ poses

    def register(self, scan):
        return self._poses[scan.index]


class Lost(Truthful):
    """Loses track at two seconds."""

    def register(self, scan):
        if scan.stamp > 1.95:
            raise RunError("lost")
        return super().register(scan)


class Jumping(Truthful):
    """Is a metre off from one and a half seconds on."""

    def register(self, scan):
        T = super().register(scan).copy()
        T[0, 3] += 1.0 if scan.stamp > 1.45 else 0.0
        return T


class Standing:
    """Says that the base never moves."""

    def register(self, scan):
        return np.eye(4)


CASE = StudyCase("generated-3", seed=5, duration=4.0)


def test_odometries_are_compared_on_the_same_scans():
    odometries = {"exact": Truthful, "lost": Lost, "jumping": Jumping}
    exact, lost, jumping = study(CASE, {n: partial(o, CASE) for n, o in odometries.items()})
    assert (exact.odometry, lost.odometry) == ("exact", "lost")
    assert exact.diverged_s is None
    assert exact.rpe_percent == pytest.approx(0.0, abs=1e-3)
    assert lost.diverged_s == pytest.approx(2.0)
    assert jumping.diverged_s == pytest.approx(1.5)
    assert 0.0 < lost.path_m < exact.path_m
    assert exact.case is CASE


def test_every_combination_is_a_case():
    made = cases(["SE1", "generated-1"], [0, 1], ["vlp16"], [0.5, 1.0], [0.6, 1.2], 60.0)
    assert len(made) == len(set(made)) == 16
    assert {case.duration for case in made} == {60.0}


def row(ate, diverged_s=None, name="kiss"):
    return StudyRow(CASE, name, ate, ate, ate, 0.1, 0.1, 10.0, 5.0, diverged_s)


def test_a_lost_drive_counts_as_lost_and_not_in_the_mean():
    kiss, other = summaries([row(0.02), row(0.06), row(9.0, 12.0), row(None, None, "other")])
    assert (kiss.mean, kiss.worst) == (pytest.approx(0.04), 0.06)
    assert (kiss.drives, kiss.diverged) == (3, 1)
    assert (other.mean, other.worst) == (None, None)


def test_the_command_prints_a_table_and_writes_its_rows(tmp_path):
    out = tmp_path / "rows.json"
    line = ["bench", "odometry", "generated-3", "--duration", "1", "--out", str(out)]
    line += ["--kiss", "voxel_size=0.5,threads=1", "--odometry", "kiss-wheels"]
    done = CliRunner().invoke(app, line)
    assert done.exit_code == 0, done.output
    assert "voxel_size=0.5,threads=1" in done.output
    rows = json.loads(out.read_text())["rows"]
    assert [r["odometry"] for r in rows] == ["kiss-wheels", "voxel_size=0.5,threads=1"]
    assert rows[0]["case"]["scene"] == "generated-3"


def test_a_study_goes_on_where_it_was_stopped(tmp_path):
    path = tmp_path / "rows.json"
    StudyFile(path).add([row(0.02), row(None, 3.0, "vgicp")])
    again = StudyFile(path)
    assert again.rows == [row(0.02), row(None, 3.0, "vgicp")]
    assert again.missing(CASE, ["vgicp", "kiss", "other"]) == ["other"]
    assert again.missing(dataclasses.replace(CASE, seed=6), ["kiss"]) == ["kiss"]


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ('{"code": "1234", "rows": []}', "rows of other code"),
        ("[]", "no rows of"),
        ('{"code": "1", "rows": [{"case": {}}]}', "no rows of"),
        ("{", "no rows of"),
    ],
)
def test_a_file_that_is_no_study_is_refused(tmp_path, text, says):
    path = tmp_path / "rows.json"
    path.write_text(text)
    with pytest.raises(InputError, match=says):
        StudyFile(path)


@pytest.mark.parametrize("ahead", [False, True])
def test_the_pace_counts_every_scan_but_the_first(ahead):
    found = pace(StudyCase("generated-3", duration=1.0), Standing, ahead)
    assert (found.scans, found.ahead) == (9, ahead)
    assert found.waiting + found.odometry <= found.wall
    assert found.factor == pytest.approx(100.0 / found.wall)


def test_the_odometry_stage_and_the_other_odometry_are_given_the_same_scans():
    case, given = StudyCase("generated-3", duration=0.5), []

    class Noting(Standing):
        def register(self, scan):
            given.append(scan.index)
            return super().register(scan)

    found = stage_times(case, Noting, Noting)
    assert given == [0, 0, 1, 1, 2, 2, 3, 3, 4, 4]
    assert found.scans == 5
    assert found.stage > found.other > 0.0
    assert found.ratio == found.stage / found.other


def test_a_pace_needs_two_sweeps():
    with pytest.raises(InputError, match="at least two sweeps"):
        pace(StudyCase("generated-3", duration=0.1), Standing, False)


@pytest.mark.parametrize(
    ("options", "says"),
    [
        (["generated-3", "--kiss", "voxels=1"], "kiss: unknown name 'voxels'"),
        (["generated-3", "--kiss", "voxel_size=big"], "voxel_size: expected a number, got 'big'"),
        (["generated-3", "--odometry", "kis"], "odometry: unknown name 'kis'"),
        (["generated-3", "--speed", "0"], "speed is 0.0, expected more than 0"),
        (["generated-3", "--sensor", "vlp61"], "unknown sensor 'vlp61'"),
        (["SE999"], 'scene "SE999": unknown'),
    ],
)
def test_bad_input_is_one_line(options, says, capsys):
    assert main(["bench", "odometry", *options]) == 2
    error = capsys.readouterr().err
    assert says in error
    assert error.count("\n") == 1
