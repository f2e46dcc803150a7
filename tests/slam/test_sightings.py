import numpy as np
import pytest
from held import residuals_of, variable_count

from eval.bench.growth import observations
from slam.backend import BackEnd
from slam.core import PlaneObservation, RunError
from slam.graph import LayeredGraph

LEFT = np.array([0.0, 1.0, 0.0])


def seen(d, sigma=0.008):
    """A wall at y = -d, as the first keyframe sees it."""
    covariance = np.diag([0.0026**2, 0.0026**2, sigma**2])
    points = np.zeros((0, 3), np.float32)
    return PlaneObservation(LEFT, d, -d * LEFT, covariance, points, np.zeros(0, np.int64))


@pytest.fixture
def graph():
    graph = LayeredGraph()
    graph.add_keyframe(0, np.eye(4), None)
    return graph


def wall(graph, d):
    return graph.add_plane(LEFT, d, -d * LEFT)


def residuals(graph):
    """How many there are of observations, after an update."""
    graph.optimise(whole=True)
    return residuals_of(graph, "planes")


def test_an_observation_that_moves_to_another_plane_counts_there_and_only_there(graph):
    first, second = wall(graph, 2.0), wall(graph, 2.03)
    graph.observe(0, first, seen(2.0), 0)
    graph.observe(0, second, seen(2.01), 1)
    assert residuals(graph) == 6
    graph.observe(0, first, seen(2.01), 1)
    graph.drop_plane(second)
    assert residuals(graph) == 6
    assert variable_count(graph) == 2
    assert graph.estimates.offsets[first] == pytest.approx(2.005, abs=1e-4)


def test_what_is_forgotten_counts_no_more(graph):
    plane = wall(graph, 2.0)
    graph.observe(0, plane, seen(2.0), 0)
    graph.observe(0, plane, seen(2.02), 1)
    assert residuals(graph) == 6
    graph.forget(0, 1)
    assert residuals(graph) == 3
    assert graph.estimates.offsets[plane] == pytest.approx(2.0, abs=1e-6)
    graph.forget(0, 0)
    graph.drop_plane(plane)
    assert residuals(graph) == 0
    assert variable_count(graph) == 1
    again = wall(graph, 3.0)
    graph.observe(0, again, seen(3.0), 2)
    assert residuals(graph) == 3
    graph.observe(0, again, seen(3.0), 1)  # one that was forgotten
    assert residuals(graph) == 6


def test_a_plane_that_nothing_observes_any_more_is_told_of():
    graph = LayeredGraph()
    graph.add_keyframe(0, np.eye(4), None)
    for place, d in enumerate((2.0, 3.0)):
        graph.observe(0, wall(graph, d), seen(d), place)
    graph.optimise(whole=True)
    graph.forget(0, 1)
    with pytest.raises(RunError, match="a plane is not observed"):
        graph.optimise(whole=True)


def test_a_plane_that_comes_and_goes_between_two_updates_leaves_nothing(graph):
    graph.optimise()
    plane = wall(graph, 3.0)
    graph.observe(0, plane, seen(3.0), 0)
    graph.forget(0, 0)
    graph.drop_plane(plane)
    assert residuals(graph) == 0
    assert variable_count(graph) == 1


def test_a_first_sight_that_was_off_weighs_little_once_others_agree(graph):
    """Its weight is that of where the plane is now, not of where it was thought to be at first."""
    plane = wall(graph, 2.06)
    graph.observe(0, plane, seen(2.06), 0)
    graph.optimise()
    for place in range(1, 9):
        graph.observe(0, plane, seen(2.0), place)
        graph.optimise()
    graph.optimise(extra_iterations=3)
    assert graph.estimates.offsets[plane] == pytest.approx(2.0, abs=0.004)


def test_no_part_of_the_map_moves_by_itself():
    """Through rooms one after the other, none seen again: what is behind stays where it was, which
    it does not where some of the factors about a keyframe are linearised elsewhere than others."""
    backend, before = BackEnd(), np.zeros((0, 3))
    for frame, _ in observations(24, np.random.default_rng(0)):
        backend.add(frame)
        backend.optimise(whole=True)
        places = np.array([keyframe.T_map_base[:3, 3] for keyframe in backend.keyframes()])
        assert np.abs(places[: len(before)] - before).max(initial=0.0) < 0.06
        before = places
