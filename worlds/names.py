"""What to say of a name that is not known. Light: the command line imports it at once."""

from __future__ import annotations

from collections.abc import Iterable
from difflib import get_close_matches

FEW = 16
"""More names than these are not listed in one line."""


def unknown(kind: str, name: str, names: Iterable[str]) -> str:
    """What to say of a name that is none of ``names``: the nearest one, and all if they are few."""
    names = list(names)
    folded = {known.lower(): known for known in names}
    near = get_close_matches(name.lower(), folded, n=1, cutoff=0.5)
    listed = f", expected one of: {', '.join(names)}" if len(names) <= FEW else ""
    hint = f" (did you mean {folded[near[0]]!r}?)" if near else ""
    return f"unknown {kind} {name!r}{listed}{hint}"
