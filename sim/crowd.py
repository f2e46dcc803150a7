"""People before the sensor: capsules that move during a sweep, met by rays in closed form."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Protocol

import numpy as np
from numpy.typing import NDArray

from sim.caster import Hits, Rays
from sim.walkers import Walker, Walkers, gather_walkers
from slam.core import Array, IntArray
from worlds.truth import PEOPLE

if TYPE_CHECKING:
    import mujoco

    from sim.lidar import Caster
    from worlds.people import Person
    from worlds.world import World

AWAY = np.array([0.0, 0.0, -1000.0])
"""Where people are for whom there is no place [m]."""
BLUR = 0.30
"""Sensor and people move less than this beside each other in one sweep [m]."""


class Crowd(Protocol):
    """Whoever is about. Time is told as a fraction of the present sweep."""

    def advance(self, period: float, base: Array) -> None:
        """Decides how they move in the next sweep, of ``period`` [s]; the base is at (2,)."""
        ...

    def put(self, data: mujoco.MjData, fraction: float) -> None:
        """Puts their bodies where they are."""
        ...

    def before(self, caster: Caster) -> Caster:
        """A caster that sees them, too."""
        ...


class Nobody:
    """An empty building."""

    def advance(self, period: float, base: Array) -> None:
        """Nothing moves."""

    def put(self, data: mujoco.MjData, fraction: float) -> None:
        """Nothing to put."""

    def before(self, caster: Caster) -> Caster:
        """The caster itself."""
        return caster


@dataclass(frozen=True)
class Postures:
    """Capsules, four a person. middles, axes: (..., 4, 3), axes of unit length."""

    middles: Array
    axes: Array


class People:
    """People who walk; ``geoms`` (P, 4): MuJoCo's ids of their parts in ``model``."""

    def __init__(
        self,
        people: Sequence[Person],
        walkers: Walkers,
        each: Sequence[Walker | None],
        model: mujoco.MjModel,
    ) -> None:
        from worlds.people import RADII

        self._people = people
        self._walkers = walkers
        self._each = each
        self.geoms: NDArray[np.int32] = np.array(
            [[model.geom(name).id for name in person.geoms] for person in people], dtype=np.int32
        )
        bodies = model.geom_bodyid[self.geoms]
        self._mocap = model.body_mocapid[bodies]
        self.radii = np.array(RADII)
        self.halves = np.array([person.halves for person in people])
        self._start = self._end = self._postures()

    def advance(self, period: float, base: Array) -> None:
        """See ``Crowd``."""
        self._start = self._end
        self._walkers.advance(period, base)
        self._end = self._postures()

    def put(self, data: mujoco.MjData, fraction: float) -> None:
        """See ``Crowd``."""
        from worlds.people import upright_to

        now = self.at(np.array([fraction]), slice(None))
        data.mocap_pos[self._mocap] = now.middles[0]
        data.mocap_quat[self._mocap] = upright_to(now.axes[0])

    def before(self, caster: Caster) -> Caster:
        """See ``Crowd``."""
        return CrowdCaster(caster, self)

    def at(self, fractions: NDArray[np.floating], people: int | slice) -> Postures:
        """Some of them at fractions (N,) of the sweep, (N, ..., 4, 3): middles and axes go straight
        from its beginning to its end."""
        first, last = self._start, self._end
        middles, axes = first.middles[people], first.axes[people]
        share = fractions.reshape(-1, *[1] * middles.ndim)
        axes = axes + share * (last.axes[people] - axes)
        axes /= np.sqrt(np.einsum("...i,...i->...", axes, axes))[..., None]
        return Postures(middles + share * (last.middles[people] - middles), axes)

    def places(self) -> Array:
        """(P, 2) at the sweep's end."""
        return self._end.middles[:, 0, :2]

    def _postures(self) -> Postures:
        from worlds.people import posture

        found = []
        for person, walker in zip(self._people, self._each, strict=True):
            if walker is None:
                middles, axes = posture(person, 0.0, 0.0, 0.0, 0.0)
                found.append((middles + AWAY, axes))
            else:
                x, y = walker.place.tolist()
                found.append(posture(person, x, y, walker.yaw, walker.stride))
        return Postures(np.array([m for m, _ in found]), np.array([a for _, a in found]))


class CrowdCaster:
    """What a caster sees, and the people before it."""

    def __init__(self, caster: Caster, people: People) -> None:
        self._caster = caster
        self._people = people

    def cast(self, rays: Rays, fractions: NDArray[np.float32]) -> Hits:
        """First hits of rays (N, 6), world frame, each shot at a fraction (N,) of the sweep."""
        hits = self._caster.cast(rays, fractions)
        if not len(rays):
            return hits
        seen = hits.copy()
        for person, place in enumerate(self._people.places()):
            self._put_before(seen, person, _near(place, rays, hits.distance), rays, fractions)
        return seen

    def _put_before(
        self, hits: Hits, person: int, near: IntArray, rays: Rays, fractions: NDArray[np.float32]
    ) -> None:
        """Writes where rays ``near`` somebody meet them over what is farther off."""
        own = rays[near].astype(np.float64)
        origins, directions = own[:, :3], own[:, 3:]
        now = self._people.at(fractions[near], person)
        for part, radius in enumerate(self._people.radii.tolist()):
            half = float(self._people.halves[person, part])
            capsule = now.middles[:, part], now.axes[:, part], half, radius
            reach, incidence = meet_capsule(origins, directions, *capsule)
            nearer = reach < hits.distance[near]
            rows = near[nearer]
            hits.distance[rows], hits.cosine[rows] = reach[nearer], incidence[nearer]
            hits.face[rows], hits.triangle[rows] = PEOPLE, -1
            hits.geom[rows] = self._people.geoms[person, part]
            if hits.glass is not None:
                hits.glass[rows] = False


def _near(place: Array, rays: Rays, distance: NDArray[np.float32]) -> IntArray:
    """The rays that may meet somebody at a place (2,), by their directions in plan view, and are
    not stopped before."""
    from worlds.people import REACH

    x, y = place - rays[:, :2].mean(axis=0)
    spread = REACH + BLUR
    before = np.flatnonzero(distance >= np.hypot(x, y) - spread)
    dx, dy = rays[before, 3], rays[before, 4]
    level = spread * np.hypot(dx, dy)
    wanted = (np.abs(dx * y - dy * x) <= level) & (dx * x + dy * y >= -level)
    return before[wanted]


def make_crowd(
    world: World,
    storey: int,
    route: Array,
    base_radius: float,
    base_speed: float,
    model: mujoco.MjModel,
    rng: np.random.Generator,
) -> Crowd:
    """The people of a world in the model that moves; ``Nobody`` where there are none."""
    if not world.people:
        return Nobody()
    walkers, each = gather_walkers(world, storey, route, base_radius, base_speed, rng)
    return People(world.people, walkers, each, model)


def meet_capsule(
    origins: Array, directions: Array, middles: Array, axes: Array, half: float, radius: float
) -> tuple[Array, Array]:
    """Distances (N,) along unit rays to capsules, a capsule each, and cosines of incidence.

    middles, axes: (N, 3); half: of the axis [m]. inf where a ray misses. A ray from inside misses.
    """
    to = origins - middles
    along_ray = np.einsum("ni,ni->n", directions, axes)
    along = np.einsum("ni,ni->n", to, axes)
    a = np.maximum(1.0 - along_ray**2, 1e-12)
    b = np.einsum("ni,ni->n", to, directions) - along * along_ray
    c = np.einsum("ni,ni->n", to, to) - along**2 - radius**2
    root = b**2 - a * c
    side = (-b - np.sqrt(np.maximum(root, 0.0))) / a
    place = along + side * along_ray
    on_axis = np.clip(place, -half, half)
    beyond = (on_axis != place) | (a <= 1e-12)
    # Where the cylinder is met beyond an end, the round end on that side is what can be met.
    end = to - on_axis[:, None] * axes
    b_end = np.einsum("ni,ni->n", end, directions)
    root_end = b_end**2 - np.einsum("ni,ni->n", end, end) + radius**2
    cap = -b_end - np.sqrt(np.maximum(root_end, 0.0))
    distance = np.where(beyond, cap, side)
    missed = np.where(beyond, root_end, root) < 0.0
    missed |= (root < 0.0) | (distance <= 0.0)
    normal = (end + distance[:, None] * directions) / radius
    cosine = np.abs(np.einsum("ni,ni->n", normal, directions))
    return np.where(missed, np.inf, distance), np.minimum(cosine, 1.0)
