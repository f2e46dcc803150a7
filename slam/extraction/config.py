"""The numbers that steer plane extraction."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class ExtractionConfig:
    """Metres and radians.

    window: length of run over which a beam's local direction is fitted; straight: largest RMS
    residual of a straight window, in standard deviations of the sweep's own noise, which lies
    within ``noise``; gap: a jump that ends a run, and far_gap the same as a share of the range,
    since returns lie far apart on a wall that one looks along; turn: of the local direction, which
    ends one too; near: so many standard deviations from its line a run goes on; min_run,
    min_run_points: smallest run.

    step, bend: two lines that are so far apart where one ends and the other begins, or differ so
    much in direction, and explain the returns better by a chi-square of ``gain``, are two walls;
    bent: a run whose RMS residual is so many standard deviations is cut wherever that helps.

    angle, distance: a run belongs to a plane when its direction and its distance are within these;
    reach: largest hole between runs of one plane (a door is 1 m); min_points, min_length: smallest
    plane; max_lean: no wall leans more over the others.

    beam_sigma: of a beam's range offset before it has been estimated from the sweep, rest_sigma:
    after that, at best; flat_sigma: of a wall from run to run where runs are compared, and
    wave_sigma from one ``stretch`` of it to the next where a plane is fitted; plumb_sigma: weak
    prior on a wall's tilt, so that a wall seen by one beam only does not topple, and level_sigma on
    a floor's; tilt_sigma: of the base; plumb_surely: what is not known so well is not told of the
    direction of plumb walls; motion_sigma: of what the motion within the sweep leaves of
    a ray's direction.

    floor_distance: half thickness of what is taken off as floor, and floor_width of what it is
    fitted to, since the feet of the walls stand on one side of it only; floor_slope: no floor that
    the base stands on is steeper to it; floor_min_points: returns of the smallest floor or ceiling,
    floor_min_beam: of a beam that it is fitted to; ramp: least and largest slope of one,
    ramp_min_points: of the smallest.

    max_range: returns from farther away, in plan, are of no plane; thin: voxel of the sample of
    points kept.
    """

    window: float = 0.35
    straight: float = 2.5
    noise: tuple[float, float] = (0.004, 0.02)
    gap: float = 0.25
    far_gap: float = 0.03
    turn: float = np.radians(8.0)
    near: float = 2.0
    min_run: float = 0.2
    min_run_points: int = 8
    step: float = 0.03
    bend: float = np.radians(1.5)
    gain: float = 25.0
    bent: float = 1.6
    angle: float = np.radians(1.0)
    distance: float = 0.035
    reach: float = 1.2
    min_points: int = 60
    min_length: float = 0.35
    max_lean: float = np.radians(3.0)
    beam_sigma: float = 0.015
    rest_sigma: float = 0.003
    flat_sigma: float = 0.004
    wave_sigma: float = 0.001
    stretch: float = 1.0
    plumb_sigma: float = np.radians(1.0)
    level_sigma: float = np.radians(2.0)
    tilt_sigma: float = np.radians(2.0)
    plumb_surely: float = np.radians(0.4)
    motion_sigma: float = 0.002
    floor_distance: float = 0.06
    floor_width: float = 0.025
    floor_slope: float = np.radians(1.5)
    ramp: tuple[float, float] = (np.radians(2.5), np.radians(14.0))
    ramp_min_points: int = 100
    floor_min_beam: int = 40
    floor_min_points: int = 200
    max_range: float = 25.0
    thin: float = 0.05
