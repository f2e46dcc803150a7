import json
from pathlib import Path

import numpy as np
import pytest
from drawings import write

from sim.route import plan_route
from slam.core import InputError
from worlds.catalogue import load_scene
from worlds.conditions import AS_BUILT
from worlds.world import build_world

REAL = Path(__file__).parents[2].parent / "shared" / "data" / "floorplans"


def tree(**storey):
    """Two rooms and the wall around and between them, with a door."""
    drawn = {
        "name": "0",
        "z_floor": 0.0,
        "z_ceiling": None,
        "rooms": [
            {"id": "a", "name": "OFFICE", "type": "R", "polygons": [ring(0, 0, 4, 4)]},
            {"guid": "b", "name": "CORRIDOR", "type": "C", "polygons": [ring(4.2, 0, 6, 4)]},
        ],
        "walls": [
            {
                "solid": [
                    {
                        "outer": [[-0.2, -0.2], [6.2, -0.2], [6.2, 4.2], [-0.2, 4.2]],
                        "holes": [ring(0, 0, 4, 4)["outer"], ring(4.2, 0, 6, 4)["outer"]],
                    }
                ]
            }
        ],
        "openings": [
            {
                "kind": "door",
                "z_min": 0.0,
                "z_max": 2.0,
                "polygon": [[3.9, 1.5], [4.3, 1.5], [4.3, 2.4], [3.9, 2.4]],
            }
        ],
        "somebody else's field": 7,
    }
    return {"source": "test", "storeys": [drawn | storey]}


def ring(x0, y0, x1, y1):
    return {"outer": [[x0, y0], [x1, y0], [x1, y1], [x0, y1]], "holes": []}


def test_a_floor_plan_is_read_and_can_be_driven_through(tmp_path):
    plan = load_scene(str(write(tree(), tmp_path)))
    (storey,) = plan.storeys
    assert [room.kind for room in storey.rooms] == ["room", "corridor"]
    assert storey.z_ceiling == 2.7
    world = build_world(plan, np.random.SeedSequence(0), AS_BUILT)
    assert len(plan_route(world).rooms) == 2


def test_lines_that_waver_by_millimetres_are_straightened(tmp_path):
    wavering = tree()
    outer = wavering["storeys"][0]["walls"][0]["solid"][0]["outer"]
    outer[1:1] = [[0.5 * k, -0.2 + 0.002 * (k % 2)] for k in range(1, 12)]
    plan = load_scene(str(write(wavering, tmp_path)))
    assert len(plan.storeys[0].walls.geoms[0].exterior.coords) == 5


def test_openings_of_another_storey_are_left_out(tmp_path):
    high = tree()
    high["storeys"][0]["openings"].append(
        {"kind": "window", "z_min": 3.0, "z_max": 4.0, "polygon": [[0, 0], [1, 0], [1, 0.2]]}
    )
    assert len(load_scene(str(write(high, tmp_path))).storeys[0].openings) == 1


@pytest.mark.parametrize(
    ("bad", "named"),
    [
        (tree(rooms=[]), "storeys"),
        (tree(walls=[{}]), "solid"),
        (tree(rooms=[{"name": "x", "polygons": []}]), "polygons"),
        (tree(rooms=[{"name": "x", "polygons": [{"outer": [[0, 0], [1, 1]]}]}]), "outer"),
        (tree(z_floor="low"), "z_floor"),
        (tree(z_ceiling=0.2), "z_ceiling"),
        (tree(openings=[{"kind": "door", "polygon": [[0, 0]]}]), "polygon"),
        ({"storeys": 3}, "storeys"),
        ({"storeys": []}, "storeys"),
        (json.dumps(tree()).replace("4.2", "NaN"), "NaN"),
        (json.dumps(tree()).replace("4.2", "1e300"), "metres"),
    ],
)
def test_what_is_wrong_is_named(bad, named, tmp_path):
    with pytest.raises(InputError, match=named) as refused:
        load_scene(str(write(bad, tmp_path)))
    assert "\n" not in str(refused.value)


@pytest.mark.skipif(not REAL.is_dir(), reason="the real floor plans are not beside the repository")
@pytest.mark.parametrize(
    "name",
    [
        "borchen4",
        "scuola3",
        "valleceppi_p0",
        "plans2",
        "office_130604",
        "sicurezza_1",
        "skf",
        "valleceppi_p1",
    ],
)
def test_real_floors_are_read_built_and_driven_through(name):
    plan = load_scene(str(REAL / f"{name}.json"))
    world = build_world(plan, np.random.SeedSequence(0), AS_BUILT)
    assert plan_route(world).unreachable == ()
