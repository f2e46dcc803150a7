"""Which rooms a route leads into, and in which it starts."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from slam.core import InputError, IntArray
from worlds.names import unknown

if TYPE_CHECKING:
    from worlds.plan import NamedRoute
    from worlds.truth import Room
    from worlds.world import World


def storeys_of(world: World, storey: int | None) -> list[int]:
    """The storeys that a route can lead through."""
    if storey is None:
        joined = {k for ramp in world.ramps for k in (ramp.storey, ramp.storey + 1)}
        return sorted(joined) or [world.truth.floors[0].storey if world.truth.floors else 0]
    storeys = len(world.footprints)
    if not 0 <= storey < storeys:
        raise InputError(f"storey {storey}: the building has storeys 0 to {storeys - 1}")
    return [storey]


def rooms_of(world: World, storeys: Sequence[int], part: NamedRoute | None) -> list[Room]:
    """The rooms of these storeys, or those of a route in its order. Raises InputError."""
    rooms = [room for room in world.truth.rooms if room.storey in storeys]
    if part is not None:
        drawn = {room.id: room.name for room in world.plan.storeys[part.storey].rooms}
        order = [drawn[k] for k in part.rooms]
        # Rooms that nothing separates are one, named after all of them.
        rank = {room.id: _rank(order, room) for room in rooms}
        rooms = sorted((r for r in rooms if rank[r.id] < len(order)), key=lambda r: rank[r.id])
    if not rooms:
        raise InputError(f"storey {storeys[0]}: expected at least one room")
    return rooms


def _rank(order: list[str], room: Room) -> int:
    """The first place of a room in a route's ``order``, or the order's length."""
    names = {room.name, *room.name.split(" + ")}
    return next((k for k, name in enumerate(order) if name in names), len(order))


def room_named(rooms: list[Room], name: str | None) -> int | None:
    """The place of the room with that name (or with that one but for its case)."""
    if name is None:
        return None
    names = [room.name for room in rooms]
    folded = [n.lower() for n in names]
    if name.lower() not in folded:
        raise InputError(unknown("start room", name, names))
    return names.index(name) if name in names else folded.index(name.lower())


def choose_part(
    parts: IntArray, inside: list[IntArray], rooms: list[Room], start: int | None
) -> int:
    """The part that holds most of the start room; without one, that which reaches most rooms."""
    if start is not None:
        if not len(inside[start]):
            raise InputError(f"start room '{rooms[start].name}': the base does not fit into it")
        return int(np.bincount(parts[inside[start]]).argmax())
    reached = np.zeros(int(parts.max(initial=0)) + 1)
    for cells in inside:
        area = np.bincount(parts[cells], minlength=len(reached))
        reached += (area > 0) + area / max(len(parts), 1)
    if not reached.any():
        raise InputError("not one room that the base can reach: no room has space for it")
    return int(reached.argmax())


def first_room(rooms: list[Room], reached: list[IntArray]) -> int:
    """The first reached room that is a room, not a corridor; a corridor where there is no other."""
    open_rooms = [i for i, cells in enumerate(reached) if len(cells)]
    return min(open_rooms, key=lambda i: (_dislike(rooms[i].kind), i))


def _dislike(kind: str) -> int:
    """How little a kind of room is liked to start in."""
    return {"room": 0, "corridor": 2, "stairs": 2, "elevator": 2}.get(kind, 1)
