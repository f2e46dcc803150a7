"""Refusing names and values that cannot be used. Light: numpy comes with the first refusal."""

from __future__ import annotations

from collections.abc import Iterable
from difflib import get_close_matches
from typing import NoReturn

FEW = 16
"""More names than these are not listed in one line."""


def refuse(message: str) -> NoReturn:
    """Raises InputError."""
    from slam.core import InputError

    raise InputError(message)


def known(what: str, name: str, names: Iterable[str]) -> str:
    """``name`` if it is one of ``names``; else InputError that names them and the nearest."""
    names = list(names)
    if name not in names:
        refuse(f"{what}: {unknown('name', name, names)}")
    return name


def unknown(kind: str, name: str, names: Iterable[str]) -> str:
    """What to say of a name that is none of ``names``: the nearest one, and all if they are few."""
    names = list(names)
    near = get_close_matches(name.lower(), names, n=1, cutoff=0.5)
    listed = f", expected one of: {', '.join(names)}" if len(names) <= FEW else ""
    hint = f" (did you mean {near[0]!r}?)" if near else ""
    return f"unknown {kind} {name!r}{listed}{hint}"
