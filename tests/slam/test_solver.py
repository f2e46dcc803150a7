import gtsam
import numpy as np
import pytest

from slam.core import RunError
from slam.solver import Solver

PLACE = gtsam.symbol("a", 0)
ONE = gtsam.noiseModel.Isotropic.Sigma(3, 0.5)


def prior(key, place):
    """Its linear part, and how many residuals it has."""
    at = gtsam.Values()
    at.insert(key, np.ones(3))
    part = gtsam.PriorFactorPoint3(key, np.array(place, dtype=float), ONE).linearize(at)
    return gtsam.LinearContainerFactor(part, at), 3


def solver_of(*priors):
    solver = Solver()
    solver.insert(PLACE, np.zeros(3))
    for name, place in priors:
        solver.add(name, *prior(PLACE, place))
    return solver


def squares(solver):
    return {name: (residuals, chi2) for name, residuals, chi2 in solver.squares()}


def test_factors_count_from_the_next_update_on_and_leave_by_their_names():
    solver = solver_of(("a", [1, 0, 0]), ("b", [3, 0, 0]), ("c", [9, 0, 0]))
    solver.remove("c")  # before it was ever solved with
    solver.update()
    assert solver.point3(PLACE) == pytest.approx([2.0, 0.0, 0.0])
    assert squares(solver) == {"a": (3, pytest.approx(4.0)), "b": (3, pytest.approx(4.0))}
    solver.remove("a")
    solver.add("a", *prior(PLACE, [5, 0, 0]))  # the same name, another factor
    solver.update()
    assert solver.point3(PLACE) == pytest.approx([4.0, 0.0, 0.0])
    assert squares(solver).keys() == {"a", "b"}


def test_covariances_are_those_of_the_factors():
    solver = solver_of(("a", [1, 0, 0]), ("b", [3, 0, 0]))
    solver.update()
    assert solver.covariance(PLACE) == pytest.approx(0.125 * np.eye(3))


def test_a_variable_may_be_withdrawn_before_its_update():
    solver = solver_of(("a", [1, 0, 0]))
    solver.insert(8, np.zeros(2))
    assert solver.holds(8)
    solver.withdraw(8)
    solver.update()
    assert not solver.holds(8)
    assert solver.values().size() == 1


def test_what_cannot_be_solved_says_so_in_one_line():
    solver = solver_of(("a", [1, 0, 0]))
    solver.add("b", *prior(9, [0, 0, 0]))
    with pytest.raises(RunError, match="the graph could not be optimised: .*x?9") as caught:
        solver.update()
    assert "\n" not in str(caught.value)
