"""Units of length, and whether a building of the size that they imply can be."""

from __future__ import annotations

import logging
import math
from pathlib import Path

import numpy as np

from slam.core import Array, InputError

METRE = ("m", "metre", "metres", "meter", "meters")
UNITS = {
    **dict.fromkeys(METRE, 1.0),
    **dict.fromkeys(("dm", "decimetre", "decimeter"), 0.1),
    **dict.fromkeys(("cm", "centimetre", "centimeter"), 0.01),
    **dict.fromkeys(("mm", "millimetre", "millimeter"), 0.001),
    **dict.fromkeys(("in", "inch", "inches"), 0.0254),
    **dict.fromkeys(("ft", "foot", "feet"), 0.3048),
}
COMMON = ("mm", "cm", "in", "ft")
"""Units that are proposed where metres make no sense."""
SMALLEST, LARGEST = 1.5, 1000.0
"""Sides of a building in plan [m]."""
USUAL, USUAL_HIGH = 150.0, 30.0
"""Sides and height beyond which metres are doubted, where no unit is declared [m]."""
LOWEST, HIGHEST = 1.0, 200.0
"""Heights of a building [m]."""

log = logging.getLogger(__name__)


def unit_scale(unit: str) -> float:
    """Metres in one unit. Raises InputError for an unknown one."""
    known = UNITS.get(unit.strip().lower())
    if known is not None:
        return known
    try:
        factor = float(unit)
    except ValueError:
        factor = math.nan
    if not (math.isfinite(factor) and factor > 0.0):
        raise InputError(f'unit "{unit}": expected m, cm, mm, in, ft or a factor to metres')
    return factor


def size_text(extent: Array) -> str:
    """An extent as people read it: ``58.6 x 45.7 x 2.8 m``."""
    sides = (f"{side:.1f}" if 1.0 <= side < 1e6 else f"{side:.3g}" for side in extent)
    return " x ".join(sides) + " m"


def plausible(extent: Array) -> bool:
    """Whether a building can be this large: (2,) or (3,) sides [m], the height last."""
    fits = SMALLEST <= float(np.max(extent[:2])) <= LARGEST
    return fits and (len(extent) < 3 or LOWEST <= float(extent[2]) <= HIGHEST)


def usual(extent: Array) -> bool:
    """Whether most buildings are no larger."""
    return float(np.max(extent[:2])) <= USUAL and float(extent[2:].max(initial=0.0)) <= USUAL_HIGH


def scale_to_metres(
    path: Path, extent: Array, declared: float | None, unit: str | None, field: str
) -> float:
    """Metres per unit of a file whose building measures ``extent`` in the file's own unit.

    unit: the user's word, which wins. declared: the file's. field: where the file would declare it.
    Without either, metres are taken and a warning says how large the building is then. Raises
    InputError where the building cannot be that large.
    """
    scale = unit_scale(unit) if unit is not None else (declared if declared is not None else 1.0)
    if not plausible(extent * scale):
        source = "the unit asked for" if unit is not None else field
        hint = "" if unit is not None else f"; {_advice(extent)}"
        raise InputError(
            f"{path}: {source}: the building would measure {size_text(extent * scale)}, expected "
            f"{SMALLEST:g} to {LARGEST:g} m and {LOWEST:g} to {HIGHEST:g} m high{hint}"
        )
    if unit is None and declared is None:
        log.warning(
            "%s: %s: no unit declared, taken as metres: the building measures %s%s",
            path,
            field,
            size_text(extent),
            "" if usual(extent) else f"; {_advice(extent)}",
        )
    return scale


def _advice(extent: Array) -> str:
    """Which units would make sense of a size."""
    fitting = [u for u in COMMON if plausible(extent * UNITS[u])]
    sizes = [f"{u} ({size_text(extent * UNITS[u])})" for u in fitting]
    return f"give its unit: {' or '.join(sizes)}" if sizes else "no usual unit makes sense of it"
