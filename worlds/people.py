"""People as bodies: trunk, head and two legs, each a capsule that can be put anywhere."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import mujoco
import numpy as np
import shapely

from slam.core import Array
from worlds.truth import Room

PARTS = ("trunk", "head", "left", "right")
RADII = (0.16, 0.10, 0.07, 0.07)
"""Of the parts [m]."""
REACH = 0.36
"""No part of a walking person is farther than this from the line through the trunk [m]."""
LEG, SHOULDERS = 0.50, 0.83
"""Length of a leg, height of the shoulders, as parts of a person's height."""
HIP = 0.09
"""From the middle to the axis of a leg [m]."""
HEIGHTS = (1.55, 1.95)
"""Of people [m]."""
LOW_ROOM = 0.1
"""Least space between a head and the ceiling [m]."""
WALL_OFF = 0.35
"""People stand at least this far from walls at first, where a room is wide enough [m]."""
RGBA = (0.30, 0.42, 0.62, 1.0)


@dataclass(frozen=True)
class Person:
    """Somebody who walks about. height [m]; place: (2,) and yaw, where they stand at first;
    z_floor: of their storey [m]."""

    name: str
    storey: int
    height: float
    place: tuple[float, float]
    yaw: float
    z_floor: float

    @property
    def geoms(self) -> tuple[str, ...]:
        """Names of their geoms, each in a mocap body of the same name, in the order of PARTS."""
        return tuple(f"{self.name}_{part}" for part in PARTS)

    @property
    def halves(self) -> Array:
        """(4,) half the length of each part's axis, without the round ends [m]."""
        leg = LEG * self.height / 2.0 - RADII[2]
        trunk = (SHOULDERS - LEG) * self.height / 2.0 - RADII[0] / 2.0
        return np.array([trunk, 0.02, leg, leg])


def posture(person: Person, x: float, y: float, yaw: float, stride: float) -> tuple[Array, Array]:
    """(4, 3) middles and (4, 3) upward unit axes of the parts; stride: angle of the left leg
    forward and the right one back [rad]."""
    ahead = np.array([np.cos(yaw), np.sin(yaw), 0.0])
    aside = np.array([-ahead[1], ahead[0], 0.0])
    foot, up = np.array([x, y, person.z_floor]), np.array([0.0, 0.0, 1.0])
    hip = LEG * person.height
    trunk = foot + (LEG + SHOULDERS) / 2.0 * person.height * up
    head = foot + (person.height - RADII[1] - 0.02) * up
    middles, axes = [trunk, head], [up, up]
    for sign in (1.0, -1.0):
        axis = np.cos(stride) * up - sign * np.sin(stride) * ahead
        middles.append(foot + hip * up + sign * HIP * aside - hip / 2.0 * axis)
        axes.append(axis)
    return np.array(middles), np.array(axes)


def upright_to(axes: Array) -> Array:
    """(..., 4) quaternions, w first, that turn the z axis to upward unit vectors (..., 3)."""
    quaternion_wxyz = np.zeros((*axes.shape[:-1], 4))
    quaternion_wxyz[..., 0] = 1.0 + axes[..., 2]
    quaternion_wxyz[..., 1] = -axes[..., 1]
    quaternion_wxyz[..., 2] = axes[..., 0]
    return quaternion_wxyz / np.linalg.norm(quaternion_wxyz, axis=-1, keepdims=True)


def gathered(
    rooms: Sequence[Room],
    footprint: shapely.MultiPolygon,
    z: tuple[float, float],
    per_100_m2: float,
    rng: np.random.Generator,
) -> list[Person]:
    """The people of a storey, somewhere in its rooms and clear of what stands there.

    At least one where any are asked for. footprint: what they cannot walk through; z: of floor and
    ceiling.
    """
    area = sum(room.polygon.area for room in rooms)
    if per_100_m2 <= 0.0 or not rooms or z[1] - z[0] < HEIGHTS[0] + LOW_ROOM:
        return []
    count = max(1, round(per_100_m2 * area / 100.0))
    shares = np.array([room.polygon.area for room in rooms]) / area
    people = []
    for k in range(count):
        room = rooms[int(rng.choice(len(rooms), p=shares))]
        height = min(float(rng.uniform(*HEIGHTS)), z[1] - z[0] - LOW_ROOM)
        x, y = _place(room, footprint, rng)
        yaw, name = float(rng.uniform(-np.pi, np.pi)), f"s{room.storey}_person{k}"
        people.append(Person(name, room.storey, height, (x, y), yaw, z[0]))
    return people


def _place(
    room: Room, footprint: shapely.MultiPolygon, rng: np.random.Generator
) -> tuple[float, float]:
    """A free place of a room; the one farthest from its walls where it has none."""
    near = shapely.clip_by_rect(footprint, *room.polygon.buffer(WALL_OFF).bounds)
    free = room.polygon.buffer(-WALL_OFF).difference(near.buffer(WALL_OFF))
    if not free.is_empty:
        low_x, low_y, high_x, high_y = free.bounds
        tries = rng.uniform([low_x, low_y], [high_x, high_y], (200, 2))
        inside = tries[shapely.contains_xy(free, tries)]
        if len(inside):
            return float(inside[0, 0]), float(inside[0, 1])
    point = shapely.maximum_inscribed_circle(room.polygon, tolerance=0.05).coords[0]
    return float(point[0]), float(point[1])


def add_people(spec: mujoco.MjSpec, people: Sequence[Person]) -> None:
    """Adds people as mocap bodies: they go where they are put, and the base collides with them."""
    for person in people:
        middles, axes = posture(person, *person.place, person.yaw, 0.0)
        rows = zip(
            person.geoms, middles, upright_to(axes), RADII, person.halves.tolist(), strict=True
        )
        for name, middle, quaternion_wxyz, radius, half in rows:
            body = spec.worldbody.add_body(name=name, mocap=True, pos=middle, quat=quaternion_wxyz)
            body.add_geom(
                name=name,
                type=mujoco.mjtGeom.mjGEOM_CAPSULE,
                size=[radius, half, 0.0],
                rgba=RGBA,
                contype=1,
                conaffinity=1,
            )
