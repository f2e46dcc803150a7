import numpy as np

from eval.score.loops import LoopScore, score_loops
from slam.core import inverse, pose
from slam.loops import Loop


def line(xs):
    return np.array([pose(np.eye(3), np.array([x, 0.0, 0.0])) for x in xs])


THERE_AND_BACK = line([*np.arange(0.0, 10.0, 0.5), *np.arange(10.0, 0.0, -0.5)])


def loop(earlier, later, shift=0.0):
    T = inverse(THERE_AND_BACK[earlier]) @ THERE_AND_BACK[later]
    T[0, 3] += shift
    return Loop(earlier, later, T)


def test_closures_are_judged_by_the_true_motion():
    loops = [loop(5, 36), loop(5, 35, 0.09), loop(5, 35, 0.11), loop(0, 10, 3.0)]
    score = score_loops(loops, THERE_AND_BACK)
    assert (score.true, score.false) == (2, 2)


def test_a_revisit_without_a_true_closure_is_missed():
    assert score_loops([], line(np.arange(0.0, 40.0, 0.5))) == LoopScore(0, 0, 0)
    assert score_loops([], THERE_AND_BACK).missed == 1
    assert score_loops([loop(5, 36, 0.5)], THERE_AND_BACK) == LoopScore(0, 1, 1)
    assert score_loops([loop(5, 36)], THERE_AND_BACK).missed == 0
