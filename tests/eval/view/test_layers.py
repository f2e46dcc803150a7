"""Only what changed is drawn; what is gone is cleared."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from eval.view.layers import GRAPH, MAP, Layers
from slam.core import MapView, Proposals, RoomProposal


def test_everything_is_drawn_once(log: Any, view: MapView, proposals: Proposals) -> None:
    layers = Layers(log)
    layers.draw(view, proposals)
    drawn = log.take()
    assert {f"{MAP}/planes/{i}" for i in range(3)} <= drawn.keys()
    assert drawn[f"{MAP}/walls/0/slab"] == "Boxes3D"
    assert drawn[f"{MAP}/rooms/7/floor"] == "Mesh3D"
    assert {
        f"{GRAPH}/{node}/node" for node in ("rooms/7", "rooms/8", "walls/0", "floors/0")
    } <= set(drawn)
    layers.draw(view, proposals)
    assert log.take() == {}


def test_only_what_changed_is_drawn_again(log: Any, view: MapView, proposals: Proposals) -> None:
    layers = Layers(log)
    layers.draw(view, proposals)
    log.take()
    moved = replace(view.planes[2], points=view.planes[2].points + 0.5, d=-0.5, revision=2)
    layers.draw(replace(view, planes=(*view.planes[:2], moved)), proposals)
    assert set(log.take()) == {f"{MAP}/planes/2"}
    sure = replace(proposals.rooms[0], confidence=0.5)
    layers.draw(view, replace(proposals, rooms=(sure, proposals.rooms[1])))
    assert all("/rooms/7/" in entity or "planes/2" in entity for entity in log.take())


def test_less_than_can_be_seen_is_no_change(log: Any, view: MapView, proposals: Proposals) -> None:
    layers = Layers(log)
    layers.draw(view, proposals)
    log.take()
    plane = view.planes[0]
    nudged = replace(plane, points=plane.points + np.array([0.001, 0.0, 0.0]), revision=2)
    layers.draw(replace(view, planes=(nudged, *view.planes[1:])), proposals)
    assert len(log.take()) <= 1  # a coordinate may stand on the edge of its cell


def test_what_is_gone_is_cleared(log: Any, view: MapView, proposals: Proposals) -> None:
    layers = Layers(log)
    layers.draw(view, proposals)
    log.take()
    layers.draw(replace(view, planes=view.planes[1:]), Proposals())
    cleared = log.take()
    assert set(cleared.values()) == {"Clear"}
    gone = {"planes/0", "walls/0", "rooms/7", "rooms/8", "floors/0"}
    assert set(cleared) == {f"{tree}/{entity}" for tree in (MAP, GRAPH) for entity in gone}
    layers.draw(view, proposals)
    assert f"{MAP}/rooms/7/floor" in log.take()


def test_a_room_without_planes_points_at_its_place(log: Any, view: MapView) -> None:
    room = RoomProposal(3, (), None, np.array([1.0, 2.0]), 0.7)
    Layers(log).draw(replace(view, planes=()), Proposals((room,)))
    edges = dict(log.calls)[f"{GRAPH}/rooms/3/edges"]
    strips = edges.strips.as_arrow_array().to_pylist()
    assert strips[0][-1] == [1.0, 2.0, 0.0]


def test_pieces_of_planes_that_are_gone_are_left_out(
    log: Any, view: MapView, proposals: Proposals
) -> None:
    Layers(log).draw(replace(view, planes=()), proposals)
    drawn = log.take()
    assert f"{GRAPH}/rooms/7/node" in drawn
    assert not any("walls" in entity for entity in drawn)


def test_a_storey_above_lifts_all_nodes_and_has_a_floor_of_its_own(
    log: Any, view: MapView, proposals: Proposals
) -> None:
    layers = Layers(log)
    layers.draw(view, proposals)
    below = dict(log.calls)[f"{GRAPH}/rooms/7/node"].positions.as_arrow_array().to_pylist()[0][2]
    log.take()
    up = np.array([0.0, 0.0, 3.0])
    wall = view.planes[0]
    above = replace(wall, id=9, points=wall.points + up, storey=1)
    room = replace(proposals.rooms[0], id=100_007, pieces=(), storey=1)
    both = replace(proposals, rooms=(*proposals.rooms, room))
    layers.draw(replace(view, planes=(*view.planes, above)), both)
    calls = dict(log.calls)
    lifted = calls[f"{GRAPH}/rooms/7/node"].positions.as_arrow_array().to_pylist()[0][2]
    assert lifted == pytest.approx(below + above.z_range[0])
    assert {f"{GRAPH}/floors/{storey}/node" for storey in (0, 1)} <= set(log.take())
    feet = calls[f"{GRAPH}/rooms/100007/edges"].strips.as_arrow_array().to_pylist()
    assert feet[0][-1][2] == pytest.approx(above.z_range[0])
