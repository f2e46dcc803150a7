"""What to say when a name is not known."""

from __future__ import annotations

from collections.abc import Iterable
from difflib import get_close_matches

from slam.core import InputError


def unknown_name(what: str, name: str, known: Iterable[str]) -> InputError:
    """The error for an unknown ``name``: the nearest known names, or else all of them."""
    names = list(known)
    folded = {n.lower(): n for n in names}
    near = [folded[n] for n in get_close_matches(name.lower(), folded, n=3, cutoff=0.5)]
    return InputError(f"unknown {what} '{name}', expected one of: {', '.join(near or names)}")
