import numpy as np
import pytest

from eval.bench.growth import Growth, GrowthConfig, growth, observations
from eval.cli import main


def places(frames):
    """Of keyframes from the lowest of them, in no order: a room may be crossed either way."""
    found = np.array([frame.T_odom_base[:2, 3] for frame, _ in frames]).round(6)
    found -= found.min(axis=0)
    return found[np.lexsort(found.T)]


def test_a_block_of_buildings_comes_again_and_again():
    config = GrowthConfig(block=4, turn=0.0, slip=0.0)
    frames = list(observations(8, np.random.default_rng(3), config))
    first, again = (
        places(frame for frame in frames if (frame[1] - 1) // 4 == block) for block in (0, 1)
    )
    assert len(first) > 8
    assert again == pytest.approx(first, abs=1e-5)


def test_planes_and_rooms_grow_and_each_block_has_its_medians():
    found = growth(8, seed=1, config=GrowthConfig(block=4))
    blocks = found.blocks()
    assert [block.rooms for block in blocks] == [4, 8]
    assert blocks[1].planes > blocks[0].planes > 8
    assert blocks[0].graph_ms == pytest.approx(np.median(found.graph_ms[found.rooms <= 4]))
    assert blocks[0].detector_ms == 0.0


@pytest.mark.parametrize("rooms", ["50", "120", "-1"])
def test_the_command_goes_through_whole_blocks(rooms, capsys):
    assert main(["bench", "growth", "--rooms", rooms]) == 2
    assert "expected 100, 150 and so on" in capsys.readouterr().err


def test_the_command_prints_the_growth(monkeypatch, capsys):
    def measured(rooms, seed, detector, progress):
        count = np.arange(1.0, rooms + 1.0)
        return Growth(count, 2.0 * count, count, count, 300.0 + count, 50)

    monkeypatch.setattr("eval.bench.growth.growth", measured)
    assert main(["bench", "growth", "--rooms", "150"]) == 0
    out = capsys.readouterr().out
    assert "back end 4.92x, detector 4.92x" in out
    assert [line.split()[:3] for line in out.splitlines() if "450" in line] == [
        ["150", "150", "251.0"]
    ]
