import numpy as np
import pytest

from slam.core import pose, so3_exp, transform_points
from slam.support import Chunk, Told


def chunk(rng, keyframe):
    count = int(rng.integers(1, 90))
    ids = rng.integers(1 << 40, size=count)
    return Chunk(keyframe, rng.normal(size=(count, 3)), ids, rng.random(count) < 0.6)


def test_what_is_told_is_where_the_keyframes_are_and_what_was_told_stays():
    """Some keyframes move at each step, one or two chunks come, of new keyframes or old ones."""
    rng = np.random.default_rng(0)
    poses = np.tile(np.eye(4), (30, 1, 1))
    told, chunks = Told(), []
    before = told.now(chunks, poses, [])
    for step in range(30):
        chunks += [chunk(rng, int(keyframe)) for keyframe in {step, int(rng.integers(step + 1))}]
        moved = np.flatnonzero(rng.random(30) < 0.2).tolist()
        for keyframe in moved:
            poses[keyframe] = pose(so3_exp(rng.normal(size=3)), rng.normal(size=3))
        kept = before[0].copy(), before[1].copy()
        points, ids = told.now(chunks, poses, moved)
        due = [transform_points(poses[c.keyframe], c.points[c.shown]) for c in chunks]
        assert points == pytest.approx(np.concatenate(due), abs=1e-12)
        assert np.array_equal(ids, np.concatenate([c.ids[c.shown] for c in chunks]))
        assert np.array_equal(before[0], kept[0])
        assert np.array_equal(before[1], kept[1])
        before = points, ids
