"""What a user can say about a building's file that the file itself does not."""

from __future__ import annotations

from dataclasses import dataclass

from slam.core import InputError
from worlds.readers.units import unit_scale

AXES = ("y", "z")


@dataclass(frozen=True)
class ReaderOptions:
    """unit: of length, a name (``m``, ``mm``, ``in``, ``ft``) or a factor to metres (``0.0254``);
    it overrides what the file declares. up: the axis that points up, y or z, likewise. Raises
    InputError for others.
    """

    unit: str | None = None
    up: str | None = None

    def __post_init__(self) -> None:
        if self.unit is not None:
            unit_scale(self.unit)
        if self.up is not None and self.up not in AXES:
            raise InputError(f'up "{self.up}": expected {" or ".join(AXES)}')


DEFAULT = ReaderOptions()
