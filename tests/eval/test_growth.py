import numpy as np
import pytest

from eval.growth import GrowthConfig, growth, observations


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
    blocks = found.blocks(4)
    assert [block.rooms for block in blocks] == [4, 8]
    assert blocks[1].planes > blocks[0].planes > 8
    assert blocks[0].graph_ms == pytest.approx(np.median(found.graph_ms[found.rooms <= 4]))
    assert blocks[0].detector_ms == 0.0
