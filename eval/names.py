"""Refusing names and values that cannot be used. Light: numpy comes with the first refusal."""

from __future__ import annotations

from collections.abc import Iterable
from typing import NoReturn

from worlds.names import unknown


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
