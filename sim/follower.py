"""From a route to wheel commands: a speed profile, and a steering law that keeps to the line."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise
from math import ceil, sqrt

import numpy as np
from scipy.ndimage import minimum_filter1d

from sim.base import BaseConfig
from slam.core import Array, InputError

SPACING = 0.02
"""Between the samples of a stretch [m]."""

CUSP = np.radians(40.0)
"""Corners sharper than this are turned on the spot."""


@dataclass(frozen=True)
class Stretch:
    """A part of a route that is driven without stopping, sampled every ``SPACING`` metres.

    points: (N, 2); heading, curvature [1/m] and speed [m/s]: (N,). It begins and ends at rest.
    """

    points: Array
    heading: Array
    curvature: Array
    speed: Array

    @property
    def duration(self) -> float:
        """Time to drive it [s]."""
        steps = np.linalg.norm(np.diff(self.points, axis=0), axis=1)
        mean = 0.5 * (self.speed[1:] + self.speed[:-1])
        return float((steps / np.maximum(mean, 0.02)).sum())


def stretches(points: Array, config: BaseConfig) -> list[Stretch]:
    """A route (N, 2), cut at its cusps. Raises InputError if it has no length."""
    moved = np.append(True, np.linalg.norm(np.diff(points, axis=0), axis=1) > 1e-6)
    line = points[moved]
    if len(line) < 2:
        raise InputError("route: expected at least two different points")
    steps = np.diff(line, axis=0)
    headings = np.arctan2(steps[:, 1], steps[:, 0])
    cusps = np.flatnonzero(np.abs(_wrapped(np.diff(headings))) > CUSP) + 1
    ends = [0, *cusps.tolist(), len(line) - 1]
    return [_stretch(line[a : b + 1], config) for a, b in pairwise(ends)]


def _wrapped(angles: Array) -> Array:
    """Angles in [-pi, pi)."""
    return (angles + np.pi) % (2.0 * np.pi) - np.pi


def _stretch(line: Array, config: BaseConfig) -> Stretch:
    along = np.append(0.0, np.cumsum(np.linalg.norm(np.diff(line, axis=0), axis=1)))
    count = max(int(np.ceil(along[-1] / SPACING)), 2) + 1
    s = np.linspace(0.0, along[-1], count)
    points = np.stack([np.interp(s, along, line[:, i]) for i in (0, 1)], axis=1)
    tangent = np.gradient(points, axis=0)
    heading = np.unwrap(np.arctan2(tangent[:, 1], tangent[:, 0]))
    curvature = _smoothed(np.gradient(heading, s))
    return Stretch(points, heading, curvature, _profile(s, curvature, config))


def _smoothed(values: Array, half: int = 4) -> Array:
    """Moving average over 2 half + 1 samples, the ends repeated."""
    padded = np.pad(values, half, mode="edge")
    return np.convolve(padded, np.full(2 * half + 1, 1.0 / (2 * half + 1)), mode="valid")


def _profile(s: Array, curvature: Array, config: BaseConfig) -> Array:
    """The fastest speeds (N,) within the limits of turning, acceleration and jerk, rest to rest.

    A tenth of every limit is left to the steering and the wheels. Averaging over the time in which
    the acceleration builds up bounds the jerk; what is averaged keeps clear of slow places by as
    much, so that no average is faster than the place allows.
    """
    acceleration = 0.9 * config.acceleration
    window = 2.0 * acceleration / config.jerk
    reach = min(ceil(0.5 * window * config.speed / (s[1] - s[0])), len(s))
    speed = minimum_filter1d(_turning_limit(s, curvature, config), 2 * reach + 1)
    speed[[0, -1]] = 0.0
    gain = 2.0 * acceleration * np.diff(s)
    for i in range(len(s) - 1):
        speed[i + 1] = min(speed[i + 1], np.sqrt(speed[i] ** 2 + gain[i]))
    for i in range(len(s) - 2, -1, -1):
        speed[i] = min(speed[i], np.sqrt(speed[i + 1] ** 2 + gain[i]))
    return _averaged(s, speed, window, config.timestep)


def _turning_limit(s: Array, curvature: Array, config: BaseConfig) -> Array:
    """(N,) how fast the turning rate, and what its change asks of the wheels, let the base go."""
    bend = np.maximum(np.abs(curvature), 1e-9)
    change = np.maximum(np.abs(np.gradient(curvature, s)), 1e-9)
    by_rate = 0.9 * config.turn_rate / bend
    by_acceleration = np.sqrt(0.9 * config.turn_acceleration / change)
    return np.minimum(config.speed, np.minimum(by_rate, by_acceleration))


def _averaged(s: Array, speed: Array, window: float, step: float) -> Array:
    """The same speeds (N,) at places s, each averaged over ``window`` seconds of the way."""
    steps = np.diff(s) / np.maximum(0.5 * (speed[1:] + speed[:-1]), 1e-6)
    at = np.append(0.0, np.cumsum(steps))
    half = max(round(0.5 * window / step), 1)
    seconds = np.arange(-half, np.ceil(at[-1] / step) + half + 1) * step
    padded = np.pad(np.interp(seconds, at, speed, left=0.0, right=0.0), half)
    mean = np.convolve(padded, np.full(2 * half + 1, 1.0 / (2 * half + 1)), mode="valid")
    way = np.append(0.0, np.cumsum(0.5 * (mean[1:] + mean[:-1]) * step))
    return np.interp(s, way * (s[-1] / way[-1]), mean)


class _Ramp:
    """A command whose first and second derivative are bounded, followed step by step."""

    def __init__(self, rate: float, jerk: float, step: float) -> None:
        self._most, self._jerk, self._step = rate, jerk, step
        self._rate = 0.0
        self.value = 0.0

    def towards(self, wish: float) -> float:
        """The next value: as near to the wish as the bounds allow without passing it."""
        left = wish - self.value
        by = self._jerk * self._step
        # From this rate on, taking off ``by`` each step ends at the wish.
        braking = sqrt(0.25 * by * by + 2.0 * self._jerk * abs(left)) - 0.5 * by
        rate = min(self._most, braking, abs(left) / self._step)
        change = (rate if left > 0.0 else -rate) - self._rate
        self._rate += max(-by, min(by, change))
        self.value += self._rate * self._step
        return self.value


class Follower:
    """Asks the wheels for what keeps the base on a route. One instance per run.

    The route is driven stretch by stretch; between them, and before the first, the base turns on
    the spot to the heading of the next.
    """

    ACROSS = 6.0  # turning per metre beside the line and metre driven [1/m2]
    ALONG = 3.5  # turning per radian off the heading and metre driven [1/m]
    ON_THE_SPOT = 3.0  # turning rate per radian still to turn [1/s]
    LEAD = 0.10  # look this far ahead, for the delay of wheels and turning limit [s]

    def __init__(self, points: Array, config: BaseConfig) -> None:
        self._config = config
        self._stretches = stretches(points, config)
        self._number = 0
        self._at = 0
        step = config.timestep
        self._speed = _Ramp(config.acceleration, config.jerk, step)
        self._turn = _Ramp(config.turn_acceleration, config.turn_jerk, step)
        self._turning = True

    @property
    def start(self) -> tuple[float, float, float]:
        """x, y and heading at which the route begins."""
        first = self._stretches[0]
        return float(first.points[0, 0]), float(first.points[0, 1]), float(first.heading[0])

    @property
    def finished(self) -> bool:
        """Whether the end of the route is reached."""
        return self._number == len(self._stretches)

    @property
    def duration(self) -> float:
        """About how long the whole route takes [s]."""
        driving = sum(stretch.duration for stretch in self._stretches)
        ends = [(a.heading[-1], b.heading[0]) for a, b in pairwise(self._stretches)]
        turns = np.abs(_wrapped(np.array([b - a for a, b in ends])))
        return float(driving + (turns / self._config.turn_rate + 0.9).sum())

    def command(self, x: float, y: float, yaw: float) -> tuple[float, float]:
        """Speed [m/s] and turning rate [rad/s] for the next physics step."""
        if self.finished:
            return self._limited(0.0, 0.0)
        stretch = self._stretches[self._number]
        if self._turning:
            return self._turn_on_the_spot(stretch, yaw)
        return self._drive(stretch, x, y, yaw)

    def _turn_on_the_spot(self, stretch: Stretch, yaw: float) -> tuple[float, float]:
        """Towards the heading at which the stretch begins; no faster than can be braked."""
        left = _angle(float(stretch.heading[0]) - yaw)
        if abs(left) < 0.01 and abs(self._turn.value) < 0.05:
            self._turning = False
        brake = np.sqrt(1.6 * self._config.turn_acceleration * abs(left))
        rate = min(abs(self.ON_THE_SPOT * left), float(brake))
        return self._limited(0.0, rate if left > 0.0 else -rate)

    def _drive(self, stretch: Stretch, x: float, y: float, yaw: float) -> tuple[float, float]:
        """Along the line: its curvature, and what brings the base back to it."""
        last = len(stretch.speed) - 1
        self._advance(stretch, x, y)
        at = self._at
        if at == last:
            self._number, self._at, self._turning = self._number + 1, 0, True
            return self._limited(0.0, 0.0)
        ahead = min(at + 1 + int(self._speed.value * self.LEAD / SPACING), last)
        heading = float(stretch.heading[at])
        dx, dy = x - float(stretch.points[at, 0]), y - float(stretch.points[at, 1])
        beside = -np.sin(heading) * dx + np.cos(heading) * dy
        off = _angle(heading - yaw)
        speed = max(float(stretch.speed[ahead]), 0.03)
        bend = float(stretch.curvature[ahead]) - self.ACROSS * beside + self.ALONG * off
        return self._limited(speed, speed * bend)

    def _advance(self, stretch: Stretch, x: float, y: float) -> None:
        """Moves on to the first sample that the base has not yet passed."""
        last = len(stretch.speed) - 1
        while self._at < last:
            heading = float(stretch.heading[self._at])
            dx = x - float(stretch.points[self._at + 1, 0])
            dy = y - float(stretch.points[self._at + 1, 1])
            if np.cos(heading) * dx + np.sin(heading) * dy < 0.0:
                break
            self._at += 1

    def _limited(self, speed: float, turn: float) -> tuple[float, float]:
        """The wish, as far as turning rate, acceleration and jerk allow."""
        most = self._config.turn_rate
        return self._speed.towards(speed), self._turn.towards(max(-most, min(most, turn)))


def _angle(angle: float) -> float:
    """An angle in [-pi, pi)."""
    return (angle + np.pi) % (2.0 * np.pi) - np.pi
