"""The two driven wheels: what the floor's grip makes of their turning, and what encoders count.

A wheel pushes by creeping: its rim runs a little faster over the floor than the base moves. The
push grows with the creep and ends at the friction limit (Coulomb), sideways and forwards together.
Everything is a few scalars a physics step, so it is plain arithmetic.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import exp, floor, hypot, sqrt, tau

import numpy as np
from numpy.typing import NDArray

from slam.core import InputError, WheelOdometry, pose, so3_exp

GRAVITY = 9.81
SLOW = 0.02
"""Below this speed [m/s] the rolling resistance fades, so that nothing jitters at rest."""

TWIST_TIME = 0.05
"""Over how much of the sweep's end the twist is taken [s]: one count in it is some mm/s."""


@dataclass(frozen=True)
class WheelConfig:
    """Two wheels on one axle through the middle of the base.

    track [m] between them and radius [m], as the odometry believes them; radius_tolerance (of both
    alike), radius_mismatch (between them) and track_tolerance: sigma of how far a real unit is off,
    as a share: what a careful calibration leaves (Borenstein and Feng, 1996); grip [s]: creep [m/s]
    by acceleration [m/s2] of the loaded base (rubber on hard floor: about 1 % at 0.6 m/s and 0.6
    m/s2); friction: Coulomb's coefficient; rolling: resistance as a share of the weight; patches:
    how much of the grip dust takes away, in the logarithm, and tread: sigma of the rolling radius
    as a share (dirt, joints, wear), both changing over patch_length [m]; counts: of the encoder per
    turn of the wheel.
    """

    track: float = 0.30
    radius: float = 0.075
    radius_tolerance: float = 0.005
    radius_mismatch: float = 0.001
    track_tolerance: float = 0.01
    grip: float = 0.01
    friction: float = 0.6
    rolling: float = 0.015
    patches: float = 0.4
    patch_length: float = 0.5
    tread: float = 0.003
    counts: int = 2048

    def __post_init__(self) -> None:
        for name in ("track", "radius", "grip", "friction", "patch_length", "counts"):
            _check(name, getattr(self, name), above=0.0)
        tolerances = ("radius_tolerance", "radius_mismatch", "track_tolerance", "tread")
        for name in (*tolerances, "rolling", "patches"):
            _check(name, getattr(self, name), above=-1e-12)
        for name in tolerances:
            if getattr(self, name) > 0.1:
                raise InputError(f"wheels: {name} is {getattr(self, name)}, expected at most 0.1")


def _check(name: str, value: float, above: float) -> None:
    if not (np.isfinite(value) and value > above):
        kind = "more than 0" if above == 0.0 else "0 or more"
        raise InputError(f"wheels: {name} is {value}, expected {kind}")


class _Wheel:
    """One wheel, ``lever`` [m] to the left of the middle and ``scale`` times as large as believed;
    stiffness: its push by creep [N s/m]; most: the friction limit [N]; rolling: resistance [N]."""

    def __init__(
        self,
        config: WheelConfig,
        mass: float,
        timestep: float,
        lever: float,
        scale: float,
        ground: list[float],
    ) -> None:
        self._config = config
        self._timestep = timestep
        self.lever = lever
        self._scale = scale
        self._ground = ground
        self._stiffness = 0.5 * mass / config.grip
        self._most = 0.5 * config.friction * mass * GRAVITY
        self._rolling = 0.5 * config.rolling * mass * GRAVITY
        self.turned = 0.0

    def push(
        self, asked: float, over: float, aside: float, kicks: list[float]
    ) -> tuple[float, float]:
        """Forces forwards and to the left [N] for one step: its rim is asked for a speed, its axle
        moves ``over`` the floor and ``aside`` [m/s]."""
        way = asked * self._timestep
        self.turned += way
        dust, tread = self._rolled(abs(way), kicks)
        creep = asked * self._scale * (1.0 + self._config.tread * tread) - over
        stiffness = self._stiffness * exp(-self._config.patches * abs(dust))
        share = stiffness / (1.0 + stiffness * hypot(creep, aside) / self._most)
        resistance = self._rolling * max(-1.0, min(1.0, over / SLOW))
        return share * creep - resistance, -share * aside

    def _rolled(self, way: float, kicks: list[float]) -> tuple[float, float]:
        """Dust and tread under it, standard normal and correlated along its way (OU)."""
        memory = exp(-way / self._config.patch_length)
        kick = sqrt(1.0 - memory * memory)
        dust, tread = self._ground
        self._ground = [memory * dust + kick * kicks[0], memory * tread + kick * kicks[1]]
        return self._ground[0], self._ground[1]


class Wheels:
    """The wheels of one unit under a base of ``mass`` [kg]; ``rng`` draws the unit and its floor.

    They turn as asked (speed loops closed on the encoders); how fast their rims then run is a
    matter of the real radius, and where the base goes a matter of grip.
    """

    def __init__(
        self, config: WheelConfig, mass: float, timestep: float, rng: np.random.Generator
    ) -> None:
        self._rng = rng
        self._timestep = timestep
        self._half = 0.5 * config.track
        self._per_metre = config.counts / (tau * config.radius)
        both, apart, wide, *ground = rng.standard_normal(7).tolist()
        mean, half = config.radius_tolerance * both, 0.5 * config.radius_mismatch * apart
        lever = self._half * (1.0 + config.track_tolerance * wide)
        self._left = _Wheel(config, mass, timestep, lever, 1.0 + mean - half, ground[:2])
        self._right = _Wheel(config, mass, timestep, -lever, 1.0 + mean + half, ground[2:])

    @property
    def counts(self) -> tuple[int, int]:
        """What the encoders of the left and the right wheel have counted."""
        return (
            floor(self._left.turned * self._per_metre),
            floor(self._right.turned * self._per_metre),
        )

    def way(self, speed: float, turn_rate: float) -> float:
        """How far the wheels roll in one step [m], the mean of both."""
        spin = self._half * turn_rate
        return 0.5 * (abs(speed - spin) + abs(speed + spin)) * self._timestep

    def push(
        self, speed: float, turn_rate: float, moving: tuple[float, float, float]
    ) -> tuple[float, float, float]:
        """Forces forwards and to the left [N] and moment about z [Nm] on the base for one step.

        speed [m/s] and turn_rate [rad/s]: what the wheels are asked for; moving: how the base moves
        forwards, to the left [m/s] and about z [rad/s].
        """
        ahead, aside, turning = moving
        spin = self._half * turn_rate
        kicks = self._rng.standard_normal(4).tolist()
        left, right = self._left, self._right
        l_along, l_across = left.push(speed - spin, ahead - left.lever * turning, aside, kicks[:2])
        r_along, r_across = right.push(
            speed + spin, ahead - right.lever * turning, aside, kicks[2:]
        )
        moment = -left.lever * l_along - right.lever * r_along
        return l_along + r_along, l_across + r_across, moment


class Encoders:
    """Dead reckoning from what the encoders counted, with the radius and track that it believes.

    The frame of ``T_odom_base`` is the base's at the start, level: wheels know no tilt.
    """

    def __init__(self, config: WheelConfig, timestep: float) -> None:
        self._config = config
        self._recent = max(round(TWIST_TIME / timestep), 1)
        self._timestep = timestep
        self._x, self._y, self._yaw = 0.0, 0.0, 0.0

    def read(self, stamp: float, counts: NDArray[np.int64]) -> WheelOdometry:
        """The odometry at the end of a sweep; counts: (K + 1, 2) left, right at every step of it,
        those at its beginning first."""
        config = self._config
        ways = np.diff(counts, axis=0) * (tau * config.radius / config.counts)
        ahead, turn = ways.mean(axis=1), (ways[:, 1] - ways[:, 0]) / config.track
        heading = self._yaw + np.cumsum(turn) - 0.5 * turn
        self._x += float(ahead @ np.cos(heading))
        self._y += float(ahead @ np.sin(heading))
        self._yaw += float(turn.sum())
        last = slice(-self._recent, None)
        seconds = len(ahead[last]) * self._timestep
        twist = np.zeros(6)
        twist[[0, 5]] = ahead[last].sum() / seconds, turn[last].sum() / seconds
        turned = so3_exp(np.array([0.0, 0.0, self._yaw]))
        T_odom_base = pose(turned, np.array([self._x, self._y, 0.0]))
        return WheelOdometry(stamp, T_odom_base, twist)
