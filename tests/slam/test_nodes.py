import numpy as np

from slam.concepts import WallNode
from slam.core import PlanePiece, WallProposal
from slam.nodes import Nodes, opposed_pairs


def test_pairs_are_opposed_and_the_second_lies_across_the_first():
    normals = [np.array(n, float) for n in ([1, 0, 0], [0, 1, 0], [-1, 0, 0], [0, -1, 0])]
    assert set(opposed_pairs(normals)) == {(0, 2), (1, 3)}
    assert opposed_pairs(normals[:2]) == ()


class Held:
    """A map that says which planes it has."""

    def __init__(self, planes):
        self.planes, self.lost = planes, 0

    def __contains__(self, plane):
        return plane in self.planes


def test_a_proposal_that_comes_again_has_its_node_while_its_planes_are_there():
    held, made = Held({1, 2}), []

    def node(proposal):
        made.append(proposal)
        return WallNode((1, 2), np.zeros(3)) if held.planes >= {1, 2} else None

    nodes = Nodes(held, node)
    faces = tuple(PlanePiece(plane, np.array([[0.0, 0.0], [2.0, 0.0]])) for plane in (1, 2))
    wall = WallProposal(7, faces, 0.9)
    first = nodes.of([wall])
    assert nodes.of([wall])[7] is first[7]
    assert len(made) == 1
    assert nodes.of([WallProposal(7, faces, 0.9)])[7] is not first[7]
    first, held.lost = nodes.of([wall]), 1  # another plane
    assert nodes.of([wall])[7] is first[7]
    held.planes, held.lost = {1}, 2
    assert nodes.of([wall]) == {}
    assert nodes.of([]) == {}
