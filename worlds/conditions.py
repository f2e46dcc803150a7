"""How far a building as built departs from its plan: presets by name."""

from __future__ import annotations

import difflib
from dataclasses import dataclass

from slam.core import InputError


@dataclass(frozen=True)
class Conditions:
    """Standard deviations of what happens to each wall body; all normal, independent.

    yaw, lean: turns about z and about the wall's foot [degrees]; shift: along its normal [m];
    thickness: change of its thickness [m].
    """

    name: str
    yaw: float = 0.15
    lean: float = 0.15
    shift: float = 0.005
    thickness: float = 0.003


AS_BUILT = Conditions("as-built")
IDEAL = Conditions("ideal", yaw=0.0, lean=0.0, shift=0.0, thickness=0.0)
CONDITIONS = {conditions.name: conditions for conditions in (AS_BUILT, IDEAL)}


def conditions_named(name: str) -> Conditions:
    """The preset of that name. Raises InputError, with the nearest names, for an unknown one."""
    if name not in CONDITIONS:
        near = difflib.get_close_matches(name, CONDITIONS, n=1, cutoff=0.4) or sorted(CONDITIONS)
        raise InputError(f'conditions "{name}": unknown, expected {" or ".join(near)}')
    return CONDITIONS[name]
