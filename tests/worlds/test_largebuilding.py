import numpy as np
import pytest

from slam.core import InputError
from worlds.catalogue import load_scene, scene_counts, scene_sha256
from worlds.conditions import IDEAL
from worlds.world import true_world


@pytest.mark.parametrize(("rooms", "seed"), [(10, 0), (11, 3), (26, 1), (57, 8), (150, 2)])
def test_it_has_as_many_rooms_as_were_asked_for(rooms, seed):
    plan = load_scene(f"rooms-{rooms}-{seed}")
    truth = true_world(plan, np.random.SeedSequence(0), IDEAL)
    assert len(truth.rooms) == len(plan.storeys[0].rooms) == scene_counts(plan).room_total == rooms
    joined = {room for door in truth.doors for room in door.rooms}
    assert joined == set(range(rooms))
    assert len({room.name for room in truth.rooms}) == rooms


def test_its_name_decides_it():
    one, again, other = (load_scene(name) for name in ("rooms-20-4", "rooms-20-4", "rooms-20-5"))
    assert one == again
    assert one.storeys[0].walls != other.storeys[0].walls
    assert scene_sha256("rooms-20-4") == scene_sha256("rooms-20-4") != scene_sha256("rooms-20-5")


def test_the_largest_has_a_thousand_rooms():
    assert len(load_scene("rooms-1000-7").storeys[0].rooms) == 1000


@pytest.mark.parametrize("name", ["rooms-9-1", "rooms-1001-1", "rooms-20", "rooms-20-", "rooms--1"])
def test_other_sizes_are_refused(name):
    with pytest.raises(InputError, match="10 to 1000 rooms"):
        load_scene(name)
