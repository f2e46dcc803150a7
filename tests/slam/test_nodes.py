import numpy as np

from slam.nodes import opposed_pairs


def test_pairs_are_opposed_and_the_second_lies_across_the_first():
    normals = [np.array(n, float) for n in ([1, 0, 0], [0, 1, 0], [-1, 0, 0], [0, -1, 0])]
    assert set(opposed_pairs(normals)) == {(0, 2), (1, 3)}
    assert opposed_pairs(normals[:2]) == ()
