"""What watching costs: runs by turns, each in a process of its own."""

import pytest

from eval import watchcost
from eval.watchcost import WAYS, RunCost, by_turns, middle
from slam.core import RunError


def test_each_way_is_run_in_every_round_by_turns(tmp_path, monkeypatch):
    asked = []

    def cost(arguments, out):
        asked.append((tuple(arguments), out))
        return RunCost(float(len(asked)), 1.0, 0.0)

    monkeypatch.setattr(watchcost, "_cost", cost)
    costs = by_turns(["SE1"], 2, tmp_path)
    assert [arguments[1:] for arguments, _ in asked] == list(WAYS.values()) * 2
    assert len({out for _, out in asked}) == len(WAYS)
    assert [run.wall for run in costs["headless"]] == [1.0, 4.0]
    assert middle([*costs["headless"], RunCost(9.0, 3.0, 2.0)]) == RunCost(4.0, 1.0, 0.0)


@pytest.mark.slow
def test_a_run_has_a_cost(tmp_path):
    arguments = ["SE1", "--duration", "2", "--detector", "none", "--save"]
    cost = watchcost._cost(arguments, tmp_path / "run")
    assert 0.0 < cost.wall < cost.processor
    assert cost.recording > 0.0


def test_a_run_that_fails_is_told_with_its_last_words(tmp_path):
    with pytest.raises(RunError, match="nowhere"):
        watchcost._cost(["nowhere"], tmp_path / "run")
