"""What watching costs: runs by turns, each in a process of its own."""

import pytest

from eval.bench import watching
from eval.bench.watching import WAYS, RunCost, by_turns, middle
from slam.core import RunError


def test_each_way_is_run_in_every_round_by_turns(tmp_path, monkeypatch):
    asked = []

    def cost(arguments, out, looked_at):
        asked.append((tuple(arguments), out, looked_at))
        return RunCost(float(len(asked)), 1.0, 0.0)

    monkeypatch.setattr(watching, "_cost", cost)
    monkeypatch.setattr(watching, "browser", lambda: "a browser")
    costs = by_turns(["SE1"], 2, tmp_path)
    assert [arguments[1:] for arguments, _, _ in asked] == list(WAYS.values()) * 2
    assert len({out for _, out, _ in asked}) == len(WAYS)
    assert [looked_at for _, _, looked_at in asked] == [False, False, False, True] * 2
    assert [run.wall for run in costs["headless"]] == [1.0, 5.0]


def test_without_a_browser_nobody_looks(tmp_path, monkeypatch):
    monkeypatch.setattr(watching, "_cost", lambda *_: RunCost(1.0, 1.0, 0.0))
    monkeypatch.setattr(watching, "browser", lambda: None)
    assert list(by_turns(["SE1"], 1, tmp_path)) == ["headless", "--save", "--serve"]


def test_the_middle_is_the_median():
    costs = [RunCost(1.0, 1.0, 0.0), RunCost(4.0, 1.0, 0.0)]
    assert middle([*costs, RunCost(9.0, 3.0, 2.0)]) == RunCost(4.0, 1.0, 0.0)


@pytest.mark.slow
def test_a_run_has_a_cost(tmp_path):
    arguments = ["SE1", "--duration", "2", "--detector", "none", "--save"]
    cost = watching._cost(arguments, tmp_path / "run")
    assert 0.0 < cost.wall < cost.processor
    assert cost.recording > 0.0


@pytest.mark.slow
def test_a_page_that_is_looked_at_has_a_cost(tmp_path):
    if watching.browser() is None:
        pytest.skip("no browser here")
    arguments = ["SE1", "--duration", "2", "--detector", "none", "--serve"]
    assert watching._cost(arguments, tmp_path / "run", looked_at=True).wall > 0.0


def test_a_run_that_does_not_say_where_its_page_is(tmp_path):
    with pytest.raises(RunError, match="watch at"):
        watching._cost(["nowhere"], tmp_path / "run", looked_at=True)


def test_a_run_that_fails_is_told_with_its_last_words(tmp_path):
    with pytest.raises(RunError, match="nowhere"):
        watching._cost(["nowhere"], tmp_path / "run")
