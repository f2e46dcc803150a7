"""Refusing names and values that cannot be used. Light: numpy comes with the first refusal."""

from __future__ import annotations

from collections.abc import Iterable
from difflib import get_close_matches
from typing import NoReturn


def refuse(message: str) -> NoReturn:
    """Raises InputError."""
    from slam.core import InputError

    raise InputError(message)


def known(what: str, name: str, names: Iterable[str]) -> str:
    """``name`` if it is one of ``names``; else InputError that names them and the nearest."""
    names = list(names)
    if name in names:
        return name
    near = get_close_matches(name.lower(), names, n=1, cutoff=0.5)
    hint = f" (did you mean {near[0]!r}?)" if near else ""
    refuse(f"{what}: unknown name {name!r}, expected one of: {', '.join(names)}{hint}")
